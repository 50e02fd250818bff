"""The parts that keep-out zones cut an area into, where no way leads from one into another."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.polygon import orient

from app.arrays import FloatArray, IntArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace


def parts_of(constraints: Constraints, free: FreeSpace, en_m: FloatArray) -> Iterator[tuple[Constraints, IntArray]]:
    """Yield the limits in each part of an area with vehicles in it, and which vehicles that are, (k,).

    Who is in none is taken to be in the nearest. Of an area in one part the limits are those of the area.

    Parameters
    ----------
    free
        The area without its zones; parts narrower than four times its margin are left out.
    en_m : (n_vehicles, 2)
        Where the vehicles are.
    """
    parts = [part for part in free.parts() if not part.buffer(-2.0 * free.margin_m, join_style="mitre").is_empty]
    if len(parts) < 2:
        yield constraints, np.arange(len(en_m))
        return
    away_m = np.array([shapely.distance(part, shapely.points(en_m)) for part in parts])
    within, area = np.argmin(away_m, axis=0), Polygon(constraints.area)
    for k in np.unique(within):
        # With its zones: what is planned in it keeps off them and off its borders as elsewhere.
        whole = parts[k].buffer(free.margin_m, join_style="mitre").intersection(area)
        corners = np.asarray(orient(whole).exterior.coords)[:-1]
        yield replace(constraints, area=corners), np.flatnonzero(within == k)


def is_cut_off(constraints: Constraints, margin_m: float, here_m: FloatArray, stop_m: FloatArray) -> bool:
    """Whether a zone lies between two places (2,), and no way leads round it."""
    leg = LineString([here_m, stop_m])
    if not any(Polygon(zone).intersects(leg) for zone in constraints.keep_out):
        return False
    return len(FreeSpace(constraints, margin_m).way(here_m, stop_m)) < 2
