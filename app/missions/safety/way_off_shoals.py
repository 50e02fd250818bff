"""The way of a vehicle off a shoal, or out of what shoals cut off: straight to open ground, at the surface."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.open_ground import OpenGround
from app.missions.safety import free_space

WAYS = 400
"""Of the places that are deep enough, so many are looked at, the nearest ones first."""

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
        Places of other vehicles, from which the end keeps the least separation.
    room_m
        How far from zones the way leads, where the vehicle is not nearer already.
    """
    free = inside_area(constraints.for_plans, ground.centres_m) & ground.largest_part(place_m).ravel()
    for other in taken:
        free &= np.hypot(*(ground.centres_m - other[:2]).T) >= constraints.min_separation_m
    known = np.isfinite(bottom.depth_m)
    for goal in (known & ground.is_roomy, ~known):
        ends = ground.centres_m[free & goal.ravel()]
        ends = ends[np.argsort(np.hypot(*(ends - place_m).T), kind="stable")[:WAYS]]
        found = _best(place_m, ends, bottom, constraints, room_m)
        if found is not None:
            return found
    return None


def _best(
    place_m: FloatArray, ends_m: FloatArray, bottom: Bottom, constraints: Constraints, room_m: float
) -> FloatArray | None:
    here_m = float(np.fmin(bottom.at(place_m), np.inf))
    ways: list[tuple[float, FloatArray]] = []
    for end in ends_m:
        away_m = float(np.hypot(*(end - place_m)))
        along = np.linspace(0.0, 1.0, 2 + int(2.0 * away_m / bottom.cell_m))
        depths_m = bottom.at(place_m + along[along * away_m >= OWN * bottom.cell_m, None] * (end - place_m))
        least_m = float(np.fmin.reduce(depths_m, initial=np.inf))
        # Whatever the map says, there is water where it is.
        if least_m > 0.0 or least_m >= here_m:
            ways.append((round(min(least_m, constraints.min_altitude_m) / ALIKE_M), end))
    area = Polygon(constraints.area).buffer(free_space.START_OUTSIDE_M)
    # The nearest come first, and stay so among those that are alike.
    for _, end in sorted(ways, key=lambda way: -way[0]):
        inside = area.covers(shapely.linestrings([place_m, end]))
        if inside and not free_space.barred(constraints, place_m, end, room_m):
            return end
    return None
