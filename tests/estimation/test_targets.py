from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from app.estimation import RangeSensor, TargetEstimator, TargetTrack
from app.estimation.range_filter import update_by_range
from app.estimation.targets import foretold_sd, transition

HEARING = RangeSensor(np.inf, 0.1)


def pursuit(seed: int, steps: int, estimator: Any, vehicles: int = 3, *, found: bool = False) -> Iterator[Any]:
    """Vehicles circle a target that keeps its course but for the model's noise; yields truth, track and places.

    ``found``: the filter knows to begin with where the target is, as well as it says.
    """
    rng = np.random.default_rng(seed)
    truth = np.concatenate([rng.uniform(-0.5, 0.5, 3), estimator.speed_sd * rng.standard_normal(3)])
    track = TargetTrack.unknown()
    if found:
        P = np.diag([0.05**2] * 3 + [0.01**2] * 3)
        track = TargetTrack(rng.multivariate_normal(truth, P)[None], P[None], np.ones(1))
    phase, turning = rng.uniform(0.0, 2.0 * np.pi, vehicles), rng.uniform(0.05, 0.12, vehicles)
    for step in range(steps):
        pull = rng.multivariate_normal(np.zeros(6), estimator.process_noise())
        truth = transition() @ truth + pull
        angle = phase + turning * step
        around = np.column_stack([np.cos(angle), np.sin(angle), 0.8 * np.sin(2.1 * angle + phase)])
        positions = truth[:3] + 0.5 * around
        ranges = np.array([HEARING.measure(p, truth[None, :3], rng)[0] for p in positions])
        track = estimator.update(estimator.predict(track), positions, ranges)
        yield truth, track, positions


@pytest.mark.parametrize("pieces", [60, 24, 600])
def test_what_is_foretold_for_a_time_is_as_sure_in_however_many_pieces(pieces: int) -> None:
    estimator = TargetEstimator(acceleration_sd=0.013, vertical=0.3)
    track = TargetTrack(np.zeros((1, 6)), 0.01 * np.eye(6)[None], np.ones(1))
    at_once, step_by_step = estimator.predict(track, 60.0), track
    for _ in range(pieces):
        step_by_step = estimator.predict(step_by_step, 60.0 / pieces)
    np.testing.assert_allclose(step_by_step.sd_m, at_once.sd_m, rtol=1e-3)


def test_a_single_range_update_is_that_of_a_slow_reference() -> None:
    """Joseph form in plain numpy, mean and variance of the range by brute force over the prior."""
    rng = np.random.default_rng(4)
    for _ in range(5):
        A = rng.standard_normal((6, 6))
        P, mean = 1e-3 * (A @ A.T + np.eye(6)), rng.uniform(-1, 1, 6)
        position, blur, y = rng.uniform(-1, 1, 3), np.array([1e-4, 2e-4, 0.0]), 0.9
        cloud = rng.multivariate_normal(mean[:3], P[:3, :3], 400_000) - position
        r = np.linalg.norm(cloud + rng.standard_normal(cloud.shape) * np.sqrt(blur), axis=1)
        seen = r * (1.0 + 0.1 * rng.standard_normal(len(r)))
        after, Q = mean.copy(), P.copy()
        innovation, variance = update_by_range(after, Q, position, y, 0.1, blur)
        assert y - innovation == pytest.approx(seen.mean(), rel=0.01)
        assert variance == pytest.approx(seen.var(), rel=0.05)
        u = (mean[:3] - position) / np.linalg.norm(mean[:3] - position)
        H = np.concatenate([u, np.zeros(3)])[None]
        K = P @ H.T / variance
        R = variance - H @ P @ H.T
        expected = (np.eye(6) - K @ H) @ P @ (np.eye(6) - K @ H).T + K @ R @ K.T
        np.testing.assert_allclose(Q, expected, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(after, mean + (K * innovation).ravel(), rtol=1e-9)


def test_errors_are_as_large_as_the_filter_says() -> None:
    """NEES and NIS over 100 runs within their 95 % bounds."""
    estimator, runs = TargetEstimator(), 100
    nees, surprise = [], []
    for seed in range(runs):
        *_, (truth, track, _) = pursuit(seed, 40, estimator, found=True)
        error = truth - track.state
        nees.append(error @ np.linalg.solve(track.covariance, error))
        surprise.append(3.0 * track.surprise)
    for values, dimensions in ((nees, 6), (surprise, 3)):
        low, high = chi2.ppf(np.array([0.025, 0.975]), dimensions * runs) / runs
        assert low < np.mean(values) < high


def test_a_target_is_found_from_nothing() -> None:
    """A mirror image may be taken for the target now and then, but seldom for long."""
    right = 0
    for seed in range(40):
        *_, (truth, track, _) = pursuit(seed, 60, TargetEstimator())
        right += np.linalg.norm(truth[:3] - track.state[:3]) < 4.0 * np.linalg.norm(track.sd_m)
    assert right >= 38


@pytest.mark.parametrize(
    ("noise", "vehicles"),
    [(0.01, 1), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.02, 1), (0.01, 2), (0.1, 1)))],
)
def test_fine_ranges_do_not_make_a_filter_sure_of_a_wrong_place(noise: float, vehicles: int) -> None:
    """From nothing, also by ranges of one vehicle: a filter takes the bend of their spheres for nothing else."""
    nees = []
    for seed in range(24):
        rng = np.random.default_rng([7, seed])
        estimator, track = TargetEstimator(RangeSensor(np.inf, noise)), TargetTrack.unknown()
        course = rng.standard_normal(3)
        truth = np.array([*rng.uniform(-0.6, 0.6, 3), *(course / np.linalg.norm(course) * 0.00075)])
        phase = rng.uniform(0.0, 2.0 * np.pi, vehicles)
        for step in range(1, 101):
            truth = transition() @ truth
            angle = phase + 0.1 * step
            places = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.4 * np.sin(0.7 * angle + phase)])
            ranges = np.linalg.norm(places - truth[:3], axis=1) * (1.0 + noise * rng.standard_normal(vehicles))
            track = estimator.update(estimator.predict(track), places, ranges)
        error = truth - track.state
        nees.append(error @ np.linalg.solve(track.covariance, error))
    assert np.mean(nees) < 8.0
    assert (np.array(nees) > chi2.ppf(0.999, 6)).sum() <= 1


