from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from app.arrays import FloatArray
from app.estimation import Landmark3DEstimator, Landmarks3D, RangeSensor

SENSOR = RangeSensor(visibility_m=0.4, relative_noise=0.1)


def patrol(seed: int, steps: int, n: int, vehicles: int = 3) -> Iterator[Any]:
    """Three vehicles wander over landmarks; yields truth and knowledge after every step."""
    rng = np.random.default_rng(seed)
    truth = np.column_stack([rng.uniform(-0.3, 0.3, (n, 2)), rng.uniform(0.5, 0.7, n)])
    positions = np.column_stack([rng.uniform(-0.3, 0.3, (vehicles, 2)), np.full(vehicles, 0.3)])
    known, estimator = Landmarks3D.unknown(n), Landmark3DEstimator(SENSOR)
    for _ in range(steps):
        move = rng.standard_normal((vehicles, 3))
        positions = positions + 0.05 * move / np.linalg.norm(move, axis=1, keepdims=True)
        positions = np.clip(positions, [-0.35, -0.35, 0.15], [0.35, 0.35, 0.42])
        visible_by = SENSOR.visible(positions, truth)
        for j, position in enumerate(positions):
            index = np.flatnonzero(visible_by[j])
            known = estimator.update(known, j, position, index, SENSOR.measure(position, truth[index], rng))
        yield truth, known


def nees(truth: FloatArray, known: Landmarks3D) -> FloatArray:
    seen = known.looks > 0
    error = known.position_m[seen] - truth[seen]
    return np.einsum("ki,kij,kj->k", error, np.linalg.inv(known.covariance_m2[seen]), error)


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_says() -> None:
    """Normalised estimation error squared: chi-square with 3 degrees per landmark, independent between landmarks."""
    runs = [[nees(t, k) for t, k in patrol(seed, 25, 4)] for seed in range(50)]
    for step in (3, 6, 12, 24):
        errors = np.concatenate([run[step] for run in runs])
        low, high = chi2.ppf(np.array([0.001, 0.999]), 3 * len(errors)) / len(errors)
        assert low < errors.mean() < high
        assert (errors < chi2.ppf(0.95, 3)).mean() > 0.91


def test_estimates_close_in_on_the_truth() -> None:
    *_, (truth, known) = patrol(1, 120, 40)
    fixed = known.fixed
    assert fixed.mean() > 0.8
    assert np.sqrt(np.mean((known.position_m[fixed] - truth[fixed]) ** 2)) < 0.04
    assert known.accurate.any()


def test_matches_a_batch_solution_of_all_ranges() -> None:
    """Gauss-Newton over every range at once, from the truth, is the slow but exact reference."""
    rng = np.random.default_rng(3)
    truth = np.array([[0.05, -0.1, 0.6], [-0.1, 0.08, 0.55]])
    positions = np.column_stack([rng.uniform(-0.25, 0.25, (150, 2)), rng.uniform(0.2, 0.4, 150)])
    known, estimator, ranges = Landmarks3D.unknown(2), Landmark3DEstimator(SENSOR), []
    for position in positions:
        ranges.append(SENSOR.measure(position, truth, rng))
        known = estimator.update(known, 0, position, np.array([0, 1]), ranges[-1])
    for m, point in enumerate(truth):
        true_ranges = np.linalg.norm(positions - point, axis=1)

        def residual(x: FloatArray, m: Any = m, true_ranges: Any = true_ranges) -> Any:
            return (np.array(ranges)[:, m] - np.linalg.norm(positions - x, axis=1)) / (0.1 * true_ranges)

        batch = least_squares(residual, point)
        jac = np.asarray(batch.jac)
        covariance = np.linalg.inv(jac.T @ jac)
        apart = known.position_m[m] - batch.x
        assert apart @ np.linalg.solve(covariance, apart) < 1.0
        np.testing.assert_allclose(np.sqrt(np.diag(known.covariance_m2[m])), np.sqrt(np.diag(covariance)), rtol=0.15)


@given(seed=st.integers(0, 500))
@settings(max_examples=10, deadline=None)
def test_what_is_known_accurately_stays_so_and_single_filters_only_narrow(seed: int) -> None:
    last = None
    for _, known in patrol(seed, 25, 10):
        seen = known.looks > 0
        assert np.isfinite(known.position_m[seen]).all()
        assert (np.linalg.eigvalsh(known.covariance_m2[seen]) > 0.0).all()
        if last is not None:
            assert (known.accurate | ~last.accurate).all()
            assert (known.fixed | ~last.fixed).all()
            narrower = last.covariance_m2[last.fixed] - known.covariance_m2[last.fixed]
            assert (np.linalg.eigvalsh(narrower) > -1e-12).all()
        last = known


