"""Lines over a part of the area that is to be surveyed denser than the rest."""

import numpy as np
from shapely import LineString, MultiLineString, Point, Polygon
from shapely.affinity import rotate
from shapely.geometry.base import BaseGeometry

from app.arrays import FloatArray
from app.exploration.lines.lattice import longer_axis_rad

MOST_LINES = 400
LEAST_LINE = 0.2
"""Shorter pieces of lines than this part of their spacing are left out: the neighbours see what is there."""


def dense_lines(part: Polygon, free: BaseGeometry, spacing_m: float, start_m: FloatArray) -> FloatArray:
    """Return the ends (2 k, 2) of k parallel lines over a part of the free area, in the order in which they are flown.

    They run along the part's longer side, evenly, no farther apart than asked, and begin at the corner that is nearest.

    Parameters
    ----------
    part
        What is to be surveyed, in the mission's frame.
    free
        The area without its keep-out zones.
    spacing_m
        Distance between lines.
    start_m : (2,)
        Where the vehicle comes from.

    Raises
    ------
    ValueError
        When there would be too many lines, or nothing of the part can be flown over.
    """
    here = part.intersection(free)
    if here.is_empty or here.area <= 0.0:
        raise ValueError("nothing of it lies inside the area and clear of the keep-out zones")
    # Turned so that lines run along east.
    turn_rad = -longer_axis_rad(np.asarray(part.exterior.coords)[:-1])
    turned = rotate(here, turn_rad, origin=(0.0, 0.0), use_radians=True)
    west, south, east, north = turned.bounds
    count = max(1, int(np.ceil((north - south) / spacing_m - 1e-9)))
    if count > MOST_LINES:
        raise ValueError(f"{count} lines are more than the {MOST_LINES} that one order may have")
    at_m = south + (np.arange(count) + 0.5) * (north - south) / count
    lines = [_pieces(turned, west, east, float(y), LEAST_LINE * spacing_m) for y in at_m]
    lines = [pieces for pieces in lines if pieces]
    if not lines:
        raise ValueError(f"it is smaller than its line spacing of {spacing_m:g} m can show")
    start = np.asarray(rotate(Point(*start_m), turn_rad, origin=(0.0, 0.0), use_radians=True).coords)[0]
    orders = [_in_order(lines, upwards=up, eastwards=right) for up in (True, False) for right in (True, False)]
    best = min(orders, key=lambda ends: float(np.hypot(*(ends[0] - start))))
    cos, sin = np.cos(-turn_rad), np.sin(-turn_rad)
    return np.asarray(best @ np.array([[cos, sin], [-sin, cos]]))


def _pieces(area: BaseGeometry, west: float, east: float, north: float, least_m: float) -> list[FloatArray]:
    """Return the pieces (2, 2) of one line that lie in the area, west to east."""
    cut = area.intersection(LineString([(west - 1.0, north), (east + 1.0, north)]))
    found = list(cut.geoms) if isinstance(cut, MultiLineString) else [cut]
    pieces = [np.asarray(one.coords)[[0, -1]] for one in found if isinstance(one, LineString) and one.length > least_m]
    return sorted((piece[np.argsort(piece[:, 0])] for piece in pieces), key=lambda piece: float(piece[0, 0]))


def _in_order(lines: list[list[FloatArray]], *, upwards: bool, eastwards: bool) -> FloatArray:
    ends: list[FloatArray] = []
    for pieces in lines if upwards else lines[::-1]:
        ends += pieces if eastwards else [piece[::-1] for piece in pieces[::-1]]
        eastwards = not eastwards
    return np.vstack(ends)
