"""What runs inside QGIS: a command each line, an answer each line, both JSON. Needs the system's Python."""

import json
import sys
from typing import Any

from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsFeatureRequest,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsPointXY,
    QgsProject,
    QgsRaster,
    QgsRasterLayer,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QCoreApplication, QSize
from qgis.PyQt.QtGui import QColor

WEB_MERCATOR = QgsCoordinateReferenceSystem("EPSG:3857")
LAYERS: dict[str, Any] = {}
SAID: list[str] = []
"""What QGIS's log of messages was told since the last command."""


def _add(name: str, layer: Any) -> None:
    QCoreApplication.processEvents()
    if not layer.isValid():
        # The layer's own list of errors may be empty, which its summary() does not survive.
        raise ValueError(f"layer {name} is not valid: {'; '.join(SAID)}")
    LAYERS[name] = layer


def add_tiles(name: str, address: str, max_zoom: int) -> None:
    _add(name, QgsRasterLayer(f"type=xyz&url={_escaped(address)}&zmin=0&zmax={max_zoom}", name, "wms"))


def add_map(name: str, address: str, layers: list[str], crs: str) -> None:
    what = "".join(f"&layers={layer}&styles=" for layer in layers)
    source = f"contextualWMSLegend=0&crs={crs}&dpiMode=7&format=image/png{what}&url={_escaped(address)}"
    _add(name, QgsRasterLayer(source, name, "wms"))


def _escaped(address: str) -> str:
    return address.replace("&", "%26").replace("=", "%3D")


def add_features(name: str, address: str, collection: str) -> None:
    _add(name, QgsVectorLayer(f" url='{address}' typename='{collection}'", name, "OAPIF"))


def count(name: str, extent: list[float] | None) -> int:
    layer, asked = LAYERS[name], QgsFeatureRequest()
    layer.dataProvider().reloadData()
    if extent is not None:
        to_layer = QgsCoordinateTransform(WEB_MERCATOR, layer.crs(), QgsProject.instance())
        asked.setFilterRect(to_layer.transformBoundingBox(QgsRectangle(*extent)))
    return sum(1 for _ in layer.getFeatures(asked))


def extent(name: str) -> list[float]:
    """Return where a layer lies: features by themselves, for what they are said to lie in may be wider."""
    layer = LAYERS[name]
    box = layer.extent()
    if isinstance(layer, QgsVectorLayer):
        box = QgsRectangle()
        box.setMinimal()
        for feature in layer.getFeatures():
            box.combineExtentWith(feature.geometry().boundingBox())
    moved = QgsCoordinateTransform(layer.crs(), WEB_MERCATOR, QgsProject.instance()).transformBoundingBox(box)
    return [moved.xMinimum(), moved.yMinimum(), moved.xMaximum(), moved.yMaximum()]


def identify(name: str, extent: list[float], width: int, height: int) -> str:
    """Return what is said of the middle of a view, in the format that QGIS takes where nobody chooses one."""
    box, provider = QgsRectangle(*extent), LAYERS[name].dataProvider()
    # As QgsMapToolIdentify does.
    offered = [QgsRaster.IdentifyFormatFeature, QgsRaster.IdentifyFormatValue, QgsRaster.IdentifyFormatHtml]
    can = int(provider.capabilities())
    chosen = next(one for one in offered if can & int(provider.identifyFormatToCapability(one)))
    found = provider.identify(QgsPointXY(box.center()), chosen, box, width, height)
    if not found.isValid():
        raise ValueError("; ".join(message.message() for message in found.error().messageList()))
    return "".join(found.results().values())


def picture(path: str, names: list[str], extent: list[float], width: int, height: int, crs: str) -> None:
    system, project = QgsCoordinateReferenceSystem(crs), QgsProject.instance()
    settings = QgsMapSettings()
    settings.setDestinationCrs(system)
    settings.setLayers([LAYERS[name] for name in names])
    settings.setExtent(
        QgsCoordinateTransform(WEB_MERCATOR, system, project).transformBoundingBox(QgsRectangle(*extent))
    )
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


COMMANDS = {one.__name__: one for one in (add_tiles, add_map, add_features, count, extent, identify, picture)}


def main() -> None:
    application = QgsApplication([], False)
    application.initQgis()
    QgsApplication.messageLog().messageReceived.connect(lambda *said: SAID.append(str(said[0])))
    for line in sys.stdin:
        asked = json.loads(line)
        SAID.clear()
        try:
            answer = {"found": COMMANDS[asked.pop("command")](**asked)}
        except Exception as error:
            answer = {"error": str(error)}
        sys.stdout.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    main()
