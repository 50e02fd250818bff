"""How deep vehicles travel: what the bottom, as it may be, leaves them."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.motion.turning import ahead_of_end

LEG_SAMPLES = 9
MOST_LEG_SAMPLES = 200
RISE = 0.2
"""Metres a metre that vehicles rise where the bottom does: what a LAUV is seen to."""
CLIMB = 0.5 * RISE
"""What one is trusted to rise while it turns into its next leg."""
WAY_SPACING_M = 5.0
DEPTH_TOLERANCE_M = 0.25
"""A vehicle that keeps its layer may be this much deeper than asked."""


def travel_depth_m(
    origin: FloatArray, target: FloatArray, wanted_m: float, bottom: Bottom, min_altitude_m: float
) -> float:
    """Return the depth for a leg: as wanted, or shallower where the bottom leaves less room; 0 is the surface.

    Parameters
    ----------
    origin, target : (2,)
        Ends of the leg, east and north.
    bottom : Bottom
        Pessimistic sea floor: estimate minus its uncertainty. NaN where nothing is known.
    """
    along = np.linspace(0.0, 1.0, LEG_SAMPLES)[:, None]
    return _least(wanted_m, bottom.at(origin + along * (target - origin)) - min_altitude_m)


def depth_above_bottom_m(
    origin: FloatArray,
    target: FloatArray,
    altitude_m: float,
    otherwise_m: float,
    bottom: Bottom,
    constraints: Constraints,
    turn_radius_m: float = 0.0,
) -> float:
    """Return the depth for a leg of a vehicle that keeps a height above the bottom; 0 is the surface.

    Where part of the leg is over ground that nobody knows, it travels as deep as if it kept a depth, if that is less.
    Beyond its end it turns, no one knows yet whereto: it is so high that it can rise in time wherever the bottom does.

    Parameters
    ----------
    origin, target : (2,)
        Ends of the leg, east and north.
    altitude_m
        Height above the shallowest ground on the leg, if it is not less than the least.
    otherwise_m
        Depth of travel over unknown ground.
    bottom : Bottom
        Pessimistic sea floor: estimate minus its uncertainty. NaN where nothing is known.
    turn_radius_m
        Of its turning circle.
    """
    height_m = max(altitude_m, constraints.min_altitude_m)
    leg_m = target - origin
    length_m = float(np.hypot(*leg_m))
    pieces = max(LEG_SAMPLES, min(math.ceil(length_m / bottom.cell_m), MOST_LEG_SAMPLES))
    depths = bottom.at(origin + np.linspace(0.0, 1.0, pieces)[:, None] * leg_m)
    known = np.isfinite(depths)
    deepest_m = constraints.max_depth_m if known.all() else otherwise_m
    if length_m > 0.0 and turn_radius_m > 0.0:
        beyond_m, away_m = ahead_of_end(target, float(np.arctan2(*leg_m)), turn_radius_m)
        deepest_m = _least(deepest_m, bottom.at(beyond_m) - height_m + CLIMB * away_m)
    return _least(deepest_m, depths - height_m)


def depth_over_m(depth_m: float, ways: Sequence[FloatArray], bottom: Bottom, min_altitude_m: float) -> float:
    """Return the depth over places that a vehicle passes: as wanted, or shallower where the bottom leaves less room.

    Parameters
    ----------
    ways : sequence of (n, 2)
        The places.
    """
    for places in ways:
        depth_m = _least(depth_m, bottom.at(places) - min_altitude_m)
    return depth_m


def _least(depth_m: float, room_m: FloatArray) -> float:
    """Return a depth, or the least room (n,) that is known where that is less; 0 is the surface."""
    known = room_m[np.isfinite(room_m)]
    return depth_m if len(known) == 0 else float(min(depth_m, max(known.min(), 0.0)))


def too_deep(layer_m: float, safe_m: float) -> str:
    """Return why a vehicle whose console sends it at its layer's depth, whatever it is told, has to stay; '' if not."""
    if safe_m >= layer_m - DEPTH_TOLERANCE_M:
        return ""
    return (
        f"its console sends it at {layer_m:g} m whatever it is told, and there {safe_m:.1f} m is the deepest that is "
        "safe: it stays where it is"
    )


def bottom_on_way(way: FloatArray, bottom: Bottom) -> FloatArray:
    """Return what is known of the bottom on a way: rows of east, north, depth.

    Parameters
    ----------
    way : (n, 2)
        Its corners.
    bottom : Bottom
        Pessimistic sea floor.
    """
    legs = []
    for a, b in pairwise(way):
        pieces = max(math.ceil(float(np.linalg.norm(b - a)) / WAY_SPACING_M), 1)
        legs.append(a + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (b - a))
    places = np.concatenate(legs)
    depths = bottom.at(places)
    known = np.isfinite(depths)
    return np.column_stack([places[known], depths[known]])