def test_it_counts_as_accurate_only_while_it_is_heard() -> None:
    estimator = TargetEstimator()
    *_, (_, track, _) = pursuit(0, 60, estimator)
    assert estimator.accurate(track)
    silent = np.full(3, np.nan)
    lost = next(
        step for step in range(1, 200)
        if not estimator.accurate(track := estimator.update(estimator.predict(track), np.zeros((3, 3)), silent))
    )  # fmt: skip
    assert 3 < lost < 60


def test_a_turn_is_noticed() -> None:
    """After a target went about, the filter must not go on straight for long."""
    estimator, rng = TargetEstimator(), np.random.default_rng(3)
    track, truth = TargetTrack.unknown(), np.array([-0.5, 0.0, 0.0, 0.02, 0.0, 0.0])
    vehicles = np.array([[0.4, 0.3, 0.3], [-0.4, -0.4, 0.2], [0.0, 0.5, -0.5], [0.2, -0.4, -0.3]])
    errors = []
    for step in range(100):
        if step == 50:
            truth[3] *= -1.0
        truth[:3] += truth[3:]
        ranges = np.array([HEARING.measure(p, truth[None, :3], rng)[0] for p in vehicles])
        track = estimator.update(estimator.predict(track), vehicles, ranges)
        errors.append(np.linalg.norm(track.state[:3] - truth[:3]))
    assert max(errors[75:]) < 0.15


def test_what_is_foretold_is_what_the_filter_then_says() -> None:
    estimator = TargetEstimator()
    *_, (_, track, positions) = pursuit(1, 60, estimator)
    ahead = estimator.predict(track)
    configurations = np.stack([positions, positions + 0.05])
    told = foretold_sd(ahead.state, ahead.covariance, configurations, 0.1, np.inf, 0.0)
    ranges = np.linalg.norm(ahead.state[:3] - positions, axis=1)
    assert told[0] == pytest.approx(estimator.update(ahead, positions, ranges).sd_m.max(), rel=0.02)


@given(
    st.lists(st.floats(-2, 2), min_size=3, max_size=3), st.floats(1e-6, 3.0), st.floats(1e-3, 0.5), st.integers(0, 99)
)
@settings(max_examples=60, deadline=None)
def test_a_covariance_stays_symmetric_and_positive(place: Any, y: Any, noise: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((6, 6)) * 10.0 ** rng.uniform(-6, 0, 6)
    mean, P = rng.uniform(-1, 1, 6), A @ A.T + 1e-14 * np.eye(6)
    for _ in range(20):
        update_by_range(mean, P, np.array(place), y, noise, np.zeros(3))
        assert np.isfinite(mean).all()
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P).min() > -1e-12 * np.abs(P).max()


