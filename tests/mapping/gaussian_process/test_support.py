"""Between soundings what was learned from them holds; beyond them it is not presumed."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gaussian_process.support import support
from app.mapping.kriging.levels import TwoLevels, two_levels
from app.mapping.types import Grid, Soundings

LINES_APART_M = 8.0


def lines(north_end_m: float = 60.0) -> Soundings:
    """Lines northwards, a sounding every metre, over smooth hills."""
    east, north = (a.ravel() for a in np.meshgrid(np.arange(2.0, 100.0, LINES_APART_M), np.arange(0.0, north_end_m)))
    sd = np.full(len(east), 0.02)
    return Soundings(east, north, hills(east, north) + sd * np.random.default_rng(0).standard_normal(len(east)), sd)


def hills(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(12.0 + 2.0 * np.sin(east / 14.0) + 1.5 * np.cos(north / 17.0))


def levels(s: Soundings) -> TwoLevels:
    return two_levels(s, 1.0, 3.0)


def test_places_between_lines_are_surrounded_and_places_far_off_are_not() -> None:
    field = support(levels(lines()), 2.0, 30.0)
    between = np.array([[22.0, 30.0], [46.0, 31.5], [54.2, 12.0]])
    beyond = np.array([[50.0, 85.0], [-20.0, 30.0], [125.0, -20.0]])
    assert field.at(between)[0] == pytest.approx(1.0)
    assert field.at(beyond)[0] == pytest.approx(0.0)


def test_support_falls_with_the_distance_to_the_last_sounding() -> None:
    field = support(levels(lines()), 1.0, 30.0)
    north = np.arange(59.0, 90.0, 2.0)
    weight = field.at(np.column_stack([np.full(len(north), 50.0), north]))[0]
    assert np.all(np.diff(weight) <= 1e-9)
    assert weight[0] > 0.5


def test_a_hole_much_wider_than_the_other_gaps_is_not_surrounded() -> None:
    s = lines(100.0)
    hole = np.hypot(s.east_m - 50.0, s.north_m - 50.0) < 25.0
    field = support(levels(s.take(~hole)), 2.0, 10.0)
    assert field.at(np.array([[50.0, 50.0]]))[0] == pytest.approx(0.0)
    assert field.at(np.array([[14.0, 14.0]]))[0] == pytest.approx(1.0)


def test_beside_a_single_track_nothing_is_surrounded() -> None:
    north = np.arange(0.0, 60.0)
    s = Soundings(np.full(60, 5.0), north, hills(np.full(60, 5.0), north), np.full(60, 0.02))
    assert support(levels(s), 2.0, 20.0).at(np.array([[15.0, 30.0]]))[0] == pytest.approx(0.0)


@pytest.mark.slow
def test_a_smooth_kernel_serves_between_the_lines_and_is_not_believed_beyond_them() -> None:
    s, grid = lines(), Grid(0.0, 0.0, 1.0, 100, 100)
    smooth = GaussianProcessMap("gaussian").fit(s).predict(grid)
    model = GaussianProcessMap().fit(s)
    chosen, rough = model.predict(grid), GaussianProcessMap("matern32").fit(s).predict(grid)
    assert model.kernel_ != "matern32"
    truth = hills(*np.meshgrid(grid.east_m, grid.north_m))
    inside, far = np.s_[5:55, 5:95], np.s_[80:, :]

    def rmse(depth_m: FloatArray) -> float:
        return float(np.sqrt(np.mean((depth_m - truth)[inside] ** 2)))

    assert rmse(chosen.depth_m) < 0.7 * rmse(rough.depth_m)
    np.testing.assert_allclose(chosen.depth_m[far], rough.depth_m[far], atol=0.05)
    assert np.all(chosen.sd_m[far] > 0.8 * rough.sd_m[far])
    assert np.median(chosen.planning_sd_m[far]) > np.median(smooth.planning_sd_m[far]), (
        "what the smooth kernel alone would claim"
    )


@pytest.mark.slow
def test_deviations_beyond_the_soundings_are_as_large_as_the_errors_there() -> None:
    """On rough hills of many sizes, 5 to 25 m beyond half a survey."""
    rng = np.random.default_rng(1)
    waves = [(rng.normal(0, 1, 2) / size, rng.uniform(0, 7), 0.02 * size**1.3) for size in np.geomspace(4, 40, 40)]

    def floor(east: FloatArray, north: FloatArray) -> FloatArray:
        return np.asarray(20 + sum(h * np.sin(k[0] * east + k[1] * north + phase) for k, phase, h in waves))

    within = []
    for turned in range(4):
        east, north = (a.ravel() for a in np.meshgrid(np.arange(2.0, 100.0, 5.0), np.arange(0.0, 50.0)))
        at = [(east, north), (100 - north, east), (100 - east, 100 - north), (north, 100 - east)][turned]
        sd = np.full(len(east), 0.05)
        s = Soundings(*at, floor(*at) + sd * rng.standard_normal(len(east)), sd)
        grid = Grid(0.0, 0.0, 2.0, 50, 50)
        result = GaussianProcessMap().fit(s).predict(grid)
        where = np.meshgrid(grid.east_m, grid.north_m)
        past = np.array([where[1] - 49, 51 - where[0], 51 - where[1], where[0] - 49][turned])
        beyond = (past > 5) & (past < 25)
        within.append(np.abs(result.depth_m - floor(*where))[beyond] <= 1.96 * result.sd_m[beyond])
    assert np.mean(within) > 0.85
