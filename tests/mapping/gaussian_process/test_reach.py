"""What nobody measured is not known, however sure the process is of it."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.gaussian_process.calibration import HeldOutSoundings
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gaussian_process.reach import SLOPE, UNCHECKED_FACTOR, Reach, likely_factor, likely_square, reach
from app.mapping.kriging.levels import two_levels
from app.mapping.types import BathymetricMap, Grid, Soundings

GRID = Grid(0.0, 0.0, 2.0, 50, 50)
ACCURACY_M = 0.25


def hills(east: FloatArray, north: FloatArray) -> FloatArray:
    """A flat corner in the south-west, hills 2 m high elsewhere."""
    return np.asarray(10.0 + 2.0 * np.sin(east / 9.0) * np.sin(north / 9.0) * (np.hypot(east, north) > 25.0))


def sounded(east: FloatArray, north: FloatArray) -> Soundings:
    sd = np.full(len(east), 0.05)
    depth = hills(east, north) + sd * np.random.default_rng(1).standard_normal(len(east))
    return Soundings(np.asarray(east, float), np.asarray(north, float), depth, sd)


def line(east_m: float, length_m: float = 100.0) -> tuple[FloatArray, FloatArray]:
    north = np.arange(0.0, length_m, 0.5)
    return np.full(len(north), east_m), north


def lines(*east_m: float) -> Soundings:
    east, north = (np.concatenate(parts) for parts in zip(*(line(x) for x in east_m), strict=True))
    return sounded(east, north)


def mapped(soundings: Soundings) -> BathymetricMap:
    return GaussianProcessMap(reject_outliers=False).fit(soundings).predict(GRID)


def distance_m(soundings: Soundings) -> FloatArray:
    away = GRID.centres_m[:, None] - np.column_stack([soundings.east_m, soundings.north_m])
    return np.hypot(away[..., 0], away[..., 1]).min(axis=1).reshape(GRID.rows, GRID.cols)


@pytest.mark.parametrize("length_m", [10.0, 20.0])
def test_a_short_track_over_flat_ground_says_nothing_of_the_rest(length_m: float) -> None:
    soundings = sounded(*line(4.0, length_m))
    bathymetry, away = mapped(soundings), distance_m(soundings)
    known = bathymetry.known(ACCURACY_M)
    assert 0.0 < known.mean() < 0.03
    assert not known[away > 5.0].any()
    error = bathymetry.depth_m - hills(*np.meshgrid(GRID.east_m, GRID.north_m))
    far = away > 30.0
    assert bathymetry.sd_m[far].mean() > np.sqrt(np.mean(error[far] ** 2))


def test_the_deviation_grows_with_the_distance_and_planning_is_left_what_the_process_says() -> None:
    soundings = lines(30.0)
    bathymetry, away = mapped(soundings), distance_m(soundings)
    assert (bathymetry.sd_m >= bathymetry.planning_sd_m - 1e-12).all()
    assert bathymetry.sd_m[away > 20.0].min() > SLOPE * 10.0
    assert bathymetry.sd_m[away < 1.5].max() < ACCURACY_M
    np.testing.assert_array_equal(np.isinf(bathymetry.claim_sd_m), away > 2.0)


def test_a_map_without_claims_is_the_same_and_claims_nothing() -> None:
    soundings = lines(10.0, 20.0, 30.0, 40.0)
    whole = GaussianProcessMap().fit(soundings).predict(GRID)
    plain = GaussianProcessMap(claims=False).fit(soundings).predict(GRID)
    np.testing.assert_array_equal(plain.depth_m, whole.depth_m)
    np.testing.assert_array_equal(plain.sd_m, whole.sd_m)
    np.testing.assert_array_equal(plain.planning_sd_m, whole.planning_sd_m)
    assert np.isinf(plain.claim_sd_m).all()
    assert np.isfinite(whole.claim_sd_m).any()


def test_ground_between_lines_is_known_once_they_lie_side_by_side() -> None:
    apart = np.arange(2.0, 100.0, 6.0)
    between = np.abs(GRID.east_m - 5.0) < 1.1
    assert not mapped(lines(2.0)).known(ACCURACY_M)[:, between].any()
    everything = mapped(lines(*apart))
    assert everything.known(ACCURACY_M)[:, between].mean() > 0.9
    error = np.abs(everything.depth_m - hills(*np.meshgrid(GRID.east_m, GRID.north_m)))
    assert (error[everything.known(ACCURACY_M)] <= 2 * ACCURACY_M).mean() > 0.95


def test_only_distances_that_are_checked_in_many_places_and_directions_count() -> None:
    one = reach(two_levels(lines(50.0), 1.0, 3.0), 1.0, 1.0)
    assert one.checked_m == 0.0
    many = reach(two_levels(lines(*np.arange(2.0, 100.0, 6.0)), 1.0, 3.0), 1.0, 1.0)
    assert 3.0 < many.checked_m < 25.0
    rng = np.random.default_rng(5)
    few = reach(two_levels(sounded(*rng.uniform(0, 100, (2, 12))), 1.0, 3.0), 1.0, 1.0)
    assert few.checked_m == 0.0


def test_steep_ground_along_a_track_makes_more_uncertain_what_lies_beside_it() -> None:
    east, north = line(50.0)
    flat = Soundings(east, north, np.full(len(east), 12.0), np.full(len(east), 0.05))
    steep = Soundings(east, north, 12.0 + 5.0 * np.sin(north / 8.0), np.full(len(east), 0.05))
    slopes = [reach(two_levels(s, 1.0, 3.0), 1.0, 1.0).slope for s in (flat, steep)]
    assert slopes[0] == pytest.approx(SLOPE)
    assert 0.3 < slopes[1] < 0.6


@pytest.mark.parametrize("too_small", [1.0, 2.0, 3.0])
def test_checks_that_fail_raise_the_factor_and_few_checks_leave_more_possible(too_small: float) -> None:
    rng = np.random.default_rng(7)

    def held_out(count: int) -> HeldOutSoundings:
        error = too_small * rng.standard_normal(count)
        points = np.column_stack([10.0 * np.arange(count), np.zeros(count)])
        return HeldOutSoundings(points, error, np.full(count, 1e-6), np.ones(count))

    def factor(count: int) -> float:
        square = likely_square(held_out(count), np.ones(count), 0.0, 5.0)
        return likely_factor([] if square is None else [square])

    assert too_small < factor(2000) < 1.1 * too_small
    assert factor(20) > factor(2000)
    assert factor(3) == UNCHECKED_FACTOR


def diving() -> Soundings:
    """A short track down a slope, from 2 to 8 m: followed back, the slope leaves the water."""
    along = np.arange(0.0, 30.0, 0.5)
    depth = 2.0 + 0.2 * along + 0.05 * np.random.default_rng(4).standard_normal(len(along))
    return Soundings(35.0 + along, 50.0 + 0.4 * along, depth, np.full(len(along), 0.05))


def test_far_from_soundings_the_depth_is_no_other_than_was_sounded_and_less_sure() -> None:
    soundings = diving()
    free = GaussianProcessMap(reject_outliers=False, calibrate=False).fit(soundings).predict(GRID)
    assert free.depth_m.min() < 0.0
    bathymetry = mapped(soundings)
    unsupported = np.isinf(bathymetry.claim_sd_m)
    low, high = soundings.depth_m.min(), soundings.depth_m.max()
    assert unsupported.mean() > 0.9
    assert low - 0.2 <= bathymetry.depth_m[unsupported].min()
    assert bathymetry.depth_m[unsupported].max() <= high + 0.2
    assert (bathymetry.depth_m >= 0.0).all()
    moved = unsupported & (np.abs(bathymetry.depth_m - free.depth_m) > 1.0)
    assert moved.any()
    assert (bathymetry.sd_m[moved] >= 1.0).all()
    # Where soundings support the map it is what they make of it.
    np.testing.assert_allclose(bathymetry.depth_m[~unsupported], free.depth_m[~unsupported], atol=1e-9)


@pytest.mark.parametrize("ends_m", [(-1.0, 5.0), (3.0, 9.0)])
def test_ground_above_the_datum_is_told_only_where_it_was_sounded(ends_m: tuple[float, float]) -> None:
    low, high = ends_m
    believed = Reach(5.0, 1.0, 0.1, 3.0, shallowest_m=low, deepest_m=high)
    depth, away = np.array([-40.0, -0.5, 4.0, 40.0]), np.array([1.0, 9.0])[:, None]
    bounded, moved = believed.plausible(np.tile(depth, (2, 1)), np.tile(away, (1, 4)), 1.0)
    assert bounded[0].tolist() == [min(low, 0.0), max(-0.5, min(low, 0.0)), 4.0, 40.0]
    assert bounded[1].tolist() == [low, max(low, -0.5), 4.0, high]
    assert (moved == np.minimum(np.abs(bounded - depth), 3.0)).all()
