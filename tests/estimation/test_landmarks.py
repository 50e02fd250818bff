from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from app.arrays import FloatArray
from app.estimation import LandmarkEstimator, Landmarks, RangeSensor, SingleBeam, landmark_sets

SENSOR = RangeSensor(visibility_m=0.4, relative_noise=0.1)


def look(
    landmarks: Landmarks,
    truth: FloatArray,
    positions: FloatArray,
    rng: np.random.Generator,
    estimator: LandmarkEstimator,
    vehicle: int = 0,
) -> Landmarks:
    for position in positions:
        index = np.arange(len(truth))
        landmarks = estimator.update(landmarks, vehicle, position, index, SENSOR.measure(position, truth[index], rng))
    return landmarks


def test_estimates_converge_to_the_truth() -> None:
    rng = np.random.default_rng(0)
    truth = np.column_stack([rng.uniform(-0.1, 0.1, (50, 2)), rng.uniform(0.5, 0.7, 50)])
    positions = np.column_stack([rng.uniform(-0.1, 0.1, (200, 2)), np.full(200, 0.35)])
    result = look(Landmarks.unknown(truth[:, :2]), truth, positions, rng, LandmarkEstimator(SENSOR))
    error = result.depth_m - truth[:, 2]
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert result.accurate.all()


def test_matches_a_batch_least_squares_solution() -> None:
    rng = np.random.default_rng(4)
    xy, z = np.array([[0.05, -0.02]]), 0.6
    positions = np.column_stack([rng.uniform(-0.1, 0.1, (40, 2)), rng.uniform(0.2, 0.35, 40)])
    ranges = np.array([SENSOR.measure(p, np.array([[*xy[0], z]]), rng)[0] for p in positions])
    state, estimator = Landmarks.unknown(xy), LandmarkEstimator(SENSOR)
    for p, y in zip(positions, ranges, strict=True):
        state = estimator.update(state, 0, p, np.array([0]), np.array([y]))

    def residual(depth: FloatArray) -> Any:
        r = np.sqrt(((positions[:, :2] - xy) ** 2).sum(axis=1) + (depth[0] - positions[:, 2]) ** 2)
        return (ranges - r) / (0.1 * r)

    batch = least_squares(residual, [0.6]).x[0]
    assert state.depth_m[0] == pytest.approx(batch, abs=np.sqrt(state.variance_m2[0]))


@given(seed=st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_accurate_landmarks_stay_accurate_whatever_comes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = np.column_stack([rng.uniform(-0.3, 0.3, (20, 2)), rng.uniform(0.4, 0.8, 20)])
    state, estimator = Landmarks.unknown(truth[:, :2]), LandmarkEstimator(SENSOR, visit_cap=30)
    for k in range(15):
        position = np.array([*rng.uniform(-0.3, 0.3, 2), 0.2])
        after = look(state, truth, position[None], rng, estimator, vehicle=k % 2)
        assert (after.accurate | ~state.accurate).all()
        assert (after.variance_m2 > 0.0).all()
        assert np.isfinite(after.depth_m).all()
        assert np.isfinite(after.variance_m2).all()
        state = after


def test_a_landmark_looked_at_too_often_counts_as_done() -> None:
    rng = np.random.default_rng(0)
    truth = np.array([[0.0, 0.0, 0.5]])
    estimator = LandmarkEstimator(SENSOR, accuracy_sd_m=1e-9, visit_cap=5)
    state = look(Landmarks.unknown(truth[:, :2]), truth, np.tile([0.0, 0.0, 0.3], (5, 1)), rng, estimator)
    assert not state.accurate[0]
    state = look(state, truth, np.array([[0.0, 0.0, 0.3]]), rng, estimator, vehicle=2)
    assert state.accurate[0]
    assert state.credited[0] == 2


def test_sets_follow_the_definitions() -> None:
    state = Landmarks.unknown(np.zeros((4, 2)))
    state.accurate[0] = True
    state.credited[0] = 1
    state.looks[:] = [3, 1, 1, 0]
    visible_by = np.array([[True, True, False, False], [False, False, False, False]])
    sets = landmark_sets(state, visible_by)
    assert sets.unfinished.tolist() == [False, True, False, False]
    assert sets.pending.tolist() == [False, False, True, False]
    assert sets.accurate_count_by.tolist() == [0, 1]
    state.looks[2] = 0
    assert landmark_sets(state, visible_by).pending.tolist() == [False, False, True, True]


def test_what_is_too_far_or_unknown_is_not_visible() -> None:
    landmarks = np.array([[0.0, 0.0, 0.39], [0.0, 0.0, 0.41], [0.0, 0.0, np.nan]])
    assert SENSOR.visible(np.zeros((1, 3)), landmarks).tolist() == [[True, False, False]]


def test_noise_grows_with_range() -> None:
    rng = np.random.default_rng(0)
    beam = SingleBeam(0.01)
    vehicle, bottom = np.full(4000, 2.0), np.repeat([4.0, 22.0], 2000)
    depth = beam.measure(vehicle, bottom, rng)
    assert depth[:2000].std() == pytest.approx(0.02, rel=0.1)
    assert depth[2000:].std() == pytest.approx(0.2, rel=0.1)
    assert beam.sd_m(vehicle, bottom)[[0, -1]].tolist() == pytest.approx([0.02, 0.2])


def test_measuring_nothing_changes_nothing() -> None:
    state = Landmarks.unknown(np.zeros((3, 2)))
    after = LandmarkEstimator(SENSOR).update(state, 0, np.zeros(3), np.zeros(0, dtype=np.int64), np.zeros(0))
    assert not after.accurate.any()
    assert not after.seen.any()
