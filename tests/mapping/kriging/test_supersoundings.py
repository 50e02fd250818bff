"""Merging keeps what the soundings say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.kriging.supersoundings import merge_soundings
from app.mapping.types import Soundings


def track(seed: int, n: int = 80) -> Soundings:
    rng = np.random.default_rng(seed)
    return Soundings(rng.uniform(0, 9, n), rng.uniform(0, 9, n), rng.uniform(3, 9, n), rng.uniform(0.05, 0.3, n))


@settings(deadline=None)
@given(st.integers(0, 500), st.floats(0.2, 20.0))
def test_precision_and_weighted_mean_are_kept(seed: int, cell_m: float) -> None:
    s = track(seed)
    merged, group = merge_soundings(s, cell_m)
    assert group.shape == (80,)
    np.testing.assert_allclose(np.sum(merged.sd_m**-2.0), np.sum(s.sd_m**-2.0))
    np.testing.assert_allclose(np.sum(merged.depth_m / merged.sd_m**2), np.sum(s.depth_m / s.sd_m**2), rtol=1e-9)


@settings(deadline=None)
@given(st.integers(0, 500))
def test_a_plane_stays_a_plane(seed: int) -> None:
    s = track(seed)
    plane = Soundings(s.east_m, s.north_m, 2 + 0.3 * s.east_m - 0.1 * s.north_m, s.sd_m)
    merged, _ = merge_soundings(plane, 2.0)
    np.testing.assert_allclose(merged.depth_m, 2 + 0.3 * merged.east_m - 0.1 * merged.north_m, rtol=1e-9)


@settings(deadline=None)
@given(st.integers(0, 500))
def test_order_does_not_matter(seed: int) -> None:
    s = track(seed)
    shuffled = s.take(np.random.default_rng(seed).permutation(len(s)))
    a, _ = merge_soundings(s, 1.0)
    b, _ = merge_soundings(shuffled, 1.0)
    np.testing.assert_allclose(a.depth_m, b.depth_m, rtol=1e-9)
    np.testing.assert_allclose(a.east_m, b.east_m, rtol=1e-9)


@pytest.mark.parametrize("spread_m", [30.0, 3e6])
def test_few_squares_and_many_are_merged_alike(spread_m: float) -> None:
    rng = np.random.default_rng(3)
    n = 400
    east, north = rng.uniform(-spread_m, spread_m, (2, n))
    east[1::2], north[1::2] = east[::2] + 0.1, north[::2] + 0.1  # pairs, most of them in one square
    soundings = Soundings(east, north, rng.uniform(5, 9, n), rng.uniform(0.05, 0.3, n))
    merged, group = merge_soundings(soundings, 2.0)
    col = np.floor((east - east.min()) / 2.0).astype(int)
    row = np.floor((north - north.min()) / 2.0).astype(int)
    squares = sorted(set(zip(row.tolist(), col.tolist(), strict=True)))
    assert len(merged) == len(squares) < n
    assert [squares[g] for g in group] == list(zip(row.tolist(), col.tolist(), strict=True))
    for g in range(len(merged)):
        weight = 1.0 / soundings.sd_m[group == g] ** 2
        assert merged.depth_m[g] == pytest.approx(np.average(soundings.depth_m[group == g], weights=weight))
        assert merged.sd_m[g] == pytest.approx(weight.sum() ** -0.5)
