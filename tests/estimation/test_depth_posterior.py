"""The posterior of a landmark's depth: against all ranges at once on a fine grid, and against the truth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from app.arrays import FloatArray
from app.estimation import LandmarkEstimator, Landmarks, Multibeam, RangeSensor
from app.estimation.depth_posterior import STEEP, TYPICAL_SLOPE, TYPICAL_STEP, from_neighbours
from app.estimation.sensors import Ranging

SENSOR = RangeSensor(visibility_m=0.4, relative_noise=0.1)
FINE = np.arange(-2.0, 3.0, 0.0005)


def taken(xy: FloatArray, looks: list[tuple[FloatArray, FloatArray]], sensor: Ranging = SENSOR) -> Landmarks:
    """What is known after all landmarks were ranged to from each position."""
    state, estimator = Landmarks.unknown(xy), LandmarkEstimator(sensor)
    for position, ranges in looks:
        state = estimator.update(state, 0, position, np.arange(len(xy)), ranges)
    return state


def all_at_once(xy: FloatArray, looks: list[tuple[FloatArray, float]], noise: float) -> FloatArray:
    """Density of one landmark's depth at ``FINE``, written out: no grid that narrows, nothing taken in one by one."""
    density, steepest = np.zeros(len(FINE)), np.zeros(len(FINE))
    for position, y in looks:
        h = float(np.hypot(*(xy - position[:2])))
        r = np.hypot(h, FINE - position[2])
        density += stats.norm.logpdf(y, r, noise * r)
        steepest = np.maximum(steepest, (position[2] - FINE) / h)
    density += np.log(stats.expon.sf(steepest, scale=TYPICAL_SLOPE) + STEEP)
    weights = np.exp(density - density.max())
    return np.asarray(weights / weights.sum())


def possibility(weights: FloatArray, cut: float) -> slice:
    """Where the possibility round the mode lies: down to a ``cut`` of the greatest density."""
    off = np.flatnonzero(weights < cut * weights.max())
    mode = int(weights.argmax())
    return slice(off[off < mode].max(initial=-1) + 1, off[off > mode].min(initial=len(FINE)))


def sight(truth: FloatArray, positions: FloatArray, rng: np.random.Generator) -> list[tuple[FloatArray, FloatArray]]:
    return [(position, SENSOR.measure(position, truth, rng)) for position in positions]


@given(seed=st.integers(0, 10_000), looks=st.integers(1, 40), level=st.booleans())
@settings(max_examples=25, deadline=None)
def test_agrees_with_all_ranges_at_once(seed: int, looks: int, level: bool) -> None:
    rng = np.random.default_rng(seed)
    truth = np.array([[0.0, 0.0, rng.uniform(0.2, 0.7)]])
    heights = 0.4 if level else rng.uniform(0.3, 0.55, looks)
    positions = np.column_stack([rng.uniform(-0.25, 0.25, (looks, 2)), np.full(looks, heights)])
    seen = sight(truth, positions, rng)
    state = taken(truth[:, :2], seen)
    weights = all_at_once(truth[0, :2], [(p, float(y[0])) for p, y in seen], SENSOR.relative_noise)
    # A possibility that is hardly joined to the other belongs to the estimate or not, by a hair.
    owns = [possibility(weights, cut) for cut in (0.5e-3, 1e-3, 2e-3)]
    means = [float(np.average(FINE[own], weights=weights[own])) for own in owns]
    about = weights * (FINE - state.depth_m[0]) ** 2
    variance, far = float(about.sum()), float(about.sum() - about[owns[1]].sum())
    # While a depth and its mirror image are both possible the grid holds both, in cells larger than the deviation.
    between_m = 0.25 * float(state.grids.spacing_m[0])
    if variance < 0.05**2:
        assert min(abs(state.depth_m[0] - mean) for mean in means) <= max(0.1 * np.sqrt(variance), between_m)
    # How much is left of a possibility that hardly is one depends on what lies between the cells, too.
    hardly = far if 1.0 - weights[owns[1]].sum() < 1e-3 else 0.0
    assert state.variance_m2[0] == pytest.approx(variance, abs=0.1 * variance + hardly + between_m**2)


