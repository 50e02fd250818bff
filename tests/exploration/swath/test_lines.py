"""Lines of a swath survey: smooth, close enough to what was seen, and as far as that allows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import label

from app.arrays import BoolArray, FloatArray
from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage
from app.exploration.swath.lines import LARGE, STEEPEST, STRIP, gentle, lines, strips
from app.exploration.swath.raster import Axes, Flying, raster_of

FLYING = Flying(SwathSonar(), 2.0, 1.0, 5.0, 0.06)


def flat(rows: int, cols: int, depth_m: float | FloatArray = 20.0) -> Coverage:
    depth = np.broadcast_to(np.asarray(depth_m, dtype=np.float64), (rows, cols)).copy()
    return Coverage(0.0, 0.0, 1.0, np.ones((rows, cols), bool), np.zeros((rows, cols), bool), depth)


@given(arrays(np.float64, st.integers(2, 60), elements=st.floats(0.0, 50.0)), st.floats(4.0, 40.0))
def test_a_line_bends_gently_and_hardly_leaves_what_is_allowed(wish: FloatArray, radius_m: float) -> None:
    level = gentle(wish, 1.0, radius_m)
    assert (np.abs(np.diff(level)) <= STEEPEST + 1e-9).all()
    # The mean that rounds tops lifts valleys by a small part of their radius.
    assert (level <= wish + radius_m / 48.0 + 0.1).all()


@given(
    arrays(np.float64, st.integers(1, 80), elements=st.floats(0.0, 50.0) | st.just(np.inf)),
    st.floats(0.3, 5.0),
    st.floats(4.0, 40.0),
)
def test_a_line_is_the_largest_that_bends_so_far(wish: FloatArray, cell_m: float, radius_m: float) -> None:
    wish[0] = 20.0
    bent_m = STEEPEST * radius_m
    level = np.full(len(wish), np.inf)
    for i in range(len(wish)):
        for k in range(len(wish)):
            away_m = cell_m * abs(i - k)
            near = away_m < bent_m
            rise = away_m**2 / (2 * radius_m) if near else STEEPEST * (away_m - bent_m / 2)
            level[i] = min(level[i], wish[k] + rise)
    width = min(2 * int(0.25 * radius_m / cell_m) + 1, 2 * ((len(wish) - 1) // 2) + 1)
    edges = np.pad(level, width // 2, mode="edge")
    smooth = [edges[i : i + width].mean() for i in range(len(level))]
    assert np.allclose(gentle(wish, cell_m, radius_m), smooth)


@given(st.floats(-math.pi, math.pi), st.floats(-100, 100), st.floats(-100, 100))
def test_axes_turn_there_and_back(direction: float, east: float, north: float) -> None:
    axes = Axes(direction)
    place = np.array([east, north])
    assert np.allclose(axes.to_en(axes.turned(place)), place)
    assert np.allclose(np.hypot(*axes.turned(place)), np.hypot(east, north))


def test_the_first_line_sees_the_border_and_the_next_ones_edge() -> None:
    raster = raster_of(flat(100, 200), 0.0, 1.0, 10.0)
    (line,) = lines(raster, raster.open, 1, FLYING)
    half_m = 18.0 * math.tan(math.radians(60.0))
    assert len(line.columns) == 200
    assert np.allclose(line.across_m, half_m * (1 - FLYING.overlap), rtol=0.06)
    assert (line.across_m <= half_m).all()
    raster.open[:] &= ~raster.seen(line.columns, line.across_m, FLYING)
    edge_m = float(raster.across_m[raster.open[100]][0]) - 0.5
    (following,) = lines(raster, raster.open, 1, FLYING)
    assert (following.across_m - edge_m <= half_m).all()
    assert not (raster.open & ~raster.seen(following.columns, following.across_m, FLYING)).any(), "two lines see it all"


def test_lines_follow_the_depth() -> None:
    """Along a line over a slope the swath widens, and so does the distance of the next line."""
    depth = np.tile(np.linspace(8.0, 30.0, 200), (150, 1))
    raster = raster_of(flat(150, 200, depth), 0.0, 1.0, 10.0)
    (line,) = lines(raster, raster.open, 1, FLYING)
    assert line.across_m[-1] > line.across_m[0] + 10.0
    assert raster.seen(line.columns, line.across_m, FLYING)[:, :2].mean() > 0.98, "the border is seen"


def test_a_hole_does_not_hold_back_a_whole_line() -> None:
    coverage = flat(120, 300)
    coverage.done[:60] = True
    coverage.done[40:43, 150:153] = False
    raster = raster_of(coverage, 0.0, 1.0, 10.0)
    large, small = strips(raster, FLYING)
    assert (large.sum(), small.sum()) == (60 * 300, 9)
    together = lines(raster, raster.open, 1, FLYING)
    alone = lines(raster, large, 1, FLYING)
    assert np.allclose(together[0].across_m.max(), alone[0].across_m.max(), atol=1.0), "the hole waits"


@given(
    arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))),
    st.lists(st.floats(4.0, 20.0), min_size=12, max_size=12),
)
def test_strips_are_pieces_wider_than_a_part_of_the_swath_or_large(done: BoolArray, depths_m: list[float]) -> None:
    """As the definition says it, piece by piece."""
    rows, cols = done.shape
    coverage = flat(rows, cols, np.array(depths_m[:cols]))
    coverage.done[:] = done
    raster = raster_of(coverage, 0.0, 1.0, 10.0)
    flying = replace(FLYING, sonar=SwathSonar(math.radians(40.0)))
    swept = np.zeros_like(raster.open)
    number, count = label(raster.open, np.ones((3, 3)))
    for k in range(1, count + 1):
        piece = number == k
        swath_m = 2.0 * np.median(flying.half_width_m(raster.depth_m[piece]))
        swept |= piece & (piece.sum(axis=1).max() > STRIP * swath_m or piece.sum() > LARGE * raster.wanted.sum())
    large, small = strips(raster, flying)
    assert np.array_equal(large, swept)
    assert np.array_equal(small, raster.open & ~swept)


def test_a_line_goes_straight_on_where_little_is_left_beside_it() -> None:
    """Its end is seen in part, all but a scrap on the side that was swept."""
    coverage = flat(150, 200)
    coverage.done[:, 170:] = True
    coverage.done[:8, 170:] = False
    raster = raster_of(coverage, 0.0, 1.0, 10.0)
    (line,) = lines(raster, raster.open, 1, FLYING)
    assert np.ptp(line.across_m) < 1.0


@pytest.mark.parametrize("direction_deg", [15.0, 75.0, 105.0, 165.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_line_ends_where_nothing_open_is_seen_any_more(direction_deg: float, sign: int) -> None:
    raster = raster_of(flat(200, 250, 8.0), math.radians(direction_deg), 1.0, 10.0)
    for line in lines(raster, raster.open, sign, FLYING):
        seen = raster.seen(line.columns, line.across_m, FLYING) & raster.open[line.columns]
        assert seen[[0, -1]].any(axis=1).all()


@pytest.mark.parametrize("factor", [2, 3])
def test_coarser_cells_lose_nothing_that_is_left(factor: int) -> None:
    coverage = flat(50, 41, np.linspace(5.0, 9.0, 41))
    coverage.done[:] = True
    coverage.done[7, 11] = False
    coarse = coverage.coarser(factor)
    assert coarse.left.sum() == 1
    assert coarse.left[7 // factor, 11 // factor]
    assert coarse.cell_m == factor
    assert np.isclose(np.nanmean(coarse.depth_m), 7.0, atol=0.1)
