"""Passes over missed ground: short, from where the vehicle is, and they see all of it."""

import numpy as np
import pytest

from app.arrays import BoolArray, FloatArray
from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage
from app.exploration.swath.passes import MOST_TOURED, Pass, pieces, shared, tour
from app.exploration.swath.raster import Flying, LineRaster, raster_of, steepness

FLYING = Flying(SwathSonar(), 2.0, 1.0, 5.0, 0.4)


def missed(*holes: tuple[slice, slice]) -> tuple[LineRaster, BoolArray]:
    done = np.ones((100, 120), dtype=bool)
    for rows, cols in holes:
        done[rows, cols] = False
    raster = raster_of(Coverage(0.0, 0.0, 1.0, np.ones_like(done), done, np.full(done.shape, 12.0)), 0.0, 1.0, 12.0)
    return raster, raster.open


def passes(raster: LineRaster, cells: BoolArray, flying: Flying, pose: FloatArray) -> tuple[list[Pass], BoolArray]:
    """A tour of the missed cells by one vehicle alone."""
    found, wide = pieces(raster, cells, flying, pose[:2])
    return tour(found, pose, flying.radius_m), wide


@pytest.mark.parametrize("heading", [0.0, 1.3, np.nan])
def test_a_pass_sees_the_whole_hole_from_inside_the_area(heading: float) -> None:
    raster, cells = missed((slice(50, 58), slice(60, 66)), (slice(0, 3), slice(20, 40)))
    found, wide = passes(raster, cells, FLYING, np.array([10.0, 10.0, heading]))
    assert len(found) == 2
    assert not wide.any()
    seen = np.any([raster.under(one.path, FLYING) for one in found], axis=0)
    assert (seen | ~cells).all()
    assert all(((one.path > -1.0) & (one.path < [121.0, 101.0])).all() for one in found)


def test_a_hole_ahead_is_passed_without_a_turning_circle() -> None:
    raster, cells = missed((slice(60, 66), slice(58, 62)))
    found, _ = passes(raster, cells, FLYING, np.array([60.0, 20.0, 0.0]))
    assert found[0].way_m < 50.0


def test_the_nearest_hole_comes_first() -> None:
    raster, cells = missed((slice(80, 84), slice(100, 104)), (slice(20, 24), slice(20, 24)))
    found, _ = passes(raster, cells, FLYING, np.array([10.0, 10.0, np.nan]))
    assert found[0].way_m < found[1].way_m
    assert (found[0].path < 40.0).all()


def test_holes_in_a_row_are_passed_on_one_straight_way() -> None:
    raster, cells = missed(*[(slice(48, 52), slice(at, at + 3)) for at in (20, 40, 60, 80)])
    found, _ = passes(raster, cells, FLYING, np.array([5.0, 50.0, np.pi / 2]))
    corners = np.vstack([np.array([[5.0, 50.0]]), *[one.path for one in found]])
    assert len(found) == 4 <= MOST_TOURED
    assert float(np.hypot(*np.diff(corners, axis=0).T).sum()) < 85.0


def test_each_hole_goes_to_who_has_the_shortest_way_and_none_twice() -> None:
    raster, cells = missed(
        (slice(10, 13), slice(10, 13)), (slice(12, 15), slice(30, 33)), (slice(80, 83), slice(100, 103))
    )
    found, _ = pieces(raster, cells, FLYING, np.array([0.0, 0.0]))
    starts = {"west": np.array([5.0, 5.0]), "east": np.array([110.0, 60.0])}
    shares = shared(found, starts, {"west": 0.0, "east": 0.0})
    assert [len(shares["west"]), len(shares["east"])] == [2, 1]
    assert shares["west"][0].middle_m[0] < shares["west"][1].middle_m[0], "the nearer one first"
    busy = shared(found, starts, {"west": 0.0, "east": 900.0})
    assert [len(busy["west"]), len(busy["east"])] == [3, 0], "who is busy is not waited for"


def test_ground_too_wide_for_one_pass_is_left_to_lines() -> None:
    raster, cells = missed((slice(10, 90), slice(10, 110)))
    found, wide = passes(raster, cells, FLYING, np.array([5.0, 5.0, 0.0]))
    assert not found
    assert np.array_equal(wide, cells)


def sloping(rise: float) -> Coverage:
    wanted = np.ones((60, 80), dtype=bool)
    return Coverage(0.0, 0.0, 1.0, wanted, ~wanted, 12.0 + rise * np.arange(80.0) + np.zeros((60, 1)))


@pytest.mark.parametrize("rise", [0.0, 0.02, 0.2])
def test_steepness_is_what_the_ground_rises(rise: float) -> None:
    assert steepness(sloping(rise)) == pytest.approx(rise, abs=1e-9)


def test_nothing_is_said_of_the_steepness_of_unknown_ground() -> None:
    coverage = sloping(0.0)
    coverage.depth_m[:] = np.nan
    assert steepness(coverage) == np.inf