@pytest.mark.parametrize("depths", [(0.2, 0.45), (0.75, 1.0), (0.45, 0.75)], ids=["above", "below", "beside"])
def test_errors_are_as_large_as_the_filter_says_wherever_it_was_looked_from(depths: tuple[float, float]) -> None:
    """Landmarks about a depth of 0.6: from below, the first look must not presume that they lie deeper."""
    errors, wrong = [], 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = np.column_stack([rng.uniform(-0.1, 0.1, (30, 2)), rng.uniform(0.58, 0.62, 30)])
        known, estimator = Landmarks3D.unknown(30), Landmark3DEstimator(SENSOR, 0.1)
        for _ in range(50):
            position = np.array([*rng.uniform(-0.25, 0.25, 2), rng.uniform(*depths)])
            known = estimator.update(known, 0, position, np.arange(30), SENSOR.measure(position, truth, rng))
        errors.append(nees(truth, known))
        wrong += int((known.accurate & (np.linalg.norm(known.position_m - truth, axis=1) > 0.3)).sum())
    flat = np.concatenate(errors)
    assert 0.8 * 3.0 < flat.mean() < 1.25 * 3.0
    assert (flat < chi2.ppf(0.99, 3)).mean() > 0.96
    assert wrong == 0


def once(depth: float = 0.0, floor: float = np.nan, **box: Any) -> Landmarks3D:
    """What is known after one range of 0.3."""
    place, index = np.array([0.0, 0.0, depth]), np.array([0])
    estimator = Landmark3DEstimator(SENSOR, **box)
    return estimator.update(Landmarks3D.unknown(1), 0, place, index, np.array([0.3]), floor_m=floor)


def test_a_single_range_leaves_the_direction_open() -> None:
    known = once()
    assert not known.fixed[0]
    np.testing.assert_allclose(known.position_m[0], 0.0, atol=0.01)
    np.testing.assert_allclose(known.sd_m[0], 0.3 / np.sqrt(3.0), rtol=0.1)


def test_a_first_look_finds_landmarks_where_they_may_be() -> None:
    low, high = (-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)
    np.testing.assert_allclose(once(0.0, low_m=low, high_m=high).position_m[0], [0.0, 0.0, 0.15], atol=0.02)
    np.testing.assert_allclose(once(1.0, low_m=low, high_m=high).position_m[0], [0.0, 0.0, 0.85], atol=0.02)
    assert np.isfinite(once(5.0, low_m=low, high_m=high).position_m).all()
    over, under = once(0.5, 0.7), once(0.5, 0.3)  # the floor 0.2 below the vehicle; above, to see that it is asked
    assert 0.6 < over.position_m[0, 2] < 0.72
    assert under.position_m[0, 2] == pytest.approx(1.0 - over.position_m[0, 2], abs=0.01)


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-4])
@pytest.mark.parametrize("size", [1.0, 1000.0])
def test_ranges_without_noise_make_a_filter_too(noise: float, size: float) -> None:
    rng, sensor = np.random.default_rng(2), RangeSensor(np.inf, noise)
    truth = size * np.array([[0.05, 0.02, 0.6]])
    known, estimator = Landmarks3D.unknown(1), Landmark3DEstimator(sensor)
    for _ in range(60):
        position = size * np.array([*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.2, 0.45)])
        known = estimator.update(known, 0, position, np.array([0]), sensor.measure(position, truth, rng))
    assert (np.linalg.eigvalsh(known.covariance_m2[0]) > 0.0).all()
    assert (known.sd_m < 1e-3 * size).all()
    np.testing.assert_allclose(known.position_m, truth, atol=1e-3 * size)


def test_looks_along_a_line_cannot_tell_its_sides_apart() -> None:
    """A straight leg leaves two mirror images: the estimate must not settle on one of them."""
    rng = np.random.default_rng(0)
    truth = np.array([[0.0, 0.15, 0.5]])
    known, estimator = Landmarks3D.unknown(1), Landmark3DEstimator(SENSOR)
    for x in np.linspace(-0.25, 0.25, 60):
        position = np.array([x, 0.0, 0.3])
        known = estimator.update(known, 0, position, np.array([0]), SENSOR.measure(position, truth, rng))
    assert not known.fixed[0]
    assert known.sd_m[0, 1] > 0.1


def test_looked_at_too_often_counts_as_done_and_is_credited() -> None:
    estimator = Landmark3DEstimator(SENSOR, visit_cap=3)
    known = Landmarks3D.unknown(2)
    for _ in range(4):
        assert not known.accurate.any()
        known = estimator.update(known, 2, np.zeros(3), np.array([1]), np.array([0.3]))
    assert known.accurate.tolist() == [False, True]
    assert known.credited.tolist() == [-1, 2]


