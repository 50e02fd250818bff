"""The chance that something shallower than a depth lies in a cell."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.layers import LAYERS, LayerSource, file_layers
from app.mapping.shoals import rises_m, rock_chance, shoal_chance
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map, without_guesses
from app.mapping.types import BathymetricMap, Grid, Soundings
from benchmarks.mapping.shoals import answers

GRID = Grid(0.0, 0.0, 2.0, 20, 20)


def flat(depth_m: float = 10.0, sd_m: float = 0.5) -> BathymetricMap:
    full, count = np.full((20, 20), depth_m), np.full((20, 20), 5)
    return BathymetricMap(GRID, full, np.full((20, 20), sd_m), count, count > 0, np.ones((20, 20)), 10.0, "flat")


def lines(gap_m: float, length_m: float = 40.0) -> Soundings:
    places = np.meshgrid(np.arange(gap_m / 2.0, 40.0, gap_m), np.arange(0.5, length_m))
    east, north = (one.ravel() for one in places)
    depth = 8.0 + np.sin(east / 6.0) * np.cos(north / 5.0)
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(east))
    return Soundings(east, north, depth + noise, np.full(len(east), 0.05))


@given(st.floats(0.05, 3.0), st.floats(-2.0, 20.0), st.floats(0.0, 5.0))
def test_the_chance_grows_with_the_depth_that_counts_as_shoal(sd_m: float, shoal_depth_m: float, more_m: float) -> None:
    less, more = (shoal_chance(flat(sd_m=sd_m), depth_m) for depth_m in (shoal_depth_m, shoal_depth_m + more_m))
    assert ((less >= 0.0) & (more <= 1.0) & (less <= more)).all()


def test_half_of_flat_ground_at_the_depth_is_shoal_and_of_inclined_ground_more() -> None:
    np.testing.assert_allclose(shoal_chance(flat(), 10.0), 0.5)
    inclined = replace(flat(), depth_m=10.0 + 0.5 * (np.meshgrid(GRID.east_m, GRID.north_m)[0] - 20.0))
    at_ten = shoal_chance(inclined, 10.0)[:, 9:11]
    # Half a cell's rise of a plane: 0.5 m, so a cell whose middle is 0.5 m too deep touches the depth at its edge.
    np.testing.assert_allclose(at_ten[:, 1], 0.5)
    assert (at_ten[:, 0] > 0.5).all()


def test_the_tails_are_heavier_than_normal_ones() -> None:
    five_deviations = shoal_chance(flat(sd_m=1.0), 5.0)
    assert (five_deviations > 1000.0 * 2.9e-7).all()
    assert (five_deviations < 0.01).all()


def test_what_all_soundings_share_and_what_the_ground_does_around_count() -> None:
    calm = shoal_chance(flat(sd_m=0.1), 9.0)
    assert (shoal_chance(flat(sd_m=0.1), 9.0, common_sd_m=0.5) > 5.0 * calm).all()
    depth = np.full((20, 20), 10.0)
    depth[10, 10] = 9.4
    rough = shoal_chance(replace(flat(sd_m=0.1), depth_m=depth), 9.0)
    assert rough[10, 10] > rough[10, 11] > 2.0 * calm[10, 11]
    np.testing.assert_allclose(rough[:8], calm[:8])


def test_where_nothing_supports_a_cell_no_chance_is_told() -> None:
    begun = GaussianProcessMap(reject_outliers=False).fit(lines(40.0, 10.0)).predict(GRID)
    told = shoal_chance(begun, 1.0)
    away = np.hypot(*(axis - middle for axis, middle in zip(GRID.centres_m.T, (20.0, 5.0), strict=True)))
    assert np.isnan(told[away.reshape(20, 20) > 20.0]).all()
    assert np.isfinite(told[1, 9:11]).all()


def test_a_swath_that_was_swept_densely_is_told_from_its_soundings_and_the_rest_is_not_told() -> None:
    density = DensityGrid(GRID, np.ones((20, 20), dtype=bool))
    east, north = np.random.default_rng(0).uniform(0.0, 20.0, (2, 5000))
    rock = np.hypot(east - 11.0, north - 11.0) < 1.0
    density.add(east, north, np.where(rock, 4.0, 10.0), np.full(5000, 0.1))
    swept = gridded_map(density)
    assert swept is not None
    told = shoal_chance(without_guesses(swept), 8.0)
    assert told[5, 5] > 0.5
    assert told[1:3, 1:3].max() < 1e-3
    assert np.isnan(told[14:, 14:]).all()


def test_close_lines_leave_less_room_for_rocks_than_distant_ones() -> None:
    near, far = (GaussianProcessMap(reject_outliers=False).fit(lines(gap_m)).predict(GRID) for gap_m in (4.0, 10.0))
    assert np.nanmean(shoal_chance(near, 6.0)) < 0.8 * np.nanmean(shoal_chance(far, 6.0))


def test_the_layer_is_there_where_the_mission_says_what_is_shoal() -> None:
    assert LAYERS["shoal_pct"].of(LayerSource(flat())) is None
    assert LAYERS["shoal_pct"].absence
    source = LayerSource(flat(), common_sd_m=0.2, shoal_depth_m=9.0)
    (layer,) = (one for one in file_layers(source) if one.name == "shoal_pct")
    np.testing.assert_allclose(layer.values, 100.0 * shoal_chance(source.map, 9.0, 0.2))
    assert layer.unit == "percent"


@pytest.mark.parametrize(
    ("floor", "design"), [("boulders", "lines 10 m"), ("reef", "lines 5 m"), ("harbour", "swaths")]
)
def test_little_chance_is_told_only_where_little_is_shoal(floor: str, design: str) -> None:
    found = answers(floor, design, 11)
    for low, high in ((0.0, 0.01), (0.01, 0.1), (0.1, 0.4)):
        here = (found.chance >= low) & (found.chance < high)
        assert here.sum() > 50
        # Cells next to each other err together: a rock that was missed lies in several.
        assert found.true[here].mean() <= 2.0 * found.chance[here].mean() + 0.002, (low, high)
    sure = found.chance > 0.95
    assert found.true[sure].mean() > 0.9


def test_cells_between_lines_hide_what_sounded_cells_show() -> None:
    sounded = np.zeros((20, 20), dtype=bool)
    sounded[:, ::5] = True
    bare = replace(flat(sd_m=0.05), sounded=sounded, count=sounded.astype(np.int64))
    rocks = np.full((20, 20), 10.0)
    rocks[5, 5] = rocks[13, 10] = 7.0
    rocky = replace(bare, depth_m=rocks)
    calm, warned = (float(shoal_chance(one, 8.0)[18, 7]) for one in (bare, rocky))
    assert calm < 1e-3
    assert warned >= 2 / sounded.sum()
    dense = replace(rocky, count=np.full((20, 20), 5))
    assert shoal_chance(dense, 8.0)[18, 7] == pytest.approx(calm)


def test_higher_rocks_are_rarer_also_beyond_the_highest_that_was_sounded() -> None:
    rises = np.array([-0.2] * 60 + [0.1] * 30 + [1.0, 2.0])
    told = rock_chance(np.array([-1.0, 0.5, 1.0, 2.0, 4.0, 8.0]), rises)
    assert (np.diff(told) <= 0.0).all()
    assert told[3] == pytest.approx(2.0 * 2.0 / 93.0)
    assert told[5] == pytest.approx(told[4] / 8.0)
    assert rock_chance(np.array([1.0]), np.zeros(0)).tolist() == [0.0]
    assert rises_m(replace(flat(), depth_m=np.full((20, 20), np.nan))).size == 0
