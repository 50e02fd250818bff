"""Differences between surveys, their significance, and volumes with deviations, against slow accounts."""

from dataclasses import replace

import numpy as np
import pytest

from app.arrays import BoolArray
from app.mapping.sites import Survey, compare
from app.mapping.types import Grid

GRID = Grid(0.0, 0.0, 2.0, 12, 9)
SHAPE = (GRID.rows, GRID.cols)


def survey(
    rng: np.random.Generator, length_m: float = 0.0, shared_sd_m: float = 0.0, known: float = 0.8, grid: Grid = GRID
) -> Survey:
    shape = (grid.rows, grid.cols)
    depth = np.where(rng.uniform(size=shape) < known, 10.0 + 0.3 * rng.standard_normal(shape), np.nan)
    sd = np.where(np.isfinite(depth), rng.uniform(0.1, 0.3, shape), np.nan)
    return Survey(grid, depth, sd, np.isfinite(depth), 0.0, shared_sd_m, length_m)


def slow_variance(one: Survey, of: BoolArray) -> float:
    """Of the sum of depths: every pair of cells."""
    sd, at = one.sd_m[of], one.grid.centres_m[of.ravel()]
    apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
    alike = np.exp(-0.5 * (apart / one.correlation_length_m) ** 2) if one.correlation_length_m else apart == 0.0
    return float(sd @ alike @ sd) + (one.shared_sd_m * of.sum()) ** 2


@pytest.mark.parametrize("length_m", [0.0, 3.0, 7.0])
def test_volumes_and_their_deviations_are_those_of_every_pair_of_cells(length_m: float) -> None:
    rng = np.random.default_rng(4)
    earlier, later = survey(rng, length_m, 0.05), survey(rng, 1.5 * length_m, 0.1)
    change = compare(earlier, later, 0.9)
    both = np.isfinite(earlier.depth_m) & np.isfinite(later.depth_m)
    np.testing.assert_array_equal(change.compared, both)
    gained = lost = net = 0.0
    for row, col in zip(*np.nonzero(both), strict=True):
        d = later.depth_m[row, col] - earlier.depth_m[row, col]
        sd = np.sqrt(earlier.sd_m[row, col] ** 2 + later.sd_m[row, col] ** 2 + 0.05**2 + 0.1**2)
        assert change.significance[row, col] == pytest.approx(abs(d) / sd)
        assert change.significant[row, col] == (abs(d) > 1.6448536 * sd)
        net -= 4.0 * d
        gained -= 4.0 * min(d, 0.0) * change.significant[row, col]
        lost += 4.0 * max(d, 0.0) * change.significant[row, col]
    assert 0 < change.significant.sum() < both.sum()
    assert (change.gained.m3, change.lost.m3, change.net.m3) == (
        pytest.approx(gained), pytest.approx(lost), pytest.approx(net),
    )  # fmt: skip
    down = change.significant & (change.difference_m > 0.0)
    for volume, of in ((change.net, both), (change.lost, down)):
        variance = 16.0 * (slow_variance(earlier, of) + slow_variance(later, of))
        assert volume.sd_m3 == pytest.approx(np.sqrt(variance), rel=1e-3)


def test_errors_that_reach_over_many_cells_are_summed_by_blocks_closely_enough() -> None:
    rng = np.random.default_rng(1)
    grid = Grid(0.0, 0.0, 1.0, 45, 50)
    one = survey(rng, 19.0, grid=grid)
    change = compare(one, replace(one, sd_m=np.zeros_like(one.sd_m)))
    assert change.net.sd_m3 == pytest.approx(np.sqrt(slow_variance(one, change.compared)), rel=0.01)


def test_a_pit_is_lost_ground_and_a_heap_gained() -> None:
    flat = Survey(GRID, np.full(SHAPE, 10.0), np.full(SHAPE, 0.05), np.ones(SHAPE, bool), 0.0)
    depth = flat.depth_m.copy()
    depth[2:4, 2:5], depth[8, 1:3] = 11.0, 9.5
    change = compare(flat, replace(flat, depth_m=depth))
    assert (change.lost.m3, change.gained.m3, change.net.m3) == (
        pytest.approx(24),
        pytest.approx(4),
        pytest.approx(-20),
    )
    assert change.significant.sum() == 8
    back = compare(replace(flat, depth_m=depth), flat)
    assert (back.lost.m3, back.gained.m3) == (pytest.approx(4), pytest.approx(24))


@pytest.mark.parametrize("confidence", [0.68, 0.95, 0.99])
def test_unchanged_ground_is_called_changed_as_often_as_chance_says(confidence: float) -> None:
    rng = np.random.default_rng(7)
    grid = Grid(0.0, 0.0, 1.0, 200, 200)
    floor = 10.0 + rng.standard_normal((200, 200))

    def surveyed() -> Survey:
        sd = rng.uniform(0.05, 0.4, floor.shape)
        return Survey(grid, floor + sd * rng.standard_normal(floor.shape), sd, np.ones_like(floor, bool), 0.0)

    change = compare(surveyed(), surveyed(), confidence)
    assert change.significant_pct == pytest.approx(100.0 * (1.0 - confidence), rel=0.1)


def test_nothing_in_common_is_nothing_changed() -> None:
    nothing = Survey(GRID, np.full(SHAPE, np.nan), np.full(SHAPE, np.nan), np.zeros(SHAPE, bool), 0.0, 0.1, 4.0)
    change = compare(nothing, survey(np.random.default_rng(0)))
    assert (change.net.m3, change.net.sd_m3, change.significant_pct) == (0.0, 0.0, 0.0)


def test_what_cannot_be_compared_is_refused() -> None:
    one = survey(np.random.default_rng(0))
    with pytest.raises(ValueError, match="resample one first"):
        compare(one, replace(one, grid=replace(GRID, west_m=1.0)))
    with pytest.raises(ValueError, match="within"):
        compare(one, one, 1.0)
