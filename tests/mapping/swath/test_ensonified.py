"""What a map of swaths says of its survey, alone and together with what was known before."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from app.mapping.coordinates.outlines import outlines
from app.mapping.gaussian_process.fusion import fuse, prior_map
from app.mapping.layers import LAYERS, LayerSource
from app.mapping.swath.density import LEAST_SOUNDINGS, DensityGrid
from app.mapping.swath.ensonified import Ensonified, ensonified
from app.mapping.swath.gridded import gridded_map
from app.mapping.swath.holidays import missed
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


def all_but(unseen: np.ndarray, area: np.ndarray | None = None, times: int = LEAST_SOUNDINGS) -> Ensonified:
    """How far a survey has come that saw every cell but these."""
    grid = Grid(0.0, 0.0, 1.0, *unseen.shape)
    density = DensityGrid(grid, np.ones(unseen.shape, dtype=bool) if area is None else area)
    places = np.repeat(grid.centres_m[~unseen.ravel()], times, axis=0)
    density.add(places[:, 0], places[:, 1], np.full(len(places), 10.0), np.full(len(places), 0.1))
    made = gridded_map(density)
    assert made is not None
    found = ensonified(made)
    assert found is not None
    return found


@pytest.mark.parametrize("side", [3, 9, 14, 15, 20, 40, 90])
def test_what_was_swept_all_around_is_a_holiday_however_large(side: int) -> None:
    unseen = np.zeros((100, 100), dtype=bool)
    unseen[5 : 5 + side, 4 : 4 + side] = True
    found = all_but(unseen)
    assert [holiday.area_m2 for holiday in found.holidays] == [side**2]
    assert not found.full_coverage


@pytest.mark.parametrize("island", [False, True])
def test_only_ground_at_the_border_is_still_ahead(island: bool) -> None:
    """A hole around an island that nobody may enter is one; beside a part of the border that is cut out it is not."""
    unseen, area = np.zeros((100, 100), dtype=bool), np.ones((100, 100), dtype=bool)
    unseen[40:60, 40:60] = unseen[:, 80:] = True
    area[45:55, 45:55] = not island
    if not island:
        area[50, :45] = False
    found = all_but(unseen, area)
    assert len(found.holidays) == island
    if island:
        assert found.holidays[0].area_m2 == 300.0


@given(seed=st.integers(0, 2**32 - 1), holes=st.integers(1, 6), shape=st.tuples(st.integers(8, 40), st.integers(8, 40)))
def test_every_missed_square_is_a_holiday_or_leads_out_of_the_area(
    seed: int, holes: int, shape: tuple[int, int]
) -> None:
    rng = np.random.default_rng(seed)
    unseen, area = np.zeros(shape, dtype=bool), np.ones(shape, dtype=bool)
    barred = ~area
    for cells in [*[unseen] * holes, barred]:
        row, col = (int(rng.integers(0, size - 2)) for size in shape)
        cells[row : row + int(rng.integers(1, 20)), col : col + int(rng.integers(1, 20))] = True
    area = ~barred
    assume(not (unseen | barred).all())
    found = all_but(unseen | barred, area)
    listed = np.zeros(shape, dtype=bool)
    for one in found.holidays:
        row, col = int(one.south_m), int(one.west_m)
        listed[row : row + one.cells.shape[0], col : col + one.cells.shape[1]] |= one.cells
    lost = missed(~unseen, area, 3)
    # Cell by cell, from outside, over what is no swept ground.
    led, rest = {(-1, -1)}, [(-1, -1)]
    while rest:
        row, col = rest.pop()
        for i in range(row - 1, row + 2):
            for j in range(col - 1, col + 2):
                inside = 0 <= i < shape[0] and 0 <= j < shape[1]
                near = -1 <= i <= shape[0] and -1 <= j <= shape[1]
                if (i, j) not in led and near and (not inside or lost[i, j] or not area[i, j]):
                    led.add((i, j))
                    rest.append((i, j))
    for i, j in np.argwhere(lost):
        assert listed[i, j] or (int(i), int(j)) in led
    assert not (listed & ~lost).any()


@pytest.mark.parametrize(
    ("rows", "cols", "full"),
    [
        (slice(None), slice(49, 51), False),
        (slice(None), slice(49, 50), False),
        (slice(None), slice(0, 2), False),
        (slice(99, 100), slice(None), False),
        (slice(10, 12), slice(10, 14), True),
        (slice(10, 11), slice(10, 18), True),
        (slice(10, 11), slice(10, 19), False),
        (slice(0, 100, 6), slice(0, 100, 6), True),
    ],
)
def test_a_strip_without_a_sounding_is_no_full_coverage(rows: slice, cols: slice, full: bool) -> None:
    unseen = np.zeros((100, 100), dtype=bool)
    unseen[rows, cols] = True
    found = all_but(unseen)
    assert found.holidays == ()
    assert found.dense_pct >= 95.0
    assert found.full_coverage is full
