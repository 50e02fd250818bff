"""Which legs make a line, and what is left of a route after one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, Polygon

from app.exploration.lines.dense_lines import dense_lines
from app.exploration.lines.flown_lines import after_line, flown_lines, length_m, line_near, line_now

UP_AND_DOWN = np.array([[0, 0], [0, 20], [0, 40], [10, 40], [10, 20], [10, 0], [20, 0], [20, 20]], dtype=float)


def test_legs_in_one_direction_are_a_line() -> None:
    lines = flown_lines(UP_AND_DOWN)
    assert [line[[0, -1]].tolist() for line in lines] == [
        [[0, 0], [0, 40]],
        [[0, 40], [10, 40]],
        [[10, 40], [10, 0]],
        [[10, 0], [20, 0]],
        [[20, 0], [20, 20]],
    ]
    assert flown_lines(np.zeros((0, 2))) == []
    assert flown_lines(np.zeros((3, 2))) == []


def test_a_way_to_the_next_line_is_no_line() -> None:
    now = line_now(flown_lines(UP_AND_DOWN[:4]))
    assert now is not None
    assert now.tolist() == [[0, 0], [0, 20], [0, 40]]
    now = line_now(flown_lines(UP_AND_DOWN[:5]))
    assert now is not None
    assert now.tolist() == [[10, 40], [10, 20]]
    near = line_near(flown_lines(UP_AND_DOWN), np.array([1.0, 30.0]))
    assert near is not None
    assert near[-1].tolist() == [0, 40]


@pytest.mark.parametrize("north", [5.0, 38.0])
def test_what_is_left_of_a_route_begins_with_the_next_line(north: float) -> None:
    route = np.array([[0, 20], [0, 40], [10, 40], [10, 0]], dtype=float)
    here = np.array([0.0, north])
    rest = after_line(np.zeros(2), here, route[int(north > 20.0) :])
    assert rest is not None
    assert rest.tolist() == [[10, 40], [10, 0]]


def test_on_the_way_to_a_line_that_line_is_left_out() -> None:
    rest = after_line(np.array([0.0, 40.0]), np.array([4.0, 40.0]), np.array([[10, 40], [10, 0], [20, 0]], dtype=float))
    assert rest is not None
    assert rest.tolist() == [[20, 0]]
    assert after_line(np.zeros(2), np.zeros(2), np.zeros((0, 2))) is None


@given(st.integers(0, 2**32 - 1), st.floats(2.0, 15.0))
def test_denser_lines_lie_in_the_part_and_clear_of_zones_and_no_place_is_far_from_one(
    seed: int, spacing_m: float
) -> None:
    rng = np.random.default_rng(seed)
    part = Polygon(rng.uniform(0.0, 60.0, (6, 2))).convex_hull
    assert isinstance(part, Polygon)
    free = Polygon([(0, 0), (50, 0), (50, 60), (0, 60)]).difference(Polygon(rng.uniform(10, 40, (4, 2))).convex_hull)
    ends = dense_lines(part, free, spacing_m, np.zeros(2))
    lines = [LineString(pair) for pair in ends.reshape(-1, 2, 2)]
    here = part.intersection(free)
    assert all(here.buffer(1e-6).covers(line) for line in lines)
    assert length_m(ends) > 0.0
    # What lies between lines is within half their distance; ends too short for a line are left out.
    seen = sum((line.buffer(0.51 * spacing_m).intersection(here).area for line in lines), 0.0)
    assert seen > 0.8 * here.area


def test_what_cannot_be_flown_denser_is_told() -> None:
    square = Polygon([(0, 0), (10, 0), (10, 10), (0, 10)])
    with pytest.raises(ValueError, match="inside the area"):
        dense_lines(square, Polygon([(20, 0), (30, 0), (30, 10)]), 5.0, np.zeros(2))
    with pytest.raises(ValueError, match="lines are more than"):
        dense_lines(square, square, 0.01, np.zeros(2))
