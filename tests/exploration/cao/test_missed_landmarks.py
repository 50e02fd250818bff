"""Teams do not stay where a landmark is estimated that is not seen there."""

import json

import numpy as np
import pytest

from app.arrays import FloatArray
from app.estimation import RangeSensor
from app.exploration.cao.regressors.missed import MOST, MissedLandmarks
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
STEP, SIGHT = 0.05, 0.3
START = np.array([[-0.6, 0.0, 0.8], [-0.6, -0.2, 0.8]])


def belief_of(points: FloatArray, sd: FloatArray, whole: bool) -> Belief:
    """Landmarks (n, 3) none of which is accurate; ``whole``: in all three dimensions."""
    n = len(points)
    covariance = None
    if whole:
        covariance = np.zeros((n, 3, 3))
        covariance[:, range(3), range(3)] = sd[:, None] ** 2
    return Belief(points[:, :2], points[:, 2], sd, np.zeros(n, dtype=bool), np.ones(n), 0.2, covariance)


def fly(com_range_m: float, whole: bool, steps: int = 60, *, put_away: bool = False) -> FloatArray:
    """Positions (steps, 2, 3) of two vehicles to which nothing that they do shows anything.

    ``put_away``: the planner is made anew from what it remembers at every step.
    """
    points = np.array([[-0.5, -0.1, 1.0], [0.6, -0.1, 1.0]])
    belief = belief_of(points, np.array([0.2, 0.2]), whole)
    constraints = Constraints(
        SQUARE, (), STEP, 0.0, 1.0, min_altitude_m=0.1, com_range_m=com_range_m, min_separation_m=0.05
    )
    options, sensor = PlannerOptions(regressors="map"), RangeSensor(SIGHT, 0.05)
    planner, at, rng, places = create_planner("cao", options, sensor), START, np.random.default_rng(1), []
    for step in range(1, steps + 1):
        team = Situation(step, steps, ("a", "b"), at, np.full(2, np.nan), belief, np.zeros((0, 2)), constraints)
        at = planner.propose(team, rng).positions
        places.append(at)
        if put_away:
            state = planner.snapshot()
            planner = create_planner("cao", options, sensor)
            planner.restore(state)
    return np.array(places)


@pytest.mark.parametrize("com_range_m", [0.4, np.inf])
@pytest.mark.parametrize("whole", [False, True])
def test_a_landmark_that_is_not_seen_where_it_is_estimated_is_left_for_another(com_range_m: float, whole: bool) -> None:
    places = fly(com_range_m, whole)
    closest = np.hypot(places[..., 0] - 0.6, places[..., 1] + 0.1).min()
    assert closest < SIGHT


def test_a_planner_that_was_put_away_goes_on_alike() -> None:
    np.testing.assert_allclose(fly(0.4, whole=True, put_away=True), fly(0.4, whole=True))


def looked(belief: Belief, memory: MissedLandmarks, times: int) -> None:
    points = np.column_stack([belief.xy_m, belief.depth_m])
    for _ in range(times):
        memory.update(belief, points, START, SIGHT)


def test_what_is_learnt_of_a_landmark_makes_good_what_was_missed() -> None:
    near, far = [-0.6, 0.0, 0.9], [0.9, 0.9, 0.9]
    memory = MissedLandmarks()
    looked(belief_of(np.array([near, far]), np.array([0.2, 0.2]), whole=True), memory, 1 + MOST)
    assert memory.set_aside.tolist() == [True, False]
    again = MissedLandmarks()
    again.recall(json.loads(json.dumps(memory.remember())))
    assert again.set_aside.tolist() == [True, False]
    looked(belief_of(np.array([near, far]), np.array([0.19, 0.2]), whole=True), again, 1)
    assert again.set_aside.tolist() == [False, False]


@pytest.mark.parametrize(("whole", "aside"), [(True, False), (False, True)])
def test_unseen_ones_are_missed_only_where_their_place_is_known(whole: bool, aside: bool) -> None:
    memory = MissedLandmarks()
    looked(belief_of(np.array([[-0.6, 0.0, 0.9]]), np.array([np.inf]), whole), memory, 2 + MOST)
    assert memory.set_aside.tolist() == [aside]
