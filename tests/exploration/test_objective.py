"""The terms against a slow, literal transcription of AURO15 eq. (8)-(15) with the errata."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.estimation import LandmarkSets
from app.exploration.objective import ObjectiveWeights, VehicleProgress, objective, switches


def draw(seed, n=3, m=40):
    rng = np.random.default_rng(seed)
    positions, landmarks = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (m, 3))
    accurate, visible = rng.random(m) < 0.3, rng.random((n, m)) < 0.3
    pending = ~visible.any(axis=0) & ~accurate
    sets = LandmarkSets(accurate, rng.integers(0, 9, n), visible, pending)
    return positions, landmarks, sets


def slow_terms(positions, landmarks, sets, before, s1, s2, s3):
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
        if sets.pending[m]:
            J3 -= s3[j] * squared[j]
    return J, J1, J2, J3


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_terms_match_the_slow_reference(seed):
    positions, landmarks, sets = draw(seed)
    rng = np.random.default_rng(seed + 1)
    earlier, before = (
        VehicleProgress(rng.integers(0, 3, 3).astype(float), rng.integers(0, 2, 3).astype(float), np.zeros(3))
        for _ in range(2)
    )
    weights = ObjectiveWeights(K1=2.0, K2=3.0, K3=5.0)
    result = objective(positions, landmarks, sets, 7, earlier, before, weights)
    s = switches(earlier, before, weights)
    expected = slow_terms(positions, landmarks, sets, 7, *s)
    assert pytest.approx(expected) == (result.J, result.J1, result.J2, result.J3)
    assert result.total == pytest.approx(sum(expected))


def test_switches_are_closed_while_a_vehicle_gains_and_open_in_a_deadlock():
    weights = ObjectiveWeights(K1=1.0, K2=2.0, K3=3.0)
    earlier = VehicleProgress(np.array([5.0, 5, 5]), np.array([1.0, 1, 1]), np.array([-1.0, -1, -1]))
    before = VehicleProgress(np.array([6.0, 5, 5]), np.array([1.0, 2, 1]), np.array([-1.0, -1, -1]))
    s1, s2, s3 = switches(earlier, before, weights)
    assert s1.tolist() == [0, 1, 1]
    assert s2.tolist() == [0, 2, 2]
    assert s3.tolist() == [0, 0, 3]


def test_the_finished_map_is_the_maximum():
    positions, landmarks, sets = draw(3)
    done = LandmarkSets(np.ones(40, dtype=bool), sets.accurate_count_by, sets.visible_by, np.zeros(40, dtype=bool))
    finished = objective(positions, landmarks, done, 0).total
    rest = [objective(*draw(k)[:2], draw(k)[2], 0).J + objective(*draw(k)[:2], draw(k)[2], 0).J2 for k in range(20)]
    assert finished == 40.0
    assert finished >= max(rest)


def test_landmarks_of_unknown_depth_count_at_the_mean_depth():
    positions = np.zeros((1, 3))
    landmarks = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, np.nan]])
    sets = LandmarkSets(np.zeros(2, bool), np.zeros(1, np.int64), np.zeros((1, 2), bool), np.ones(2, bool))
    assert pytest.approx(-(1 + 4) - (1 + 4)) == objective(positions, landmarks, sets, 0).J3
