"""What runs inside QGIS: a command each line, an answer each line, both JSON. Needs the system's Python."""

import json
import sys
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsProject,
    QgsRasterLayer,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor

WEB_MERCATOR = QgsCoordinateReferenceSystem("EPSG:3857")
LAYERS: dict[str, Any] = {}


def _add(name: str, layer: Any) -> None:
    if not layer.isValid():
        raise ValueError(f"layer {name} is not valid: {layer.error().summary()}")
    LAYERS[name] = layer


def add_tiles(name: str, address: str, max_zoom: int) -> None:
    escaped = address.replace("&", "%26").replace("=", "%3D")
    _add(name, QgsRasterLayer(f"type=xyz&url={escaped}&zmin=0&zmax={max_zoom}", name, "wms"))


def add_features(name: str, address: str, collection: str) -> None:
    _add(name, QgsVectorLayer(f" url='{address}' typename='{collection}'", name, "OAPIF"))


def count(name: str) -> int:
    LAYERS[name].dataProvider().reloadData()
    return sum(1 for _ in LAYERS[name].getFeatures())


def extent(name: str) -> list[float]:
    layer = LAYERS[name]
    box = QgsRectangle()
    box.setMinimal()
    for feature in layer.getFeatures():
        box.combineExtentWith(feature.geometry().boundingBox())
    moved = QgsCoordinateTransform(layer.crs(), WEB_MERCATOR, QgsProject.instance()).transformBoundingBox(box)
    return [moved.xMinimum(), moved.yMinimum(), moved.xMaximum(), moved.yMaximum()]


def picture(path: str, names: list[str], extent: list[float], width: int, height: int) -> None:
    settings = QgsMapSettings()
    settings.setDestinationCrs(WEB_MERCATOR)
    settings.setLayers([LAYERS[name] for name in names])
    settings.setExtent(QgsRectangle(*extent))
    settings.setOutputSize(QSize(width, height))
    settings.setBackgroundColor(QColor("white"))
    for name in names:
        LAYERS[name].dataProvider().reloadData()
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    if job.errors():
        raise ValueError("; ".join(f"{error.layerID}: {error.message}" for error in job.errors()))
    if not job.renderedImage().save(path):
        raise ValueError(f"{path} cannot be written")


COMMANDS = {one.__name__: one for one in (add_tiles, add_features, count, extent, picture)}


def main() -> None:
    application = QgsApplication([], False)
    application.initQgis()
    for line in sys.stdin:
        asked = json.loads(line)
        try:
            answer = {"found": COMMANDS[asked.pop("command")](**asked)}
        except Exception as error:
            answer = {"error": str(error)}
        print(json.dumps(answer))


if __name__ == "__main__":
    main()
