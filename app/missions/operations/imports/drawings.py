"""The lines and areas of a file as they are answered."""

from collections.abc import Sequence

import pyproj

from app.missions.operations.imports.reader_process import DrawnShape
from app.missions.spec.base import PolygonGeometry
from app.missions.views.measurements.imports import DrawingView, DrawnAreaView, DrawnLineView

DECIMALS = 9
"""Of degrees: a tenth of a millimetre, so that what was projected lies where it did."""


def drawing_view(shapes: Sequence[DrawnShape], notes: Sequence[str]) -> DrawingView:
    """Return what a file holds, with lengths and sizes; areas that cross themselves are noted."""
    lines, areas, told = [], [], list(notes)
    ellipsoid = pyproj.Geod(ellps="WGS84")
    for shape in shapes:
        places = [(round(lon, DECIMALS), round(lat, DECIMALS)) for lon, lat in shape.places]
        lons, lats = zip(*places, strict=True)
        if shape.kind == "line":
            length_m = float(ellipsoid.line_length(lons, lats))
            lines.append(DrawnLineView(name=shape.name, coordinates=places, length_m=round(length_m, 2)))
            continue
        try:
            geometry = PolygonGeometry(coordinates=[places])
        except ValueError:
            told.append(f"area {shape.name} is left out: its outline crosses or touches itself")
            continue
        area_m2 = abs(float(ellipsoid.polygon_area_perimeter(lons, lats)[0]))
        areas.append(DrawnAreaView(name=shape.name, area=geometry, area_m2=round(area_m2, 1)))
    return DrawingView(lines=lines, areas=areas, notes=told)
