"""Where along its planned legs a vehicle has to turn back at the latest."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.missions.recovery.failsafes import drift_reserve_s, with_reserve_s
from app.missions.recovery.way_home import way_time_s

STEP_M = 5.0
"""The place is looked for in steps of this length."""


def turn_back_place(
    start_m: FloatArray,
    legs_m: FloatArray,
    left_s: float,
    needs_s: Callable[[FloatArray], float],
    speed_mps: float,
    current_mps: tuple[float, float],
) -> FloatArray | None:
    """Return the last place on planned legs from which the energy lasts for the way home, (2,); None: it lasts for all.

    Parameters
    ----------
    start_m : (2,)
        Where the vehicle is; returned where it has to turn back now.
    legs_m : (n, 2)
        Ends of its legs, first to last.
    left_s
        How long its energy lasts for sure at ``speed_mps``.
    needs_s
        Returns how long the way home takes from a place (2,), seconds; inf where there is none.
    current_mps
        East and north; what helps along the legs is not counted, and the reserve has what makes up for a drift in it.
    """
    if not legs_m.size:
        return None
    spent_s, last = 0.0, start_m
    drift_s = drift_reserve_s(speed_mps, current_mps)
    if with_reserve_s(needs_s(start_m), drift_s) > left_s:
        return start_m
    for a, b in pairwise(np.vstack([start_m, legs_m])):
        leg_s = way_time_s(a, b[None], speed_mps, current_mps)
        pieces = max(1, math.ceil(float(np.hypot(*(b - a))) / STEP_M))
        for share in np.arange(1, pieces + 1) / pieces:
            place = a + share * (b - a)
            if spent_s + share * leg_s + with_reserve_s(needs_s(place), drift_s) > left_s:
                return last
            last = place
        spent_s += leg_s
    return None
