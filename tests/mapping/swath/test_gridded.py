"""The map of a swath survey claims what was sounded, and nothing else."""

import numpy as np
import pytest

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
    lies = 0.3 * 1.0 / np.sqrt(12.0)
    assert np.allclose(bathymetry.sd_m, np.sqrt(0.05**2 + lies**2 + (0.3 * 1.5) ** 2), rtol=2e-3), (
        "somewhere in its cell"
    )
    assert bathymetry.shared_sd_m is not None
    assert np.allclose(bathymetry.shared_sd_m, 0.3 * 1.5, rtol=2e-3), "its soundings share the slope"


def test_without_a_word_on_places_nothing_is_said_of_them() -> None:
    assert made(swept(MASK)).horizontal_sd_m is None


def test_soundings_whose_place_is_uncertain_by_nobody_knows_what_make_no_place_better() -> None:
    density = DensityGrid(GRID, MASK)
    east, north = (axis.ravel() for axis in np.meshgrid(GRID.east_m, GRID.north_m))
    same = np.ones(len(east))
    swath, single = east < 20.0, east > 10.0
    none = np.where(east < 5.0, np.nan, 1.5)
    density.add(*(axis[swath] for axis in (east, north, 10.0 * same, 0.2 * same, 0.1 * same, none)))
    density.add(*(axis[single] for axis in (east, north, 10.0 * same, 0.01 * same)))
    horizontal = made(density.copy()).horizontal_sd_m
    assert horizontal is not None
    assert np.isnan(horizontal[:, :5]).all(), "of a sonar that does not know where it is"
    assert np.allclose(horizontal[:, 5:20], 1.5), "with single beams in the cell as without"
    assert np.isnan(horizontal[:, 20:]).all(), "single beams do not tell"
    assert np.isfinite(made(density).sd_m).all()


def sounded_rows(every: int, east: float, north: float, seed: int = 0) -> BathymetricMap:
    """A floor that falls to the east and the north, of which every so-manyth row was sounded eight times."""
    rng = np.random.default_rng(seed)
    density = DensityGrid(GRID, MASK)
    at = GRID.centres_m[np.repeat(np.arange(0, 30, every), 40) * 40 + np.tile(np.arange(40), -(-30 // every))]
    for _ in range(8):
        depth = 10.0 + east * at[:, 0] + north * at[:, 1] + 0.05 * rng.standard_normal(len(at))
        density.add(at[:, 0], at[:, 1], depth, np.full(len(at), 0.05))
    return made(density)


@pytest.mark.parametrize("every", [2, 3, 4, 5, 6, 7, 12])
@pytest.mark.parametrize("slope", [0.1, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("bearing", [0.0, 0.7, np.pi / 2])
def test_intervals_hold_between_sounded_rows_of_a_slope(every: int, slope: float, bearing: float) -> None:
    east, north = slope * np.sin(bearing), slope * np.cos(bearing)
    bathymetry = sounded_rows(every, east, north)
    truth = 10.0 + east * GRID.east_m + north * GRID.north_m[:, None]
    bridged = ~bathymetry.sounded & np.isfinite(bathymetry.claim_sd_m)
    assert bridged.any()
    error = np.abs(bathymetry.depth_m - truth)
    assert (error <= 1.96 * bathymetry.sd_m)[bridged].mean() > 0.93
    if every <= 5:
        assert error[:26][bridged[:26]].max() < 0.2, "in a straight line from side to side"


def test_between_sounded_rows_of_a_level_floor_nothing_is_less_sure() -> None:
    bathymetry = sounded_rows(4, 0.0, 0.0)
    away = np.array([0, 1, 2, 1])[np.arange(30) % 4].astype(float)
    away[-1] = 1.0
    expected = np.hypot(0.05 / np.sqrt(8) * np.sqrt(2.0), 0.15 * away)[:, None]
    assert (np.abs(bathymetry.sd_m - expected) < 0.02).all()
    assert np.isfinite(bathymetry.claim_sd_m).all()
