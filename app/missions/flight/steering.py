"""Where a vehicle that cannot turn on the spot comes by: leg after leg, as simulated vehicles steer."""

import math
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.timeline import SLOWEST_SHARE, Timeline
from imc_bridge.control.orders import PASSED_WITHIN_M
from simulator.vehicles.vehicle import LEFT_BEHIND, TOO_CLOSE

STEP_M = 1.0
"""A vehicle's way is made of pieces that are at most so long,"""
STEPS_OF_RADIUS = 4.0
"""and of so many on its turning circle's radius."""

MOST_CIRCLES = 2.0
"""After so many whole circles more than a leg is long a vehicle gives its end up."""

ARRIVES_S, LEAST_RADIUS_M = 0.5, 0.5
"""In a motion a place is reached this long before a vehicle is there; it turns in no circle smaller than this."""


def steered(
    pose: tuple[float, float, float],
    end: tuple[float, float],
    radius_m: float,
    arrival_m: float,
    *,
    drift: tuple[float, float] = (0.0, 0.0),
    most_m: float = math.inf,
) -> tuple[FloatArray, FloatArray]:
    """Return the poses (n, 3) of a vehicle that steers for a place, and how long its way is to each of them, (n,).

    It ends where the vehicle is there.

    Parameters
    ----------
    pose
        East, north, heading; of one without a heading (NaN) any will do.
    end
        East, north.
    arrival_m
        It is there within so many metres, or when it has passed the place close by, as seen from where it set out.
    drift
        East and north, where the water takes it for each metre of its way through the water. It heads into that.
    most_m
        After so long a way no more is looked at.
    """
    east, north, heading = pose
    to_east, to_north = end[0] - east, end[1] - north
    away_m = math.hypot(to_east, to_north)
    if math.isnan(heading):
        heading = math.atan2(to_east, to_north)
    step_m = min(STEP_M, radius_m / STEPS_OF_RADIUS)
    # Against the current a way through the water is longer.
    made_good = max(1.0 - math.hypot(*drift), SLOWEST_SHARE)
    most_m = min((away_m + MOST_CIRCLES * math.tau * radius_m) / made_good, most_m)
    poses, ways_m = [(east, north, heading)], [0.0]
    way_m, along_m = 0.0, 0.0
    off_east, off_north, off_m = to_east, to_north, away_m
    leaving = False
    while off_m > arrival_m and not (along_m >= away_m and off_m <= PASSED_WITHIN_M) and way_m < most_m:
        piece_m = min(step_m, max(off_m - arrival_m, 0.01))
        aside_east, aside_north = radius_m * math.cos(heading), -radius_m * math.sin(heading)
        to_centre_m = min(
            math.hypot(off_east - aside_east, off_north - aside_north),
            math.hypot(off_east + aside_east, off_north + aside_north),
        )
        leaving = to_centre_m < (LEFT_BEHIND if leaving else TOO_CLOSE) * radius_m
        if not leaving:
            aside = (drift[0] * off_north - drift[1] * off_east) / off_m
            wanted = math.atan2(off_east, off_north) - math.asin(max(-1.0, min(aside, 1.0)))
            turn = math.remainder(wanted - heading, math.tau)
            heading += max(-piece_m / radius_m, min(turn, piece_m / radius_m))
        east += piece_m * (math.sin(heading) + drift[0])
        north += piece_m * (math.cos(heading) + drift[1])
        way_m += piece_m
        poses.append((east, north, heading))
        ways_m.append(way_m)
        off_east, off_north = end[0] - east, end[1] - north
        off_m = math.hypot(off_east, off_north)
        along_m = ((east - pose[0]) * to_east + (north - pose[1]) * to_north) / away_m
    return np.array(poses), np.array(ways_m)


def steered_motion(
    places: list[FloatArray],
    heading_rad: float,
    speed_mps: float,
    radius_m: float,
    current_mps: tuple[float, float],
    until_s: float,
) -> Timeline:
    """Return the motion of a vehicle that steers for one place after the other, from 0 s on; at the last it stays.

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
    pose = (float(places[0][0]), float(places[0][1]), heading_rad)
    drift = (current_mps[0] / speed_mps, current_mps[1] / speed_mps)
    radius_m, most_m = max(radius_m, LEAST_RADIUS_M), until_s * speed_mps
    times, path = [np.zeros(1)], [np.asarray(places[0], dtype=np.float64)[None]]
    way_m = 0.0
    for begin, end in pairwise(places):
        if way_m >= most_m:
            break
        to_m = (float(end[0]), float(end[1]))
        poses, ways_m = steered(pose, to_m, radius_m, ARRIVES_S * speed_mps, drift=drift, most_m=most_m - way_m)
        if len(poses) > 1:
            part = ways_m[1:] / ways_m[-1]
            depth_m = begin[2] + part * (end[2] - begin[2])
            times.append((way_m + ways_m[1:]) / speed_mps)
            path.append(np.column_stack([poses[1:, :2], depth_m]))
        pose, way_m = (float(poses[-1, 0]), float(poses[-1, 1]), float(poses[-1, 2])), way_m + float(ways_m[-1])
    return Timeline(np.concatenate(times), np.concatenate(path))
