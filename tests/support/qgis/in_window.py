"""What QGIS's own window runs (``qgis --code``): adds a mission's layers, waits until all are drawn, saves a picture.

``BATHYFLEET_SHOWN`` has the service's address, the mission, where the picture goes and the window's size as JSON.
"""

import json
import os
from typing import Any

from qgis.core import (
    QgsCategorizedSymbolRenderer,
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsFillSymbol,
    QgsLineSymbol,
    QgsMarkerSymbol,
    QgsPalLayerSettings,
    QgsProject,
    QgsRasterLayer,
    QgsRendererCategory,
    QgsTextBufferSettings,
    QgsTextFormat,
    QgsVectorLayer,
    QgsVectorLayerSimpleLabeling,
    QgsWkbTypes,
)
from qgis.PyQt.QtCore import QTimer
from qgis.PyQt.QtGui import QColor
from qgis.PyQt.QtWidgets import QDockWidget
from qgis.utils import iface

SHOWN: dict[str, Any] = json.loads(os.environ["BATHYFLEET_SHOWN"])
COLOURS = ("#d1495b", "#edae49", "#66418a")
LAID_OUT_MS, DRAWN_MS = 2000, 4000
"""How long docks take to find their places, and views to be drawn, after the last change."""


def add_map() -> QgsRasterLayer:
    address = f"{SHOWN['url']}/wms/missions/{SHOWN['mission']}"
    source = f"crs=EPSG:3857&dpiMode=7&format=image/png&layers=depth&styles=default&url={address}"
    layer = QgsRasterLayer(source, "Depth (WMS)", "wms")
    layer.setAutoRefreshInterval(5000)
    layer.setAutoRefreshEnabled(True)
    return layer


def add_features(collection: str, title: str) -> QgsVectorLayer:
    address = f"{SHOWN['url']}/ogc/missions/{SHOWN['mission']}"
    return QgsVectorLayer(f" url='{address}' typename='{collection}'", title, "OAPIF")


def label(layer: QgsVectorLayer, expression: str, size: float) -> None:
    text, around, settings = QgsTextFormat(), QgsTextBufferSettings(), QgsPalLayerSettings()
    around.setEnabled(True)
    around.setSize(0.8)
    text.setSize(size)
    text.setColor(QColor("#1d2733"))
    text.setBuffer(around)
    settings.fieldName, settings.isExpression = expression, True
    settings.setFormat(text)
    if layer.geometryType() == QgsWkbTypes.LineGeometry:
        settings.placement = QgsPalLayerSettings.Curved
    layer.setLabeling(QgsVectorLayerSimpleLabeling(settings))
    layer.setLabelsEnabled(True)


def by_vehicle(layer: QgsVectorLayer, symbol: Any) -> None:
    names = sorted({feature["vehicle"] for feature in layer.getFeatures()})
    layer.setRenderer(
        QgsCategorizedSymbolRenderer(
            "vehicle",
            [QgsRendererCategory(n, symbol(COLOURS[i % len(COLOURS)]), n) for i, n in enumerate(names)],
        )
    )


def begin() -> None:
    for dock in iface.mainWindow().findChildren(QDockWidget):
        dock.setVisible(dock.objectName() == "Layers")
    area, contours = add_features("areas", "Area"), add_features("contours", "Contours")
    soundings, tracks = add_features("soundings", "Soundings"), add_features("tracks", "Tracks")
    vehicles = add_features("vehicles", "Vehicles now")
    area.renderer().setSymbol(QgsFillSymbol.createSimple({"style": "no", "outline_color": "#1d2733"}))
    contours.renderer().setSymbol(QgsLineSymbol.createSimple({"color": "#40505f", "width": "0.3"}))
    label(contours, "to_string(depth_m) || ' m'", 8)
    dot = {"name": "circle", "size": "1.1", "color": "#ffffff", "outline_color": "#40505f", "outline_width": "0.1"}
    soundings.renderer().setSymbol(QgsMarkerSymbol.createSimple(dot))
    by_vehicle(tracks, lambda colour: QgsLineSymbol.createSimple({"color": colour, "width": "0.6"}))
    by_vehicle(vehicles, lambda colour: QgsMarkerSymbol.createSimple({"name": "circle", "size": "4", "color": colour}))
    label(vehicles, "vehicle", 11)
    QgsProject.instance().addMapLayers([vehicles, soundings, tracks, contours, area, add_map()])
    iface.mainWindow().resize(*SHOWN["size"])
    QTimer.singleShot(LAID_OUT_MS, lambda: show(area))


def show(area: QgsVectorLayer) -> None:
    # The first layer has given the project its system meanwhile.
    project = QgsProject.instance()
    project.setCrs(QgsCoordinateReferenceSystem("EPSG:3857"))
    extent = QgsCoordinateTransform(area.crs(), project.crs(), project).transformBoundingBox(area.extent())
    iface.mapCanvas().setExtent(extent.buffered(extent.width() * 0.03))
    iface.mapCanvas().refresh()
    QTimer.singleShot(DRAWN_MS, save)


def save() -> None:
    if iface.mapCanvas().isDrawing():
        QTimer.singleShot(DRAWN_MS, save)
        return
    iface.mainWindow().grab().save(SHOWN["picture"])
    QgsProject.instance().setDirty(False)
    os._exit(0)  # nothing is to be saved, nobody to be asked


begin()
