"""The terms against a slow, literal transcription of AURO15 eq. (8)-(15) with the errata."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation import LandmarkSets
from app.exploration.core.objective import (
    ObjectiveWeights,
    VehicleProgress,
    med13_objective,
    objective,
    switches,
    with_depths,
)


def draw(seed: int, n: int = 3, m: int = 40) -> Any:
    rng = np.random.default_rng(seed)
    positions, landmarks = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (m, 3))
    accurate, visible = rng.random(m) < 0.3, rng.random((n, m)) < 0.3
    pending = ~visible.any(axis=0) & ~accurate
    sets = LandmarkSets(accurate, rng.integers(0, 9, n), visible, pending)
    return positions, landmarks, sets


def slow_terms(positions: FloatArray, landmarks: FloatArray, sets: Any, before: Any, s1: Any, s2: Any, s3: Any) -> Any:
    n = len(positions)
    J = sum(bool(x) for x in sets.accurate) - before
    J1 = J2 = J3 = 0.0
    for j in range(n):
        J1 += s1[j] * sum(1 for m in range(len(landmarks)) if sets.visible_by[j, m] and not sets.accurate[m])
    for m in range(len(landmarks)):
        squared = [sum((positions[i, k] - landmarks[m, k]) ** 2 for k in range(3)) for i in range(n)]
        j = squared.index(min(squared))
        if any(sets.visible_by[i, m] for i in range(n)) and not sets.accurate[m]:
            J2 -= s2[j] * squared[j]
    for j in range(n):
        away = [
            sum((positions[j, k] - landmarks[m, k]) ** 2 for k in range(3))
            for m in range(len(landmarks))
            if sets.pending[m]
        ]
        if away:
            J3 -= s3[j] * min(away)
    return J, J1, J2, J3


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_terms_match_the_slow_reference(seed: int) -> None:
    positions, landmarks, sets = draw(seed)
    rng = np.random.default_rng(seed + 1)
    earlier, before = (
        VehicleProgress(rng.integers(0, 3, 3).astype(float), rng.integers(0, 2, 3).astype(float), np.zeros(3))
        for _ in range(2)
    )
    weights = ObjectiveWeights(K1=2.0, K2=3.0, K3=5.0)
    result = objective(positions, landmarks, sets, 7, earlier, before, weights)
    s = switches(earlier, before, weights)
    assert s is not None
    expected = slow_terms(positions, landmarks, sets, 7, *s)
    assert pytest.approx(expected) == (result.J, result.J1, result.J2, result.J3)
    assert result.total == pytest.approx(sum(expected))


def test_switches_are_closed_while_a_vehicle_gains_and_open_in_a_deadlock() -> None:
    weights = ObjectiveWeights(K1=1.0, K2=2.0, K3=3.0)
    earlier = VehicleProgress(np.array([5.0, 5, 5]), np.array([1.0, 1, 1]), np.array([-1.0, -1, -1]))
    before = VehicleProgress(np.array([6.0, 5, 5]), np.array([1.0, 2, 1]), np.array([-1.0, -1, -1]))
    opened = switches(earlier, before, weights)
    assert opened is not None
    s1, s2, s3 = opened
    assert s1.tolist() == [0, 1, 1]
    assert s2.tolist() == [0, 2, 2]
    assert s3.tolist() == [0, 0, 3]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_no_configuration_is_worth_more_than_the_one_that_finishes_the_map(seed: int) -> None:
    # J1 rewards landmarks that are seen but not finished, so the maximum is the finished map as long as K1 is below the
    # worth of finishing them: what one more vehicle sees of a landmark counts no more than making it accurate.
    positions, landmarks, sets = draw(seed)
    n, m = sets.visible_by.shape
    done = LandmarkSets(np.ones(m, dtype=bool), sets.accurate_count_by, sets.visible_by, np.zeros(m, dtype=bool))
    weights = ObjectiveWeights(K1=1.0 / n)
    before = int(sets.accurate.sum())
    finished = objective(positions, landmarks, done, before, weights=weights)
    assert finished.total == m - before
    assert (finished.J1, finished.J2, finished.J3) == (0.0, 0.0, 0.0)
    assert finished.total >= objective(positions, landmarks, sets, before, weights=weights).total
    finished_cost, cost = med13_objective(positions, landmarks, done), med13_objective(positions, landmarks, sets)
    assert finished_cost.total == 0.0 >= cost.total


@given(seed=st.integers(0, 10_000), K=st.floats(0.1, 5.0))
@settings(max_examples=40, deadline=None)
def test_the_cost_of_med13_matches_the_slow_reference(seed: int, K: Any) -> None:
    positions, landmarks, sets = draw(seed)
    cost = 0.0
    for q in range(len(landmarks)):
        seen = any(sets.visible_by[j, q] for j in range(len(positions)))
        if seen and not sets.accurate[q]:
            cost += min(sum((x[k] - landmarks[q, k]) ** 2 for k in range(3)) for x in positions)
        elif not seen and not sets.accurate[q]:
            cost += K
    assert med13_objective(positions, landmarks, sets, K).total == pytest.approx(-cost)


@pytest.mark.parametrize(("terms", "kept"), [("J", 0), ("J+J1", 1), ("J+J1+J2", 2), ("full", 3)])
def test_each_term_can_be_left_out(terms: Any, kept: Any) -> None:
    positions, landmarks, sets = draw(5)
    weights = ObjectiveWeights.of(terms)
    result = objective(positions, landmarks, sets, 0, weights=weights)
    assert [value != 0.0 for value in (result.J1, result.J2, result.J3)] == [kept > k for k in range(3)]


def test_open_switches_stay_open_whatever_the_vehicles_gain() -> None:
    earlier = VehicleProgress(np.array([5.0]), np.array([1.0]), np.array([-1.0]))
    before = VehicleProgress(np.array([9.0]), np.array([7.0]), np.array([-3.0]))
    assert [s.tolist() for s in switches(earlier, before, ObjectiveWeights.of("full"))] == [[0], [0], [0]]
    opened = switches(earlier, before, ObjectiveWeights.of("full", switched=False))
    assert [s.tolist() for s in opened] == [[1], [1], [1]]


def test_landmarks_of_unknown_depth_count_at_the_mean_depth() -> None:
    positions = np.zeros((1, 3))
    landmarks = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, np.nan]])
    sets = LandmarkSets(np.zeros(2, bool), np.zeros(1, np.int64), np.zeros((1, 2), bool), np.ones(2, bool))
    assert pytest.approx(-(1 + 4)) == objective(positions, landmarks, sets, 0).J3
    assert with_depths(landmarks)[1].tolist() == [0.0, 1.0, 2.0]
