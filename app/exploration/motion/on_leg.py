"""What a vehicle's track has in common with the legs that it was sent on."""

import math

Place = tuple[float, float]
"""East and north, metres."""

ASIDE_M = 4.0
"""A vehicle that is no farther than this from its leg's line is on it."""
LEAST_COSINE = math.cos(math.radians(45.0))
"""And its course leads no farther aside than this."""


def along_leg(start: Place, end: Place, leg: tuple[Place, Place]) -> bool:
    """Whether a piece of track leads along a leg, close to its line."""
    (from_e, from_n), (to_e, to_n) = leg
    leg_e, leg_n = to_e - from_e, to_n - from_n
    way_e, way_n = end[0] - start[0], end[1] - start[1]
    leg_m, way_m = math.hypot(leg_e, leg_n), math.hypot(way_e, way_n)
    if leg_m == 0.0 or way_m == 0.0:
        return False
    aside_m = abs((end[0] - from_e) * leg_n - (end[1] - from_n) * leg_e) / leg_m
    return aside_m <= ASIDE_M and (leg_e * way_e + leg_n * way_n) / (leg_m * way_m) >= LEAST_COSINE
