"""Cells by depth: each tier is what the soundings would make in its cells, where its depths are."""

from dataclasses import replace

import numpy as np
import pytest

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


def mapped(grid: Grid, mask: np.ndarray, soundings: FloatArray) -> BathymetricMap:
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
