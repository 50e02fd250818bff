"""The map of a swath survey claims what was sounded, and nothing else."""

import numpy as np

from app.mapping.swath.density import DensityGrid
from app.mapping.swath.ensonified import ensonified
from app.mapping.swath.gridded import area_of, gridded_map, without_guesses
from app.mapping.types import BathymetricMap, Grid

GRID = Grid(0.0, 0.0, 1.0, 30, 40)
MASK = np.ones((30, 40), dtype=bool)


def swept(cells: np.ndarray, times: int = 6) -> DensityGrid:
    density = DensityGrid(GRID, MASK)
    rows, cols = np.nonzero(cells)
    rng = np.random.default_rng(0)
    for _ in range(times):
        depth = 10.0 + 0.1 * cols + 0.05 * rng.standard_normal(len(rows))
        places = np.column_stack([cols, rows]).astype(np.float64) + 0.5
        density.add(places[:, 0], places[:, 1], depth, np.full(len(rows), 0.05))
    return density


def made(density: DensityGrid) -> BathymetricMap:
    bathymetry = gridded_map(density)
    assert bathymetry is not None
    return bathymetry


def test_nothing_sounded_is_no_map() -> None:
    assert gridded_map(DensityGrid(GRID, MASK)) is None


def test_cells_have_the_mean_and_are_as_sure_as_their_soundings() -> None:
    bathymetry = made(swept(MASK))
    truth = np.tile(10.0 + 0.1 * np.arange(40), (30, 1))
    error = bathymetry.depth_m - truth
    assert np.abs(error).max() < 0.12
    assert 0.6 < (np.abs(error) <= bathymetry.sd_m).mean() < 0.95
    assert bathymetry.known(0.1).all()


def test_ground_that_nobody_saw_is_not_known() -> None:
    cells = MASK.copy()
    cells[:, 20:] = False
    bathymetry = made(swept(cells))
    assert bathymetry.known(0.1)[:, :20].all()
    assert not bathymetry.known(100.0)[:, 22:].any(), "whatever is asked"
    assert (np.diff(bathymetry.sd_m[5, 20:]) > 0.0).all(), "less and less sure"
    assert not bathymetry.sounded[:, 20:].any()


def test_a_map_is_shown_where_something_speaks_for_it() -> None:
    cells = MASK.copy()
    cells[:, 20:] = False
    shown = without_guesses(made(swept(cells)))
    assert np.isfinite(shown.depth_m[:, :22]).all()
    assert np.isnan(shown.depth_m[:, 22:]).all()
    assert np.isnan(shown.sd_m[:, 22:]).all()
    assert area_of(shown).all(), "it is of the area all the same"


def test_how_far_it_has_come() -> None:
    cells = MASK.copy()
    cells[:, 25:] = False
    cells[10:13, 5:8] = False
    density = swept(cells)
    density.add(np.array([6.5]), np.array([20.5]), np.array([9.0]), np.array([1.0]))
    found = ensonified(made(density))
    assert found is not None
    assert np.isclose(found.ensonified_pct, 100.0 * (750 - 9) / 1200)
    assert [holiday.area_m2 for holiday in found.holidays] == [9.0], "what is still ahead is no holiday"
    sparse = ensonified(made(swept(cells, times=4)))
    assert sparse is not None
    assert sparse.dense_pct == 0.0


def test_a_map_of_another_kind_is_none_of_swaths() -> None:
    bathymetry = made(swept(MASK))
    other = BathymetricMap(**{**vars(bathymetry), "model": "Gaussian process"})
    assert ensonified(other) is None


def test_what_soundings_share_is_not_averaged_out() -> None:
    density = DensityGrid(GRID, MASK)
    east, north = (axis.ravel() for axis in np.meshgrid(GRID.east_m, GRID.north_m))
    same = np.ones(len(east))
    for _ in range(50):
        density.add(east, north, 10.0 * same, 0.05 * same, 0.06 * same, 1.5 * same)
    bathymetry = made(density)
    assert np.allclose(bathymetry.sd_m, np.hypot(0.05 / np.sqrt(50), 0.06))
    assert bathymetry.horizontal_sd_m is not None
    assert np.allclose(bathymetry.horizontal_sd_m, 1.5)
    assert bathymetry.shared_sd_m is not None
    assert np.allclose(bathymetry.shared_sd_m, 0.06)


def test_on_a_slope_an_uncertain_place_is_an_uncertain_depth() -> None:
    density = DensityGrid(GRID, MASK)
    east, north = (axis.ravel() for axis in np.meshgrid(GRID.east_m, GRID.north_m))
    same = np.ones(len(east))
    density.add(east, north, 10.0 + 0.3 * east, 0.05 * same, 0.0 * same, 1.5 * same)
    bathymetry = made(density)
    assert np.allclose(bathymetry.sd_m[5:-5, 5:-5], np.hypot(0.05, 0.3 * 1.5), rtol=1e-3)
    assert bathymetry.shared_sd_m is not None
    assert np.allclose(bathymetry.shared_sd_m[5:-5, 5:-5], 0.3 * 1.5, rtol=1e-3), "its soundings share the slope"


def test_without_a_word_on_places_nothing_is_said_of_them() -> None:
    assert made(swept(MASK)).horizontal_sd_m is None
