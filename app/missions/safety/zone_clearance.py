"""Room about keep-out zones: a leg that is planned past a corner is free from wherever its vehicle begins it.

A vehicle has arrived within a radius of where its leg ends, and begins the next one there. Where a plan keeps off the
zones by that radius, so does each place on the way from there to the end of the next leg: none is farther from the
planned one than the beginning.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import nearest_points

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.safety import room

SMALLER = (1.0, 0.5, 0.25)
"""Parts of the room that are tried where all of it would close a way."""

LEAST_GROUND_M2 = 1.0
"""Smaller ground is none that anybody goes to."""


def room_around(area: FloatArray, zones: Sequence[FloatArray], room_m: float) -> tuple[FloatArray, ...]:
    """Return zones widened by as much room as closes no way between them, or to the border.

    Parameters
    ----------
    area : (n, 2)
    zones : sequence of (n, 2)
        What vehicles are kept off; a zone has no room about it where even a part of it would close a way.

    Returns
    -------
    tuple of (n, 2)
        Counter-clockwise and not closed.
    """
    if room_m <= 0.0 or not zones:
        return ()
    ground = Polygon(area).difference(shapely.union_all([Polygon(zone) for zone in zones]))
    parts, left, around = _parts(ground), ground, []
    for zone in zones:
        for part in SMALLER:
            wide = room.widened(zone, part * room_m)
            tried = left.difference(Polygon(wide))
            if _hold_together(parts, tried):
                around.append(wide)
                left = tried
                break
    return tuple(around)


def clear_of_zones(constraints: Constraints, place_m: FloatArray) -> FloatArray:
    """Return the nearest place to one, (2,), where plans may leave a vehicle: in no zone, nor its margin, nor room."""
    zones = [Polygon(zone) for zone in constraints.for_plans.keep_out]
    here = Point(place_m)
    if not any(zone.contains(here) for zone in zones):
        return place_m
    ground = Polygon(constraints.area).difference(shapely.union_all(zones))
    if ground.is_empty:
        return place_m
    nearest, _ = nearest_points(ground, here)
    return np.array([nearest.x, nearest.y])


def _hold_together(parts: list[Polygon], left: BaseGeometry) -> bool:
    """Whether of each part of the ground one piece is left."""
    pieces = _parts(left)
    within = np.array([[part.intersects(piece.representative_point()) for piece in pieces] for part in parts])
    return bool((within.sum(axis=1) == 1).all()) if within.size else not parts


def _parts(ground: BaseGeometry) -> list[Polygon]:
    pieces = getattr(ground, "geoms", [ground])
    return [piece for piece in pieces if isinstance(piece, Polygon) and piece.area >= LEAST_GROUND_M2]
