"""What was known before and what is measured now, weighted by how well each is known."""

import numpy as np
import pytest

from app.mapping.gaussian_process.fusion import fuse, prior_map
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.types import BathymetricMap, Grid, Soundings

GRID = Grid(0.0, 0.0, 2.0, 25, 25)
MASK = np.ones((25, 25), bool)


def floor(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
    return 10.0 + np.sin(east_m / 8.0) + 0.05 * north_m


def old_map(bias_m: float, sd_m: float) -> Soundings:
    """A smooth grid, all of it wrong by the same amount."""
    east, north = GRID.centres_m[::3].T
    return Soundings(east, north, floor(east, north) + bias_m, np.full(len(east), sd_m))


def measured_map(rng: np.random.Generator, n: int = 60) -> BathymetricMap:
    """Soundings of the western half; the model is the one of missions."""
    east, north = rng.uniform(0, 25, n), rng.uniform(0, 50, n)
    depth = floor(east, north) + 0.05 * rng.standard_normal(n)
    return GaussianProcessMap("matern32").fit(Soundings(east, north, depth, np.full(n, 0.05))).predict(GRID, MASK)


def test_many_old_depths_are_not_better_known_than_one() -> None:
    known = prior_map(old_map(0.0, 0.4), GRID, MASK)
    assert known.sd_m.min() >= 0.4
    assert np.median(known.sd_m) == pytest.approx(0.4, abs=0.05)
    assert not known.sounded.any()
    assert known.prior is not None
    assert known.prior.mean() == pytest.approx(1 / 3, abs=0.01)


def test_measured_depths_win_where_there_are_some_and_old_ones_elsewhere() -> None:
    measured = measured_map(np.random.default_rng(3))
    both = fuse(measured, prior_map(old_map(0.8, 0.4), GRID, MASK))
    error = both.depth_m - floor(*np.meshgrid(GRID.east_m, GRID.north_m))
    assert np.sqrt(np.mean(error[:, :11] ** 2)) < 0.15
    np.testing.assert_allclose(error[:, -3:], 0.8, atol=0.35)
    assert both.sd_m[:, :11].mean() < 0.15
    np.testing.assert_allclose(both.sd_m[:, -2:], 0.4, atol=0.06)


@pytest.mark.parametrize("sd_m", [0.05, 0.5, 5.0])
def test_together_is_never_less_certain_than_the_better_of_both(sd_m: float) -> None:
    measured, known = measured_map(np.random.default_rng(4)), prior_map(old_map(0.0, sd_m), GRID, MASK)
    both = fuse(measured, known)
    near = measured.sounded
    assert np.all(both.sd_m <= known.sd_m + 1e-12)
    assert np.all(both.sd_m[near] <= measured.sd_m[near] + 1e-12)
    low, high = np.minimum(measured.depth_m, known.depth_m), np.maximum(measured.depth_m, known.depth_m)
    assert np.all((both.depth_m >= low - 1e-9) & (both.depth_m <= high + 1e-9))
    np.testing.assert_array_equal(both.count, measured.count)