def reference(
    low: Any, high: Any, places: np.ndarray, ranges: list[float], sd: Any, count: int = 2_000_000
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviations (3,) of a still target: evenly drawn places, weighed by every range."""
    cloud = np.random.default_rng(0).uniform(low, high, (count, 3))
    score = np.zeros(count)
    for place, measured in zip(places, ranges, strict=True):
        away = np.linalg.norm(cloud - place, axis=1)
        score -= 0.5 * ((measured - away) / sd(away)) ** 2 + np.log(sd(away))
    share = np.exp(score - score.max())
    share /= share.sum()
    mean = share @ cloud
    return mean, np.sqrt(share @ (cloud - mean) ** 2)


def close_by(low: Any = (-500, -500, 0), high: Any = (1500, 1500, 30)) -> TargetEstimator:
    """A filter in a sea of 2 km, for ranges of 1 %."""
    return TargetEstimator(RangeSensor(np.inf, 0.01), 0.0, 5.0, low, high, 0.01, 0.3)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [3.0, 8.0, 20.0])
def test_ranges_from_close_by_tell_as_much_as_they_can(depth: float) -> None:
    """Beside them the water is wide: the filter says what evenly drawn places say that are weighed by them."""
    estimator, track = close_by(), TargetTrack.unknown()
    rng, target = np.random.default_rng(3), np.array([510.0, 503.0, depth])
    places = np.array([[500.0 + 2.0 * k, 500.0 + (k % 3), 2.0] for k in range(4)])
    near = (np.array([470.0, 470.0, 0.0]), np.array([550.0, 540.0, 30.0]))
    heard: list[float] = []
    for k, place in enumerate(places):
        away = float(np.linalg.norm(target - place))
        heard.append(away * (1.0 + 0.01 * rng.standard_normal()) + 0.5 * rng.standard_normal())
        track = estimator.update(track, place[None], np.array(heard[-1:]), np.full((1, 3), 0.25))
        mean, sd = reference(*near, places[: k + 1], heard, lambda r: np.hypot(0.01 * r, 0.5))
        assert np.linalg.norm(track.state[:3] - mean) < 0.5 * np.linalg.norm(sd)
        assert 0.8 < np.linalg.norm(track.sd_m) / np.linalg.norm(sd) < 1.4


def test_who_is_passed_close_by_is_known_better_and_not_forgotten() -> None:
    """East and north are known, depth is not: a range of about that size tells of it."""
    mean, P = np.array([500.0, 500.0, 15.0, 0, 0, 0]), np.diag([1.0, 1.0, 64.0, 1e-6, 1e-6, 1e-6])
    track, place, measured = TargetTrack(mean[None], P[None], np.ones(1)), np.array([504.0, 500.0, 4.0]), 5.0
    after = close_by().update(track, place[None], np.array([measured]), np.full((1, 3), 0.25))
    cloud = np.random.default_rng(1).multivariate_normal(mean[:3], P[:3, :3], 2_000_000)
    cloud = cloud[(cloud[:, 2] > 0.0) & (cloud[:, 2] < 30.0)]
    away = np.linalg.norm(cloud - place, axis=1)
    sd = np.hypot(0.01 * away, 0.5)
    share = np.exp(-0.5 * ((measured - away) / sd) ** 2) / sd
    share /= share.sum()
    expected = share @ cloud
    np.testing.assert_allclose(after.state[:3], expected, atol=0.5)
    np.testing.assert_allclose(after.sd_m, np.sqrt(share @ (cloud - expected) ** 2), rtol=0.2)


@given(
    st.tuples(st.floats(-400, 400), st.floats(-400, 400), st.floats(-2, 60)), st.floats(1e-3, 900.0), st.integers(0, 9)
)
@settings(max_examples=40, deadline=None)
def test_no_range_makes_a_filter_that_is_none(place: Any, measured: float, seed: int) -> None:
    """Wherever it is heard from, however far: the next one, too."""
    estimator, track, rng = close_by(), TargetTrack.unknown(), np.random.default_rng(seed)
    for _ in range(4):
        track = estimator.update(track, np.array([place]), np.array([measured]), np.full((1, 3), 0.25))
        assert np.isfinite(track.state).all()
        assert track.weights.sum() == pytest.approx(1.0)
        for P in track.covariances:
            assert np.linalg.eigvalsh(P).min() > -1e-9 * np.abs(P).max()
        place, measured = tuple(np.array(place) + rng.normal(0, 30, 3)), float(rng.uniform(1e-3, 900.0))
        track = estimator.predict(track, 5.0)


def test_a_range_of_nothing_leaves_a_filter_that_goes_on() -> None:
    estimator, place, blur = close_by(), np.array([[0.0, 0.0, 5.0]]), np.full((1, 3), 0.25)
    track = estimator.update(TargetTrack.unknown(), place, np.zeros(1), blur)
    track = estimator.update(track, place, np.ones(1), blur)
    assert np.isfinite(track.state).all()
    assert np.isfinite(track.sd_m).all()
