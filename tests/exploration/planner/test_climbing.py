"""Legs along planned routes over ground that makes vehicles climb."""

from itertools import pairwise

import numpy as np
import pytest

from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planners import create_planner


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_vehicle_that_climbs_over_ground_does_not_turn_back_to_corners_that_it_cut(name: str, seed: int) -> None:
    """Climbing makes legs shorter than planned: what they passed is behind all the same."""
    side_m, team = 120.0, ("a", "b")
    east_m, north_m = np.meshgrid(np.arange(2.0, side_m, 4.0), np.arange(2.0, side_m, 4.0))
    xy = np.column_stack([east_m.ravel(), north_m.ravel()])
    depth_m = 5.5 + 1.5 * np.sin(xy[:, 0] / 9.0 + seed) + 1.5 * np.cos(xy[:, 1] / 7.0)
    belief = Belief(xy, depth_m, np.full(len(xy), 0.05), np.zeros(len(xy), bool), np.ones(len(xy)), 15.0)
    square = np.array([[0.0, 0.0], [side_m, 0.0], [side_m, side_m], [0.0, side_m]])
    limits = Constraints(square, max_step_m=10.0, max_depth_m=10.0, min_altitude_m=2.0)
    planner, rng = create_planner(name), np.random.default_rng(seed)
    place, heading, way_m = np.array([[3.0, 3.0, 1.0], [8.0, 3.0, 2.0]]), np.zeros(2), 400.0
    legs: list[list[np.ndarray]] = [[], []]
    left_m = np.full(2, way_m)
    sounded = np.zeros((0, 2))
    for step in range(1, 60):
        if (left_m < 1.0).all():
            break
        told = Situation(step, 80, team, place, heading, belief, sounded, limits, left_m=left_m)
        to = planner.propose(told, rng).positions
        moved = to[:, :2] - place[:, :2]
        for k in np.flatnonzero(left_m >= 1.0):
            legs[k].append(moved[k])
        left_m = np.maximum(left_m - np.hypot(*moved.T), 0.0)
        sounded = np.vstack([sounded, 0.5 * (to[:, :2] + place[:, :2]), to[:, :2]])
        heading, place = np.arctan2(*moved.T), to
    back = 0
    for flown in legs:
        for one, two in pairwise(flown):
            lengths = np.hypot(*one) * np.hypot(*two)
            back += bool(lengths > 0.0 and float(one @ two) < np.cos(np.deg2rad(150.0)) * lengths)
    assert back == 0, "no line of these plans leads back along itself"
    short = sum(0.0 < np.hypot(*leg) < 0.5 for flown in legs for leg in flown[:-2])
    assert short == 0, "nobody is sent to a place that it has as good as reached"
