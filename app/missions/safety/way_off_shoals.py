"""The way of a vehicle off a shoal, or out of what shoals cut off: straight to open ground, at the surface."""

from collections.abc import Sequence

import numpy as np
from shapely.geometry import LineString, Point

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import TOLERANCE_M, WHERE, Constraints, inside_area
from app.exploration.core.open_ground import OpenGround
from app.missions.safety import room

SECTORS, OF_SECTOR = 72, 6
"""Of the places that are deep enough the nearest are looked at, so many in each of so many directions."""

OWN = 1.0
"""Ground within so many cells of where a vehicle is does not tell its ways apart."""

ALIKE_M = 0.05
"""Ways whose shoalest places differ by less are as good as each other: the shorter one is flown."""


def way_off(
    place_m: FloatArray,
    ground: OpenGround,
    bottom: Bottom,
    constraints: Constraints,
    taken: Sequence[FloatArray],
    room_m: float,
) -> FloatArray | None:
    """Return where a vehicle that shoals cut off goes at the surface, (2,); None where there is no way.

    It goes to the largest part of the open ground on its side of zones: to where that is known to be deep enough, or
    else to where nobody knows it. Of the ways there it takes one whose shoalest place is as deep as any, or deep
    enough, and of those the shortest. None leads over ground that is dry, and shoaler than where the vehicle is.

    Parameters
    ----------
    place_m : (2,)
        Where the vehicle is.
    ground, bottom
        As it is estimated, below the surface as it is now.
    constraints
        Area, zones, and separation.
    taken : sequence of (2,)
        Places of other vehicles. The end keeps the least separation from them, the way comes no nearer than that, or
        than the vehicle is already.
    room_m
        How far from zones the way leads, where the vehicle is not nearer already.
    """
    free = inside_area(constraints.for_plans, ground.centres_m) & ground.largest_part(place_m).ravel()
    for other in taken:
        free &= np.hypot(*(ground.centres_m - other[:2]).T) >= constraints.min_separation_m
    known = np.isfinite(bottom.depth_m)
    for goal in (known & ground.is_roomy, ~known):
        ends = ground.centres_m[free & goal.ravel()]
        found = _best(place_m, _nearest(place_m, ends), bottom, constraints, taken, room_m)
        if found is not None:
            return found
    return None


def _nearest(place_m: FloatArray, ends_m: FloatArray) -> FloatArray:
    """Return the ends (n, 2) that are nearest in each direction, the nearest of all first."""
    east_m, north_m = (ends_m - place_m).T
    order = np.argsort(np.hypot(east_m, north_m), kind="stable")
    sector = np.floor((np.arctan2(east_m, north_m)[order] / (2.0 * np.pi) % 1.0) * SECTORS).astype(int)
    by_sector = np.argsort(sector, kind="stable")
    first = np.searchsorted(sector[by_sector], sector[by_sector])
    rank = np.empty(len(order), dtype=int)
    rank[by_sector] = np.arange(len(order)) - first
    return ends_m[order[rank < OF_SECTOR]]


def _best(
    place_m: FloatArray,
    ends_m: FloatArray,
    bottom: Bottom,
    constraints: Constraints,
    taken: Sequence[FloatArray],
    room_m: float,
) -> FloatArray | None:
    """Return the end (2,) of the best way to one of the ends (n, 2), the nearest first; None where all are barred."""
    here_m = float(np.fmin(bottom.at(place_m), np.inf))
    ways: list[tuple[float, FloatArray]] = []
    for end in ends_m:
        away_m = float(np.hypot(*(end - place_m)))
        along = np.linspace(0.0, 1.0, 2 + int(2.0 * away_m / bottom.cell_m))
        on_way = place_m + along[:, None] * (end - place_m)
        depths_m = bottom.at(on_way)
        # Whatever the map says, there is water where it is.
        own = (_cell(on_way, bottom) == _cell(place_m, bottom)).all(axis=1)
        driest_m = float(np.fmin.reduce(depths_m[~own], initial=np.inf))
        if driest_m > 0.0 or driest_m >= here_m:
            least_m = float(np.fmin.reduce(depths_m[along * away_m >= OWN * bottom.cell_m], initial=np.inf))
            ways.append((round(min(least_m, constraints.min_altitude_m) / ALIKE_M), end))
    # The nearest stay first among those that are alike.
    for _, end in sorted(ways, key=lambda way: -way[0]):
        if _is_free(place_m, end, constraints, taken, room_m):
            return end
    return None


def _cell(places: FloatArray, bottom: Bottom) -> FloatArray:
    return np.floor((places - [bottom.west_m, bottom.south_m]) / bottom.cell_m)


def _is_free(
    place_m: FloatArray, end_m: FloatArray, constraints: Constraints, taken: Sequence[FloatArray], room_m: float
) -> bool:
    """Return whether a way at the surface stays in the area, off zones, and apart from other vehicles."""
    here, there = np.append(place_m, 0.0)[None], np.append(end_m, 0.0)[None]
    if any(broken.limit in WHERE for broken in constraints.violations(("",), here, there)):
        return False
    if room.barred(constraints, place_m, end_m, room_m):
        return False
    way = LineString([place_m, end_m])
    apart_m = [min(constraints.min_separation_m, float(np.hypot(*(other[:2] - place_m)))) for other in taken]
    return all(
        way.distance(Point(other[:2])) >= least_m - TOLERANCE_M for other, least_m in zip(taken, apart_m, strict=True)
    )
