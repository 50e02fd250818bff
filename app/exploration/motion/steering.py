"""Where a vehicle that cannot turn on the spot comes by on its way in the next moment."""

import math
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.timeline import SLOWEST_SHARE, Timeline

STEP_S = 1.0

PASSED_WITHIN_M = 3.0
"""A place that a vehicle is beyond counts as passed when it is no farther away than this."""


def steered_motion(
    places: list[FloatArray],
    heading_rad: float,
    speed_mps: float,
    radius_m: float,
    current_mps: tuple[float, float],
    until_s: float,
) -> Timeline:
    """Return the motion of a vehicle that steers for one place after the other, from 0 s on.

    It turns towards the next place as fast as it can, and heads into the current as much as that takes it aside. Where
    it comes to the last place it stays.

    Parameters
    ----------
    places
        Where it is, and where it goes, each (3,): east, north and depth. Depths change evenly in between.
    heading_rad
        Where it heads first, clockwise from north; NaN: towards the first place.
    speed_mps
        Through the water.
    radius_m
        Of the circles in which it turns.
    current_mps
        East and north.
    until_s
        How far ahead is looked.
    """
    east, north, depth = (float(value) for value in places[0])
    time_s, heading = 0.0, heading_rad
    times, path = [0.0], [(east, north, depth)]
    turns_rad = math.inf if radius_m <= 0.0 else speed_mps * STEP_S / radius_m
    for begin, place in pairwise(places):
        to_east, to_north, to_depth = (float(value) for value in place)
        leg_east, leg_north = to_east - float(begin[0]), to_north - float(begin[1])
        while time_s < until_s:
            away_east, away_north = to_east - east, to_north - north
            away_m = math.hypot(away_east, away_north)
            beyond = away_east * leg_east + away_north * leg_north <= 0.0
            if away_m <= 0.5 * speed_mps * STEP_S or (beyond and away_m <= PASSED_WITHIN_M):
                break
            aside_mps = (current_mps[0] * away_north - current_mps[1] * away_east) / away_m
            crab_rad = math.asin(max(-1.0, min(1.0, aside_mps / speed_mps)))
            wanted_rad = math.atan2(away_east, away_north) - crab_rad
            if math.isnan(heading):
                heading = wanted_rad
            off_rad = math.remainder(wanted_rad - heading, 2.0 * math.pi)
            heading += max(-turns_rad, min(turns_rad, off_rad))
            east_mps = speed_mps * math.sin(heading) + current_mps[0]
            north_mps = speed_mps * math.cos(heading) + current_mps[1]
            # The last step of a straight way ends at the place.
            over_mps = max(math.hypot(east_mps, north_mps), SLOWEST_SHARE * speed_mps)
            takes_s = min(STEP_S, away_m / over_mps) if abs(off_rad) <= turns_rad else STEP_S
            east, north = east + takes_s * east_mps, north + takes_s * north_mps
            depth += (to_depth - depth) * min(over_mps * takes_s / away_m, 1.0)
            time_s += takes_s
            times.append(time_s)
            path.append((east, north, depth))
    return Timeline(np.array(times), np.array(path))