def test_the_order_of_landmarks_does_not_matter() -> None:
    rng = np.random.default_rng(5)
    ranges = rng.uniform(0.2, 0.4, 6)
    index, shuffled = np.arange(6), rng.permutation(6)
    estimator = Landmark3DEstimator(SENSOR)
    straight = estimator.update(Landmarks3D.unknown(6), 0, np.zeros(3), index, ranges)
    mixed = estimator.update(Landmarks3D.unknown(6), 0, np.zeros(3), shuffled, ranges[shuffled])
    np.testing.assert_array_equal(straight.position_m, mixed.position_m)
    np.testing.assert_allclose(straight.position_m, 0.0, atol=0.01)
    np.testing.assert_allclose(straight.sd_m[:, 2], ranges / np.sqrt(3.0), rtol=0.1)


def dive(seed: int, sd: float, looks: int, *, grows: bool = False) -> tuple[FloatArray, Landmarks3D, Any]:
    """A vehicle that is wrong about its place all along a dive, by its deviation; 30 landmarks about (0, 0, 0.6)."""
    rng = np.random.default_rng(seed)
    truth = np.column_stack([rng.uniform(-0.1, 0.1, (30, 2)), rng.uniform(0.55, 0.65, 30)])
    known, estimator = Landmarks3D.unknown(30), Landmark3DEstimator(SENSOR)

    def look(off: FloatArray, sd: float, known: Landmarks3D, vehicle: int = 0) -> Landmarks3D:
        position = np.array([*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.2, 0.45)])
        ranges = SENSOR.measure(position - np.append(off, 0.0), truth, rng)
        return estimator.update(known, vehicle, position, np.arange(30), ranges, sd)

    off = np.zeros(2) if grows else sd * rng.standard_normal(2)
    for k in range(looks):
        now = sd
        if grows:
            off = off + sd / np.sqrt(looks) * rng.standard_normal(2)
            now = sd * np.sqrt((k + 1) / looks)
        known = look(off, float(now), known)
    return truth, known, look


@pytest.mark.parametrize("grows", [False, True])
def test_the_error_of_a_dive_does_not_average_out_nor_vanish_with_a_fix(grows: bool) -> None:
    """It is the same for all landmarks of a dive: only dives are independent."""
    under, fixed, later = [], [], []
    for seed in range(40):
        truth, known, look = dive(seed, 0.03, 60, grows=grows)
        under.append(nees(truth, known).mean())
        known = look(np.zeros(2), 0.0, known)
        fixed.append(nees(truth, known).mean())
        for _ in range(60):
            known = look(np.zeros(2), 0.0, known)
        later.append(nees(truth, known).mean())
        assert (np.linalg.eigvalsh(known.covariance_m2) > 0.0).all()
    for values in (under, fixed, later):
        assert 0.6 * 3.0 < np.mean(values) < 1.4 * 3.0


def test_nothing_enters_a_that_is_known_no_better_than_the_vehicles_place() -> None:
    _, known, look = dive(1, 0.03, 150)
    assert not known.accurate.any()
    assert (known.sd_m[:, :2] > 0.029).all()
    known = look(np.zeros(2), 0.0, known)
    assert not known.accurate.any()
    for _ in range(150):
        known = look(np.zeros(2), 0.0, known)
    assert known.accurate.mean() > 0.9


def test_looks_after_a_fix_count_in_full() -> None:
    """A dive says little of a landmark, what comes after it says all that it would have said alone."""
    ratios = []
    for seed in range(4):
        _, known, look = dive(seed, 0.3, 20)
        alone = Landmarks3D.unknown(30)
        for _ in range(100):
            known, alone = look(np.zeros(2), 0.0, known), look(np.zeros(2), 0.0, alone)
        ratios.append(known.sd_m / alone.sd_m)
    assert 0.8 < np.mean(ratios) < 1.1


def test_vehicles_that_share_their_error_do_not_average_it_out_between_them() -> None:
    errors = []
    for seed in range(40):
        truth, known, look = dive(seed, 0.03, 1)
        off = 0.03 * np.random.default_rng([seed, 1]).standard_normal(2)
        known = Landmarks3D.unknown(30)
        for k in range(60):
            known = look(off, 0.03, known, k % 3)
        errors.append(nees(truth, known).mean())
    assert 0.6 * 3.0 < np.mean(errors) < 1.4 * 3.0


def test_no_more_is_shared_with_a_vehicles_error_than_there_can_be() -> None:
    """What vehicles have in common is taken to be as much as it can be, which may be more than there is.

    Missions of NGCUV12 had variances below 0, and estimates far outside of the area.
    """
    _, known, look = dive(1, 0.1, 12)
    known = replace(known, shared_m2=3.0 * known.shared_m2)
    for _ in range(20):
        known = look(np.zeros(2), 0.1, known)
        assert (np.linalg.eigvalsh(known.covariance_m2) > 0.0).all()
        assert (np.linalg.norm(known.position_m - [0.0, 0.0, 0.6], axis=1) < 1.0).all()
        for shared, covariance in zip(known.shared_m2[:, 0], known.covariance_m2, strict=True):
            assert np.linalg.eigvalsh(covariance - shared @ shared.T / 0.1**2).min() > -1e-9
