"""The papers' Gaussian interpolation against direct sums, and what an incremental map must do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.gaussian import REACH, GaussianInterpolator, choose_width
from app.mapping.types import Grid, Soundings

GRID = Grid(west_m=5.0, south_m=-3.0, cell_m=0.5, rows=30, cols=40)


def random_soundings(n: int, seed: int, sd_m: float = 0.1) -> Soundings:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(4, 26, n), rng.uniform(-4, 13, n)
    depth = 8 + np.sin(east / 3) + 0.2 * north + sd_m * rng.standard_normal(n)
    return Soundings(east, north, depth, rng.uniform(0.5, 2.0, n) * sd_m)


def direct_sums(grid: Grid, s: Soundings, width_m: float) -> FloatArray:
    """AURO15 eq. 3, normalised, one cell at a time over all soundings."""
    result = np.empty(grid.rows * grid.cols)
    for i, (east, north) in enumerate(grid.centres_m):
        de, dn = np.abs(s.east_m - east), np.abs(s.north_m - north)
        phi = np.exp(-(de**2 + dn**2) / width_m**2) / s.sd_m**2
        phi[(de > REACH * width_m) | (dn > REACH * width_m)] = 0.0
        result[i] = (phi @ s.depth_m) / phi.sum() if phi.sum() > 0 else np.nan
    return result.reshape(grid.rows, grid.cols)


@pytest.mark.parametrize("width_m", [0.3, 1.0, 2.7])
def test_depth_is_the_direct_sum(width_m: float) -> None:
    s = random_soundings(40, seed=1)
    live = GaussianInterpolator(GRID, width_m)
    live.add(s)
    np.testing.assert_allclose(live.depth_m, direct_sums(GRID, s, width_m), rtol=1e-9)


@settings(deadline=None)
@given(seed=st.integers(0, 1000), cut=st.integers(0, 30))
def test_one_by_one_or_all_at_once_is_the_same(seed: int, cut: int) -> None:
    s = random_soundings(30, seed)
    at_once, in_parts = GaussianInterpolator(GRID, 1.5), GaussianInterpolator(GRID, 1.5)
    at_once.add(s)
    order = np.random.default_rng(seed).permutation(30)
    in_parts.add(s.take(order[:cut]))
    in_parts.add(s.take(order[cut:]))
    np.testing.assert_allclose(in_parts.depth_m, at_once.depth_m, rtol=1e-9)
    np.testing.assert_allclose(in_parts.sd_m, at_once.sd_m, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(in_parts.to_map().count, at_once.to_map().count)


def test_very_many_soundings_are_added_as_a_few_are() -> None:
    s = random_soundings(25_000, seed=2)
    at_once, in_parts = GaussianInterpolator(GRID, 0.8), GaussianInterpolator(GRID, 0.8)
    at_once.add(s)
    for part in np.array_split(np.arange(len(s)), 5):
        in_parts.add(s.take(part))
    np.testing.assert_allclose(at_once.depth_m, in_parts.depth_m, rtol=1e-9)
    np.testing.assert_allclose(at_once.sd_m, in_parts.sd_m, rtol=1e-6)
    np.testing.assert_array_equal(at_once.to_map().count, in_parts.to_map().count)


@settings(deadline=None)
@given(depth=st.floats(0.5, 6000.0))
def test_a_constant_sea_floor_is_reproduced(depth: float) -> None:
    s = random_soundings(30, seed=3)
    live = GaussianInterpolator(GRID, 2.0)
    live.add(Soundings(s.east_m, s.north_m, np.full(30, depth), s.sd_m))
    known = np.isfinite(live.depth_m)
    assert known.any()
    np.testing.assert_allclose(live.depth_m[known], depth, rtol=1e-12)


def test_deviation_grows_away_from_the_only_sounding() -> None:
    live = GaussianInterpolator(GRID, 2.0)
    live.add(Soundings(np.array([GRID.east_m[3]]), np.array([GRID.north_m[5]]), np.array([9.0]), np.array([0.1])))
    along = live.sd_m[5, 3:18]
    assert along[0] == pytest.approx(0.1)
    assert np.all(np.diff(along) > 0)


def test_out_of_reach_nothing_is_known() -> None:
    live = GaussianInterpolator(GRID, 0.5)
    assert np.isnan(live.depth_m).all()
    live.add(Soundings(np.array([6.0]), np.array([0.0]), np.array([9.0]), np.array([0.1])))
    result = live.to_map()
    assert np.isnan(result.depth_m[-1, -1])
    assert result.sounded.sum() == result.count.sum() == 1


def test_width_follows_the_sea_floor() -> None:
    rng = np.random.default_rng(0)
    east, north = rng.uniform(5, 25, 400), rng.uniform(-3, 12, 400)
    rough = Soundings(east, north, np.sin(east) * np.cos(north), np.full(400, 0.01))
    noisy = Soundings(east, north, 8 + rng.standard_normal(400), np.full(400, 1.0))
    assert choose_width(rough, GRID) < 0.5 * choose_width(noisy, GRID)


def test_width_bridges_the_gaps_between_tracks() -> None:
    """Neighbours along a dense track are much closer than the gap; the width must not follow them."""
    lines = np.arange(5.0, 26.0, 5.0)
    north = np.arange(-3.0, 12.0, 0.1)
    east, north = (a.ravel() for a in np.meshgrid(lines, north))
    s = Soundings(east, north, 8 + 0.1 * np.sin(north / 4), np.full(len(east), 0.05))
    width = choose_width(s, GRID)
    live = GaussianInterpolator(GRID, width)
    live.add(s)
    assert np.isfinite(live.depth_m).all()


@pytest.mark.parametrize("width_m", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_width_is_named(width_m: float) -> None:
    with pytest.raises(ValueError, match="width_m"):
        GaussianInterpolator(GRID, width_m)


def test_bad_soundings_change_nothing() -> None:
    live = GaussianInterpolator(GRID, 1.0)
    good = random_soundings(5, seed=0)
    live.add(good)
    before = live.depth_m
    with pytest.raises(ValueError, match=r"depth_m\[2\] is nan"):
        live.add(Soundings(good.east_m, good.north_m, np.array([1, 2, np.nan, 4, 5.0]), good.sd_m))
    np.testing.assert_array_equal(live.depth_m, before)
