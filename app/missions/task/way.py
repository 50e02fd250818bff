"""How a vehicle's way is counted: what legs take of it, how much is planned for, and how little is none."""

from collections.abc import Sequence

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.leg_rules import LEAST_WAY_M
from app.missions.spec.mission import MissionSpec

RESERVE = 0.06
"""Share of the remaining steps that a planner is not told of: vehicles turn in circles and pass waypoints at the side,
so a plan that needs every step would end with its last line half flown. What is not used is released bit by bit."""

STILL_M = 0.5
"""Who goes no farther holds its place, which takes as much of its way as the longest leg: it flies circles there."""


def way_m(ends_m: Sequence[FloatArray], spec: MissionSpec) -> float:
    """Return how much of a vehicle's way legs take from one of these places (2,) to the next."""
    lengths_m = np.hypot(*np.diff(np.array(ends_m), axis=0).T)
    return float(np.where(lengths_m > STILL_M, lengths_m, spec.limits.max_step_m).sum())


def planned_way_m(spec: MissionSpec, left_m: float) -> float:
    """Return how much of the way that a vehicle has left is planned for, metres.

    Where legs are counted, those that end at a corner are shorter than a step, and count all the same.
    """
    if spec.budget.steps is None:
        return left_m
    return max((1.0 - RESERVE) * left_m, min(left_m, spec.limits.max_step_m))


def least_way_m(spec: MissionSpec) -> float:
    """Return how much of its way a vehicle has left that still goes on."""
    # By the clock somewhat more or less is left when its last leg ends. Nearer than it arrives it is there already.
    return LEAST_WAY_M if spec.budget.minutes is None else max(spec.arrival_radius_m, LEAST_WAY_M)