@pytest.mark.parametrize("rise", [-0.15, 0.15])
def test_a_landmark_above_the_vehicle_is_found_there_once_looks_from_other_depths_tell(rise: float) -> None:
    rng = np.random.default_rng(3)
    n = 200
    truth = np.column_stack([np.linspace(0.0, 400.0, n), np.zeros(n), np.full(n, 0.5 - rise)])
    state, estimator = Landmarks.unknown(truth[:, :2]), LandmarkEstimator(SENSOR)
    for k in range(40):
        for m in range(n):
            position = np.array([truth[m, 0] + 0.2, 0.05, 0.5 + 0.03 * np.sin(k)])
            state = estimator.update(state, 0, position, np.array([m]), SENSOR.measure(position, truth[m : m + 1], rng))
    error = state.depth_m - truth[:, 2]
    assert 0.8 < np.mean(error**2 / state.variance_m2) < 1.3
    assert np.median(np.abs(error)) < 0.02


def test_ranges_from_one_depth_alone_do_not_make_a_landmark_done() -> None:
    rng = np.random.default_rng(5)
    truth = np.array([[0.0, 0.0, 0.35]])
    state = taken(truth[:, :2], sight(truth, np.tile([0.25, 0.0, 0.5], (100, 1)), rng))
    assert not state.accurate[0]
    assert np.sqrt(state.variance_m2[0]) > 0.05


def test_beams_that_look_down_know_that_the_landmark_is_below() -> None:
    rng = np.random.default_rng(6)
    truth, sonar = np.array([[0.02, 0.0, 0.7]]), Multibeam(0.02, 1.0)
    looks = [(np.array([0.0, 0.0, 0.5]), sonar.measure(np.array([0.0, 0.0, 0.5]), truth, rng)) for _ in range(10)]
    state = taken(truth[:, :2], looks, sonar)
    assert state.depth_m[0] == pytest.approx(0.7, abs=0.005)
    assert np.sqrt(state.variance_m2[0]) == pytest.approx(0.02 * 0.2 / np.sqrt(10), rel=0.1)


def test_neighbours_tell_which_of_two_depths_it_is() -> None:
    """One landmark ranged to from one depth alone, beside one that is known: below the vehicle, or above."""
    rng = np.random.default_rng(7)
    xy = np.array([[0.0, 0.0], [0.05, 0.0]])
    level = sight(np.array([[0.0, 0.0, 0.65]]), np.tile([0.2, 0.0, 0.5], (60, 1)), rng)
    alone = taken(xy[:1], level)
    for known in (0.65, 0.35):
        truth = np.array([[0.05, 0.0, known]])
        state, estimator = Landmarks.unknown(xy), LandmarkEstimator(SENSOR)
        for position in np.column_stack([rng.uniform(0.0, 0.1, (60, 2)), rng.uniform(0.1, 0.2, 60)]):
            state = estimator.update(state, 0, position, np.array([1]), SENSOR.measure(position, truth, rng))
        for position, ranges in level:
            state = estimator.update(state, 0, position, np.array([0]), ranges)
        assert state.variance_m2[0] < 0.5 * alone.variance_m2[0]
        assert abs(state.depth_m[0] - known) < 0.03


def test_what_is_found_out_beside_a_landmark_settles_it_without_another_look() -> None:
    rng = np.random.default_rng(8)
    truth = np.array([[0.0, 0.0, 0.65], [0.05, 0.0, 0.65]])
    state, estimator = Landmarks.unknown(truth[:, :2]), LandmarkEstimator(SENSOR)
    for position, ranges in sight(truth[:1], np.tile([0.2, 0.0, 0.5], (200, 1)), rng):
        state = estimator.update(state, 0, position, np.array([0]), ranges)
    before = state
    for position in np.column_stack([rng.uniform(0.0, 0.1, (200, 2)), rng.uniform(0.35, 0.45, 200)]):
        state = estimator.update(state, 1, position, np.array([1]), SENSOR.measure(position, truth[1:], rng))
    assert state.variance_m2[0] < 0.5 * before.variance_m2[0]
    assert state.looks[0] == before.looks[0]
    assert abs(state.depth_m[0] - 0.65) < 3.0 * np.sqrt(state.variance_m2[0])


def test_landmarks_that_tell_each_other_do_not_talk_themselves_into_certainty() -> None:
    """Many landmarks at nearly one place: each other's news may be worth as much as their own ranges, and no more."""
    rng = np.random.default_rng(9)
    n = 9
    truth = np.column_stack([rng.uniform(-1e-4, 1e-4, (n, 2)), np.full(n, 0.65)])
    state = taken(truth[:, :2], sight(truth, np.column_stack([np.zeros((4, 2)), np.full(4, 0.45)]), rng))
    own = 1.0 / state.grids.own_variance_m2
    for _ in range(30):  # nothing new is measured, but everybody asks everybody
        state = LandmarkEstimator(SENSOR).update(
            state, 0, np.array([0.0, 0.0, 0.4]), np.zeros(0, dtype=np.int64), np.zeros(0)
        )
        depth, variance = state.grids.estimates(np.arange(n), np.ones(n, dtype=np.bool_))
    assert (1.0 / variance <= 1.3 * own.sum()).all()
    np.testing.assert_allclose(1.0 / state.grids.own_variance_m2, own, rtol=0.1)
    assert np.isfinite(depth).all()


