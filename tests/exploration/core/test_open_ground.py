"""Ways round shoals, held against plain walks over the cells that they lead through."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.open_ground import OpenGround

SIDE_M, CELL_M, STEP_M = 80.0, 2.0, 20.0
AREA = np.array([[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]])
LIMITS = Constraints(AREA, max_step_m=STEP_M, min_altitude_m=1.0)
LINES = np.array([[x, y] for k, x in enumerate((10.0, 30.0, 50.0, 70.0)) for y in ((4.0, 76.0), (76.0, 4.0))[k % 2]])


def floor(*shoals: tuple[float, float, float], depth_m: float = 6.0) -> Bottom:
    """Flat, with round shoals at (east, north) of so many metres of radius, 0.5 m deep."""
    middle = np.arange(CELL_M / 2, SIDE_M, CELL_M)
    east, north = np.meshgrid(middle, middle)
    deep = np.full(east.shape, depth_m)
    for x, y, radius in shoals:
        deep[np.hypot(east - x, north - y) < radius] = 0.5
    return Bottom(0.0, 0.0, CELL_M, deep)


def shoal_on(way: FloatArray, bottom: Bottom) -> bool:
    """Whether a way leads over a cell that is too shoal, looked at every decimetre."""
    for a, b in pairwise(way):
        for part in np.linspace(0.0, 1.0, 2 + int(np.hypot(*(b - a)) / 0.1)):
            east, north = a + part * (b - a)
            row, col = int(north // CELL_M), int(east // CELL_M)
            if 0 <= row < len(bottom.depth_m) and 0 <= col < len(bottom.depth_m) and bottom.depth_m[row, col] < 1.0:
                return True
    return False


places = st.floats(5.0, 75.0)
shoals = st.lists(st.tuples(places, places, st.floats(3.0, 14.0)), min_size=1, max_size=4)


@settings(deadline=None, max_examples=150)
@given(shoals, st.integers(0, 7), st.floats(0.0, 0.9))
def test_a_way_round_leads_over_open_ground_to_where_the_plan_is_open_again(
    blobs: list[tuple[float, float, float]], line: int, part: float
) -> None:
    bottom = floor(*blobs)
    before, ahead = LINES[line], LINES[line + 1 :] if line < 7 else LINES[7:]
    here = before + part * (ahead[0] - before)
    if shoal_on(np.array([here, here]), bottom):
        return
    found = OpenGround(bottom, LIMITS).way_round(here, ahead, STEP_M)
    plan = LineString([here, *ahead]) if not np.array_equal(here, ahead[0]) or len(ahead) > 1 else None
    if found is None:
        within = [np.array(plan.interpolate(m).coords[0]) for m in np.arange(0.0, STEP_M - 1.0, 0.5)] if plan else []
        assert not within or not shoal_on(np.array(within), bottom)
        return
    assert plan is not None
    way = np.vstack([here, found.corners_m])
    # It sets out from the middle of a cell where its own is beside a shoal.
    assert not shoal_on(way, bottom)
    if found.passed == len(ahead):
        assert len(found.corners_m) <= 1
        return
    taken_up = found.corners_m[-1]
    onward = LineString([here if found.passed == 0 else ahead[found.passed - 1], ahead[found.passed]])
    assert onward.distance(Point(taken_up)) < 1e-6
    rest = LineString([taken_up, *ahead[found.passed :]])
    next_m = np.array([np.array(rest.interpolate(m).coords[0]) for m in np.linspace(0.0, min(9.0, rest.length), 40)])
    assert not shoal_on(next_m, bottom)


def test_who_comes_to_a_shoal_on_its_line_flies_up_to_it_and_takes_the_line_up_behind_it() -> None:
    bottom = floor((10.0, 40.0, 8.0))
    found = OpenGround(bottom, LIMITS).way_round(np.array([10.0, 20.0]), LINES[1:], STEP_M)
    assert found is not None
    assert found.passed == 0
    upto, *_, again = found.corners_m
    assert upto[0] == again[0] == 10.0
    assert 26.0 < upto[1] < 32.0
    assert 48.0 < again[1] < 54.0


def test_who_comes_to_a_shoal_flies_its_corners_before_it_as_planned() -> None:
    """The corner was cut, over ground that nobody had looked at."""
    plan = np.array([[20.0, 30.0], [50.0, 30.0], [50.0, 76.0]])
    found = OpenGround(floor((50.0, 52.0, 5.0)), LIMITS).way_round(np.array([20.0, 26.0]), plan, 70.0)
    assert found is not None
    np.testing.assert_array_equal(found.corners_m[:2], plan[:2])
    assert found.corners_m[2][0] == 50.0
    assert found.passed == 2


def test_where_the_rest_of_the_plan_is_over_shoals_it_is_left_out() -> None:
    bottom = floor((70.0, 40.0, 9.0), (70.0, 15.0, 30.0))
    found = OpenGround(bottom, LIMITS).way_round(np.array([70.0, 56.0]), LINES[7:], STEP_M)
    assert found is not None
    assert found.passed == 1
    assert len(found.corners_m) <= 1


def test_a_shoal_farther_than_a_step_or_beside_the_plan_is_none_yet() -> None:
    assert OpenGround(floor((10.0, 60.0, 8.0)), LIMITS).way_round(np.array([10.0, 20.0]), LINES[1:], STEP_M) is None
    assert OpenGround(floor((20.0, 30.0, 6.0)), LIMITS).way_round(np.array([10.0, 20.0]), LINES[1:], STEP_M) is None
    assert OpenGround(Bottom.unknown(), LIMITS).way_round(np.array([10.0, 20.0]), LINES[1:], STEP_M) is None


@pytest.mark.parametrize(
    ("place", "least_m2", "cut_off"),
    [
        ((40.0, 40.0), 400.0, True),
        ((40.0, 40.0), 50.0, False),
        ((40.0, 40.0), 1e6, True),
        ((40.0, 48.0), 50.0, True),
        ((70.0, 70.0), 1e6, False),
        ((-5.0, 40.0), 1e6, False),
    ],
    ids=["in a pond", "in a lagoon", "in one beside the sea", "on a shoal", "in the largest part", "outside"],
)
def test_who_is_on_a_shoal_or_in_a_pond_is_cut_off(place: tuple[float, float], least_m2: float, cut_off: bool) -> None:
    ring = floor((40.0, 40.0, 12.0))
    middle = np.arange(CELL_M / 2, SIDE_M, CELL_M)
    ring.depth_m[np.hypot(middle[:, None] - 40.0, middle[None] - 40.0) < 6.0] = 3.0
    assert OpenGround(ring, LIMITS).is_cut_off(np.array(place), least_m2) is cut_off


def test_where_everything_is_too_shoal_nobody_is_cut_off() -> None:
    assert not OpenGround(floor(depth_m=0.4), LIMITS).is_cut_off(np.array([40.0, 40.0]), 100.0)


def test_who_is_behind_a_zone_is_not_cut_off_by_shoals() -> None:
    wall = np.array([[20.0, -1.0], [24.0, -1.0], [24.0, 81.0], [20.0, 81.0]])
    ground = OpenGround(floor((60.0, 40.0, 9.0)), Constraints(AREA, (wall,), max_step_m=STEP_M, min_altitude_m=1.0))
    assert not ground.is_cut_off(np.array([10.0, 40.0]), 1e6)
    assert not ground.largest_part(np.array([10.0, 40.0]))[:, 13:].any()
    assert not ground.largest_part(np.array([40.0, 10.0]))[:, :10].any()


def test_a_part_that_is_not_much_smaller_than_the_largest_is_surveyed_to_its_end() -> None:
    ridge = floor()
    ridge.depth_m[:, 14:16] = 0.5
    assert not OpenGround(ridge, LIMITS).is_cut_off(np.array([10.0, 40.0]), 1e6)
