"""The lines and areas of a file as they are answered."""

from collections.abc import Sequence

import numpy as np
import pyproj
import shapely

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.operations.imports.reader_process import DrawnShape
from app.missions.spec.base import PolygonGeometry
from app.missions.views.measurements.imports import DrawingView, DrawnAreaView, DrawnLineView

DECIMALS = 9
"""Of degrees: a tenth of a millimetre, so that what was projected lies where it did."""
MOST_ACROSS_DEG = 0.5
DETAIL_M = 0.5
MITRE = 2.0
"""So many times as far as its sides the corners of the area around lines may reach."""


def drawing_view(shapes: Sequence[DrawnShape], notes: Sequence[str], margin_m: float) -> DrawingView:
    """Return what a file holds, with lengths and sizes; areas that cross themselves are noted.

    ``margin_m``: how far the area around all lines reaches beyond them.
    """
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
    around = _around([line.coordinates for line in lines], margin_m) if lines else None
    return DrawingView(lines=lines, areas=areas, around=around, notes=told)


def _around(lines: Sequence[Sequence[tuple[float, float]]], margin_m: float) -> PolygonGeometry | None:
    """Return the smallest convex area that reaches so far beyond all lines; None where they lie all over the world."""
    lons, lats = np.array([place for line in lines for place in line]).T
    if np.ptp(lons) > MOST_ACROSS_DEG or np.ptp(lats) > MOST_ACROSS_DEG:
        return None
    frame = LocalFrame(float(lats.mean()), float(lons.mean()))
    hull = shapely.convex_hull(shapely.multipoints(np.column_stack(frame.to_local(lats, lons))))
    # Ends of parallel lines lie side by side, which makes a corner of each.
    plain = shapely.simplify(hull, DETAIL_M)
    outline = shapely.get_coordinates(shapely.buffer(plain, margin_m, join_style="mitre", mitre_limit=MITRE))
    around_lats, around_lons = frame.to_geographic(*outline.T)
    return PolygonGeometry(
        coordinates=[[(round(lon, 7), round(lat, 7)) for lon, lat in zip(around_lons, around_lats, strict=True)]]
    )