@given(seed=st.integers(0, 1000), n=st.integers(1, 8))
@settings(max_examples=30, deadline=None)
def test_neighbours_count_by_distance_and_deviation(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    depth, sd, apart = rng.uniform(0.2, 1.0, n), rng.uniform(0.001, 0.1, n), rng.uniform(0.01, 0.3, n)
    known = rng.random(n) < 0.7
    told, scale = from_neighbours(depth, sd**2, apart, known)
    if not known.any():
        assert np.isinf(scale)
        return
    ground, noise = np.diag((TYPICAL_STEP * apart[known]) ** 2), np.diag(sd[known] ** 2)
    weights = 1.0 / np.diag(ground + noise)
    weights /= weights.sum()
    assert told == pytest.approx(weights @ depth[known])
    assert scale == pytest.approx(np.sqrt(weights @ noise @ weights + np.trace(ground * weights)))


def test_landmarks_at_one_place_and_a_landmark_alone_have_neighbours_as_far_as_there_are() -> None:
    grids = Landmarks.unknown(np.zeros((4, 2))).grids
    for m in range(4):
        others = grids.neighbours[m][np.isfinite(grids.apart_m[m])]
        assert sorted(others) == [k for k in range(4) if k != m]
    assert np.isinf(Landmarks.unknown(np.zeros((1, 2))).grids.apart_m).all()


def round_about(rng: np.random.Generator, looks: int) -> FloatArray:
    return np.column_stack([rng.uniform(-0.2, 0.2, (looks, 2)), rng.uniform(0.2, 0.45, looks)])


@pytest.mark.parametrize(("noise", "deviations"), [(0.3, -3.3), (0.3, -2.7), (0.2, -4.2), (0.1, -10.0)])
def test_a_first_range_that_is_far_too_short_is_got_over(noise: float, deviations: float) -> None:
    """The depths laid out by it do not hold the truth; the last one is a range of nothing."""
    rng = np.random.default_rng(11)
    truth, sensor = np.array([[0.0, 0.0, 0.65]]), RangeSensor(0.9, noise)
    places = round_about(rng, 600)
    looks = [(place, sensor.measure(place, truth, rng)) for place in places]
    looks[0] = (places[0], np.linalg.norm(truth - places[0], axis=1) * (1.0 + deviations * noise))
    assert not taken(truth[:, :2], looks[:1], sensor).accurate[0]
    state = taken(truth[:, :2], looks, sensor)
    assert abs(state.depth_m[0] - 0.65) < 4.0 * np.sqrt(state.variance_m2[0])
    assert np.sqrt(state.variance_m2[0]) < 0.03


@pytest.mark.parametrize("noise", [1e-2, 1e-3, 1e-4, 1e-6])
def test_the_finer_the_ranges_the_finer_the_depths(noise: float) -> None:
    rng, errors, most = np.random.default_rng(12), [], 0.0
    for _ in range(60):
        truth, sensor = np.array([[0.0, 0.0, rng.uniform(0.55, 0.7)]]), RangeSensor(0.9, noise)
        looks = [(place, sensor.measure(place, truth, rng)) for place in round_about(rng, 10)]
        state = taken(truth[:, :2], looks, sensor)
        errors.append((state.depth_m[0] - truth[0, 2]) ** 2 / state.variance_m2[0])
        most = max(most, float(state.variance_m2[0]))
    assert 0.5 < np.mean(errors) < 1.7
    assert max(errors) < 16.0
    assert np.sqrt(most) < 3.0 * noise


@pytest.mark.parametrize("false", [0.0, 0.05, 2.0])
def test_a_single_false_echo_makes_nobody_sure_of_something_else(false: float) -> None:
    """The depths laid out again may be coarse beside what was known, which the deviation says."""
    rng = np.random.default_rng(13)
    truth = np.array([[0.0, 0.0, 0.65]])
    looks = [(place, SENSOR.measure(place, truth, rng)) for place in round_about(rng, 200)]
    echo = (np.array([0.05, 0.0, 0.3]), np.array([false]))
    for later in (0, 40):
        state = taken(truth[:, :2], [*looks, echo, *looks[:later]])
        assert abs(state.depth_m[0] - 0.65) < min(0.05, 4.0 * np.sqrt(state.variance_m2[0]))
