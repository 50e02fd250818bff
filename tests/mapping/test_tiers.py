"""Cells by depth: each tier is what the soundings would make in its cells, where its depths are."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map, without_guesses
from app.mapping.tiers import coarsened, doublings, tiers
from app.mapping.types import BathymetricMap, Grid

SHARE = 0.05


def swept(grid: Grid, mask: np.ndarray, seed: int = 0, number: int = 4000) -> tuple[BathymetricMap, FloatArray]:
    """A slope from 5 to 75 m with a hole in the soundings; the map, and the soundings (n, 4)."""
    rng = np.random.default_rng(seed)
    width, height = grid.cols * grid.cell_m, grid.rows * grid.cell_m
    east, north = rng.uniform(0.0, width, number) + grid.west_m, rng.uniform(0.0, height, number) + grid.south_m
    away = np.hypot(east - grid.west_m - width / 2, north - grid.south_m - height / 2) > 0.1 * width
    east, north = east[away], north[away]
    sd = rng.uniform(0.05, 0.4, len(east))
    depth = 5.0 + 70.0 * (east - grid.west_m) / width + sd * rng.standard_normal(len(east))
    soundings = np.column_stack([east, north, depth, sd])
    return mapped(grid, mask, soundings), soundings


@contextmanager
def level() -> Iterator[None]:
    """Without what slopes add to deviations: they are told by the cells of each size themselves."""

    def nowhere(depth_m: FloatArray, cell_m: float, sd_m: FloatArray | None = None) -> FloatArray:
        return np.zeros_like(depth_m)

    with patch("app.mapping.tiers.gradient", nowhere), patch("app.mapping.swath.gridded.gradient", nowhere):
        yield


def mapped(grid: Grid, mask: np.ndarray, soundings: FloatArray) -> BathymetricMap:
    """The map of soundings (n, 4), or (n, 5) with what they share, or (n, 6) with the deviation of their places."""
    density = DensityGrid(grid, mask)
    density.add(*soundings.T)
    found = gridded_map(density)
    assert found is not None
    return without_guesses(found)


@pytest.mark.parametrize(
    ("depth", "number"), [(-1.0, 0), (0.0, 0), (20.0, 0), (20.01, 1), (40.0, 1), (79.0, 2), (161.0, 4)]
)
def test_cells_are_doubled_until_the_depth_is_served(depth: float, number: int) -> None:
    assert doublings(np.array([depth]), 1.0, SHARE).tolist() == [number]
    assert doublings(np.array([np.nan]), 1.0, SHARE).tolist() == [0]


@pytest.mark.parametrize("times", [1, 2, 4, 8])
@level()
def test_larger_cells_hold_what_their_soundings_make(times: int) -> None:
    mask = np.ones((37, 50), dtype=bool)
    bathymetry, soundings = swept(Grid(-3.0, 8.0, 0.5, 37, 50), mask)
    rows, cols = -(-37 // times), -(-50 // times)
    direct = mapped(Grid(-3.0, 8.0, 0.5 * times, rows, cols), np.ones((rows, cols), dtype=bool), soundings)
    made = coarsened(bathymetry, times)
    assert made.grid == direct.grid
    assert (made.sounded == direct.sounded).all()
    assert (made.count == direct.count).all()
    np.testing.assert_allclose(made.depth_m[made.sounded], direct.depth_m[made.sounded], rtol=1e-12)
    np.testing.assert_allclose(made.sd_m[made.sounded], direct.sd_m[made.sounded], rtol=1e-6)
    assert np.isnan(made.depth_m[~made.sounded]).all(), "a cell without soundings has no depth"
    twice = coarsened(made, 2)
    np.testing.assert_allclose(twice.sd_m, coarsened(bathymetry, 2 * times).sd_m, rtol=1e-6)


def slow_sd_m(soundings: FloatArray, times: int, rows: int, cols: int) -> FloatArray:
    """The deviation of each larger cell, one sounding after the other; the small cells are of 1 m, from 0, 0."""
    found = np.full((rows, cols), np.nan)
    for row in range(rows):
        for col in range(cols):
            here = [one for one in soundings if (one[0] // times, one[1] // times) == (col, row)]
            if not here:
                continue
            weights = [1.0 / sd**2 for _, _, _, sd, _ in here]
            mean = sum(weight * one[2] for weight, one in zip(weights, here, strict=True)) / sum(weights)
            spread = sum(weight * (one[2] - mean) ** 2 for weight, one in zip(weights, here, strict=True))
            shared = sum(weight * one[4] ** 2 for weight, one in zip(weights, here, strict=True))
            found[row, col] = np.sqrt((1.0 + spread / len(here) + shared) / sum(weights))
    return found


@given(
    seed=st.integers(0, 2**32 - 1),
    number=st.integers(1, 120),
    times=st.sampled_from([1, 2, 3, 4, 8, 32]),
    shared_m=st.floats(0.0, 1.0),
)
@level()
def test_what_a_cell_s_soundings_share_is_as_large_in_larger_cells(
    seed: int, number: int, times: int, shared_m: float
) -> None:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(0.0, 11.0, number), rng.uniform(0.0, 9.0, number)
    sd, shared = rng.uniform(0.05, 0.4, number), shared_m * rng.uniform(0.5, 1.5, number)
    soundings = np.column_stack([east, north, 20.0 + 0.5 * east + rng.standard_normal(number), sd, shared])
    made = coarsened(mapped(Grid(0.0, 0.0, 1.0, 9, 11), np.ones((9, 11), dtype=bool), soundings), times)
    rows, cols = made.depth_m.shape
    direct = mapped(made.grid, np.ones((rows, cols), dtype=bool), soundings)
    np.testing.assert_allclose(made.sd_m, np.where(direct.sounded, direct.sd_m, np.nan), rtol=1e-6)
    np.testing.assert_allclose(made.sd_m, slow_sd_m(soundings, times, rows, cols), rtol=1e-6)


@pytest.mark.parametrize("each", [1, 2, 4, 20])
@pytest.mark.parametrize("times", [1, 2, 5])
def test_of_few_soundings_on_a_slope_intervals_hold_wherever_they_lie(each: int, times: int) -> None:
    """So many soundings in each cell of 5 m, of a map with cells a so-manyth as large."""
    rng = np.random.default_rng(each)
    corner = np.repeat(np.indices((40, 40)).reshape(2, -1).T * 5.0, each, axis=0)
    north, east = (corner + rng.uniform(0.0, 5.0, corner.shape)).T
    same = np.ones(len(east))
    depth = 10.0 + 0.3 * north + 0.05 * rng.standard_normal(len(east))
    side = 40 * times
    fine = mapped(
        Grid(0.0, 0.0, 5.0 / times, side, side),
        np.ones((side, side), dtype=bool),
        np.column_stack([east, north, depth, 0.05 * same]),
    )
    made = coarsened(fine, times)
    error = made.depth_m - (10.0 + 0.3 * made.grid.north_m[:, None])
    assert (np.abs(error) <= 1.96 * made.sd_m).mean() > 0.93
    assert np.median(made.sd_m) < 1.1 * np.hypot(0.3 * 5.0 / np.sqrt(12.0), 0.05) * np.sqrt(2.0 / (1 + each))


@pytest.mark.parametrize("times", [2, 4, 8])
def test_uncertain_places_on_a_slope_are_as_uncertain_in_larger_cells(times: int) -> None:
    rng = np.random.default_rng(0)
    east, north = rng.uniform(0.0, 96.0, (2, 200_000))
    same = np.ones(len(east))
    soundings = np.column_stack([east, north, 10.0 + 0.4 * east, 0.1 * same, 0.05 * same, 1.5 * same])
    made = coarsened(mapped(Grid(0.0, 0.0, 1.0, 96, 96), np.ones((96, 96), dtype=bool), soundings), times)
    side = 96 // times
    direct = mapped(made.grid, np.ones((side, side), dtype=bool), soundings)
    # Beside the edge slopes are smoothed over fewer cells; where soundings lie in a cell makes a slope a little uneven.
    inner = (slice(3, -3), slice(3, -3))
    np.testing.assert_allclose(made.sd_m[inner], direct.sd_m[inner], rtol=0.02)
    assert made.sd_m.min() > 0.4 * 1.5 * 0.6
    assert made.horizontal_sd_m is not None
    assert direct.horizontal_sd_m is not None
    np.testing.assert_allclose(made.horizontal_sd_m, direct.horizontal_sd_m)


def test_places_that_are_not_known_do_not_count_in_larger_cells() -> None:
    rng = np.random.default_rng(0)
    east, north = rng.uniform(0.0, 32.0, (2, 5_000))
    same = np.ones(len(east))
    aside = np.where((east < 8.0) | (rng.random(len(east)) < 0.3), np.nan, rng.uniform(0.5, 2.0, len(east)))
    soundings = np.column_stack([east, north, 10.0 * same, 0.05 * same, 0.1 * same, aside])
    grid, mask = Grid(0.0, 0.0, 1.0, 32, 32), np.ones((32, 32), dtype=bool)
    made = coarsened(mapped(grid, mask, soundings), 4).horizontal_sd_m
    assert made is not None
    assert np.isnan(made[:, :2]).all()
    assert (made[:, 2:] > 0.5).all()
    assert (made[:, 2:] < 2.0).all()


def test_what_an_earlier_version_stored_is_not_averaged_at_all() -> None:
    rng = np.random.default_rng(0)
    east, north = rng.uniform(0.0, 32.0, (2, 20_000))
    same = np.ones(len(east))
    soundings = np.column_stack([east, north, 10.0 * same, 0.05 * same, 0.1 * same])
    bathymetry = mapped(Grid(0.0, 0.0, 1.0, 32, 32), np.ones((32, 32), dtype=bool), soundings)
    made = coarsened(replace(bathymetry, shared_sd_m=None), 8)
    assert (made.sd_m >= 0.1).all()
    np.testing.assert_allclose(coarsened(coarsened(replace(bathymetry, shared_sd_m=None), 2), 4).sd_m, made.sd_m)


def test_errors_that_belong_together_are_not_averaged_away() -> None:
    mask = np.ones((20, 20), dtype=bool)
    bathymetry = replace(swept(Grid(0.0, 0.0, 1.0, 20, 20), mask)[0], precision=None)
    made = coarsened(bathymetry, 4)
    sounded = bathymetry.sounded[:4, :4]
    assert made.depth_m[0, 0] == pytest.approx(bathymetry.depth_m[:4, :4][sounded].mean())
    assert made.sd_m[0, 0] == pytest.approx(bathymetry.sd_m[:4, :4][sounded].mean())


def test_every_sounded_place_is_in_the_tier_of_its_depth_and_tiers_overlap() -> None:
    bathymetry, _ = swept(Grid(0.0, 0.0, 1.0, 60, 60), np.ones((60, 60), dtype=bool), number=20_000)
    found = tiers(bathymetry, SHARE)
    assert [tier.map.grid.cell_m for tier in found] == [1.0, 2.0, 4.0]
    assert [(tier.from_m, tier.to_m) for tier in found] == [(-np.inf, 20.0), (18.0, 40.0), (36.0, 80.0)]
    right = doublings(bathymetry.depth_m, 1.0, SHARE)
    for number, tier in enumerate(found):
        shown = np.isfinite(tier.map.depth_m).repeat(2**number, 0).repeat(2**number, 1)[:60, :60]
        assert shown[bathymetry.sounded & (right == number)].all()
        assert (np.isfinite(tier.map.depth_m) == tier.map.sounded).all()
        relief = 2.0 * 70.0 / 60.0 * 2**number + 2.0
        depths = tier.map.depth_m[tier.map.sounded]
        assert tier.from_m - relief < depths.min() < depths.max() < tier.to_m + relief


def test_a_map_without_soundings_has_no_tiers() -> None:
    bathymetry, _ = swept(Grid(0.0, 0.0, 1.0, 10, 10), np.ones((10, 10), dtype=bool))
    assert tiers(replace(bathymetry, sounded=np.zeros_like(bathymetry.sounded)), SHARE) == []


@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 400))
def test_larger_cells_keep_the_least_depth_of_the_smallest(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(0.0, 33.0, number), rng.uniform(0.0, 21.0, number)
    soundings = np.column_stack([east, north, rng.uniform(5.0, 150.0, number), np.full(number, 0.1)])
    bathymetry = mapped(Grid(0.0, 0.0, 1.0, 21, 33), np.ones((21, 33), dtype=bool), soundings)
    for tier in tiers(bathymetry, SHARE):
        times = round(tier.map.grid.cell_m)
        assert (np.isfinite(tier.least_depth_m) == tier.map.sounded).all()
        for row, col in np.argwhere(tier.map.sounded):
            here = (slice(row * times, (row + 1) * times), slice(col * times, (col + 1) * times))
            expected = bathymetry.depth_m[here][bathymetry.sounded[here]].min()
            assert tier.least_depth_m[row, col] == expected <= tier.map.depth_m[row, col] + 1e-9
