"""What a map of swaths says of its survey, alone and together with what was known before."""

from dataclasses import replace

import numpy as np
import pytest

from app.mapping.coordinates.outlines import outlines
from app.mapping.gaussian_process.fusion import fuse, prior_map
from app.mapping.layers import LAYERS, LayerSource
from app.mapping.swath.density import LEAST_SOUNDINGS, DensityGrid
from app.mapping.swath.ensonified import ensonified
from app.mapping.swath.gridded import gridded_map
from app.mapping.types import BathymetricMap, Grid, Soundings

GRID = Grid(0.0, 0.0, 1.0, 30, 30)


@pytest.fixture
def swept() -> BathymetricMap:
    """All but four by three cells, each met once; the first row six times."""
    density = DensityGrid(GRID, np.ones((30, 30), dtype=bool))
    missed = np.zeros((30, 30), dtype=bool)
    missed[10:13, 5:9] = True
    places = GRID.centres_m[~missed.ravel()]
    places = np.concatenate([places, *[places[:30]] * 5])
    density.add(places[:, 0], places[:, 1], np.full(len(places), 10.0), np.full(len(places), 0.1))
    found = gridded_map(density)
    assert found is not None
    return found


def test_a_holiday_has_its_own_cells(swept: BathymetricMap) -> None:
    found = ensonified(swept)
    assert found is not None
    (holiday,) = found.holidays
    assert holiday.cells.shape == (3, 4)
    (outline,) = outlines(holiday.cells, holiday.west_m, holiday.south_m, GRID.cell_m)
    assert outline.bounds == (5.0, 10.0, 9.0, 13.0)
    assert outline.area == holiday.area_m2 == 12.0


def test_full_coverage_is_dense_everywhere_and_misses_nothing(swept: BathymetricMap) -> None:
    dense = replace(swept, count=np.full_like(swept.count, LEAST_SOUNDINGS), sounded=np.ones_like(swept.sounded))
    for bathymetry, full in ((swept, False), (dense, True), (replace(dense, sounded=swept.sounded), False)):
        found = ensonified(bathymetry)
        assert found is not None
        assert found.full_coverage is full


def test_what_was_known_before_covers_no_holiday(swept: BathymetricMap) -> None:
    along = np.linspace(1.0, 29.0, 12)
    east, north = (axis.ravel() for axis in np.meshgrid(along, along))
    prior = prior_map(
        Soundings(east, north, 10.0 + 0.01 * east, np.full(len(east), 0.5)), GRID, np.ones((30, 30), bool)
    )
    alone, together = ensonified(swept), ensonified(fuse(swept, prior))
    assert together is not None
    assert together == alone
    assert ensonified(prior) is None


def test_density_is_a_layer_of_swaths_alone(swept: BathymetricMap) -> None:
    values = LAYERS["density"].compute(LayerSource(swept))
    assert values is not None
    assert np.bincount(values.astype(int).ravel()).tolist() == [12, 900 - 12 - 30, 30]
    assert LAYERS["density"].compute(LayerSource(replace(swept, model="Gaussian process"))) is None


def test_with_cells_by_depth_each_place_is_judged_by_its_own() -> None:
    """One sounding in each square of 4 m; the western half is shoal and asks for 1 m, the eastern half for 4 m."""
    grid = Grid(0.0, 0.0, 1.0, 48, 96)
    places = np.array([(4 * i + 1.5, 4 * j + 2.5) for i in range(24) for j in range(12)])
    hole = (np.abs(places[:, 0] - 78.0) < 10.0) & (np.abs(places[:, 1] - 22.0) < 6.0)
    small = (np.abs(places[:, 0] - 58.0) < 4.0) & (np.abs(places[:, 1] - 22.0) < 4.0)
    density = DensityGrid(grid, np.ones((48, 96), dtype=bool))
    seen = places[~hole & ~small]
    for _ in range(5):
        density.add(seen[:, 0], seen[:, 1], np.where(seen[:, 0] < 48.0, 15.0, 70.0), np.full(len(seen), 0.1))
    bathymetry = gridded_map(density)
    assert bathymetry is not None
    by_one, by_depth = ensonified(bathymetry), ensonified(bathymetry, 0.05)
    assert by_one is not None
    assert by_depth is not None
    assert by_one.ensonified_pct == pytest.approx(100.0 / 16.0, abs=1.0)
    deep = 12 * 12
    missed = int((hole | small).sum())
    share = 50.0 / 16.0 + 50.0 * (deep - missed) / deep
    assert by_depth.ensonified_pct == by_depth.dense_pct == pytest.approx(share, abs=2.0)
    cells = np.array(LAYERS["density"].compute(LayerSource(bathymetry, cell_of_depth=0.05)))
    assert (cells == 2).sum() == pytest.approx(by_depth.dense_pct / 100.0 * cells.size)
    east = [one for one in by_depth.holidays if one.west_m >= 48.0]
    (holiday,) = east
    assert (holiday.area_m2, holiday.cells.all()) == (16.0 * hole.sum(), True), "two cells of 4 m are none"
