"""Deviations against what really happens."""

from dataclasses import replace

import numpy as np
import pytest

from app.mapping.compare import interval_coverage
from app.mapping.gaussian_process.calibration import (
    FINE_RELIEF,
    Calibration,
    HeldOutSoundings,
    across_gaps,
    checked_log_scale,
    error_ratio,
    misses,
    mixed,
)
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gaussian_process.roughness import local_ratio
from app.mapping.kriging.fields import Field
from app.mapping.kriging.levels import two_levels
from app.mapping.types import Grid, Soundings

COARSE = Grid(0.0, 0.0, 10.0, 4, 4)
ORDINARY = Field(COARSE, np.zeros((1, 4, 4)))
NEUTRAL = Calibration(Field(COARSE, np.zeros((2, 4, 4))), Field(COARSE, np.ones((1, 4, 4))), ORDINARY)


def held_out(true_factor: float, own_sd: float, n: int = 2000) -> HeldOutSoundings:
    """Predictions that are ``true_factor`` times as far off as they say."""
    rng = np.random.default_rng(0)
    sd = rng.uniform(0.5, 2.0, n)
    error = true_factor * sd * rng.standard_normal(n) + own_sd * rng.standard_normal(n)
    return HeldOutSoundings(rng.uniform(0, 40, (n, 2)), error, np.full(n, own_sd**2), sd**2)


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.7])
def test_the_factor_on_deviations_is_found(factor: float) -> None:
    neutral = checked_log_scale(held_out(1.0, 0.1), np.ones(2000))
    assert np.exp(checked_log_scale(held_out(factor, 0.1), np.ones(2000)) - neutral) == pytest.approx(factor, rel=0.08)


def test_soundings_too_noisy_to_tell_change_nothing() -> None:
    nothing = HeldOutSoundings(np.zeros((0, 2)), *np.zeros((3, 0)))
    assert checked_log_scale(held_out(3.0, 100.0, n=300), np.ones(300)) == pytest.approx(
        checked_log_scale(nothing, np.ones(0)), abs=0.01
    )


def test_each_place_has_the_factor_of_where_it_is() -> None:
    support = np.tile([1.0, 1.0, 0.0, 0.0], (1, 4, 1))
    near = np.tile([0.0, np.log(4.0), 0.0, np.log(4.0)], (1, 4, 1))
    calibration = Calibration(
        NEUTRAL.field, Field(COARSE, support), Field(COARSE, near), log_scale=np.log(2.0), log_scale_beyond=np.log(3.0)
    )
    deviation, even = calibration.deviations(COARSE, np.ones((4, 4)))
    np.testing.assert_allclose(deviation, np.tile([2.0, 4.0, 3.0, 6.0], (4, 1)))
    np.testing.assert_allclose(even, np.tile([2.0, 2.0, 3.0, 3.0], (4, 1)))
    np.testing.assert_allclose(calibration.variance_factor(np.array([[5.0, 5.0], [15.0, 5.0]])), [1.0, 4.0])


def test_noise_beyond_the_stated_one_is_partly_relief_that_every_cell_has() -> None:
    soundings_sd = np.concatenate([np.zeros((1, 4, 4)), np.full((1, 4, 4), 0.2)])
    told = replace(NEUTRAL, field=Field(COARSE, soundings_sd))
    nothing = np.zeros((4, 4))
    as_told, less, more = (replace(told, noise_scale=x).deviations(COARSE, nothing)[0] for x in (1.0, 0.5, 5.0))
    np.testing.assert_array_equal(as_told, less)
    np.testing.assert_allclose(more**2 - as_told**2, FINE_RELIEF * 4.0 * 0.2**2)


def test_misses_tell_where_predictions_are_farther_off_than_they_say() -> None:
    found = held_out(1.0, 0.01)
    twice = np.where(found.points_m[:, 0] < 20.0, 2.0, 1.0)
    errors = misses(replace(found, error_m=found.error_m * twice), np.ones(2000))
    near, far = local_ratio(errors, np.array([[10.0, 20.0], [30.0, 20.0]]), 10.0)
    assert near / far > 2.0
    counted_out = local_ratio(errors, np.array([[10.0, 20.0]]), 10.0, apart_m=100.0)
    assert counted_out == pytest.approx(1.0)


def test_wider_holes_leave_out_more_up_to_the_widest_allowed() -> None:
    east, north = np.meshgrid(np.arange(0.0, 60.0, 6.0), np.arange(60.0))
    lines = Soundings(east.ravel(), north.ravel(), np.zeros(east.size), np.full(east.size, 0.1))
    levels = two_levels(lines, 1.0, 3.0)
    rows = np.arange(0, levels.n_fine, 5)

    def hole_m(widened_to_m: float) -> np.ndarray:
        near = across_gaps(levels, rows, (32, 24), widened_to_m)
        away = np.linalg.norm(levels.points[near] - levels.points[rows][:, None], axis=-1)
        return np.where(near >= 0, away, np.inf).min(axis=1)

    assert hole_m(0.0).max() < 4.5
    assert hole_m(100.0).max() > 6.0
    np.testing.assert_array_equal(hole_m(0.5), np.maximum(hole_m(0.0), hole_m(0.5)))


def test_mixing_lies_between_and_counts_disagreement() -> None:
    a, b = held_out(1.0, 0.1), held_out(2.0, 0.1)
    half = mixed(a, b, 0.5)
    np.testing.assert_allclose(half.error_m, 0.5 * (a.error_m + b.error_m))
    assert np.all(half.map_variance >= a.map_variance)
    assert error_ratio(a, b) < 0.6 < 1.0 < error_ratio(b, a)


def test_intervals_hold_what_they_promise_on_ground_of_two_kinds() -> None:
    rng = np.random.default_rng(3)
    east, north = rng.uniform(0, 60, (2, 600))

    def floor(e: np.ndarray, n: np.ndarray) -> np.ndarray:
        rough = 1.0 / (1.0 + np.exp(-(e - 35.0) / 3.0))
        return 12.0 + 0.03 * n + 0.8 * rough * np.sin(e / 2.0) * np.cos(n / 2.5)

    sd = np.full(600, 0.05)
    s = Soundings(east, north, floor(east, north) + sd * rng.standard_normal(600), sd)
    grid = Grid(0.0, 0.0, 1.0, 60, 60)
    truth = floor(*grid.centres_m.T).reshape(60, 60)
    result = GaussianProcessMap().fit(s).predict(grid)
    assert 0.60 < interval_coverage(result.depth_m, result.sd_m, truth, 0.68) < 0.80
    assert 0.90 < interval_coverage(result.depth_m, result.sd_m, truth, 0.95) < 0.99
