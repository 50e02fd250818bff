"""Ways round keep-out zones."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Polygon

from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.geometry import enters

AREA = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 80.0], [60.0, 80.0], [60.0, 60.0], [40.0, 60.0], [0.0, 80.0]])
ZONES = (
    np.array([[30.0, 20.0], [50.0, 20.0], [50.0, 45.0], [30.0, 45.0]]),
    np.array([[65.0, 10.0], [80.0, 30.0], [62.0, 50.0]]),
)
SPACE = FreeSpace(Constraints(area=AREA, keep_out=ZONES), 0.0)
FREE = Polygon(AREA).difference(Polygon(ZONES[0])).difference(Polygon(ZONES[1])).buffer(1e-6)
PLACES = st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 80.0))


def length_m(start: np.ndarray, way: np.ndarray) -> float:
    return float(np.hypot(*np.diff(np.vstack([start, way]), axis=0).T).sum())


def shortest_m(start: np.ndarray, goal: np.ndarray) -> float:
    """By Dijkstra over all corners and both ends, anew for each question."""
    nodes = np.vstack([*ZONES, AREA, start, goal])
    links = np.zeros((len(nodes), len(nodes)))
    for i, a in enumerate(nodes):
        for k, b in enumerate(nodes[:i]):
            if FREE.covers(LineString([a, b])):
                links[i, k] = links[k, i] = max(float(np.hypot(*(a - b))), 1e-9)
    return float(dijkstra(csr_matrix(links))[-2, -1])


@given(PLACES, PLACES)
def test_a_way_is_free_and_as_short_as_any(start: tuple[float, float], goal: tuple[float, float]) -> None:
    a, b = (SPACE.nearest(np.array(place)) for place in (start, goal))
    way = SPACE.way(a, b)
    np.testing.assert_allclose(way[-1], b, atol=1e-9)
    for leg in pairwise(np.vstack([a, way])):
        assert FREE.covers(LineString(leg))
    assert abs(length_m(a, way) - shortest_m(a, b)) < 1e-5


@given(PLACES, PLACES, st.floats(1e-3, 0.5))
def test_a_corner_that_a_way_leads_to_first_is_not_where_it_begins(
    start: tuple[float, float], goal: tuple[float, float], still_m: float
) -> None:
    a, b = np.array(start), SPACE.nearest(np.array(goal))
    corner = SPACE.corner(a, b, still_m)
    assert SPACE.holds(corner)
    assert np.hypot(*(corner - a)) > still_m or np.array_equal(corner, b)


@pytest.mark.parametrize("inside_m", [0.001, 0.04])
def test_who_is_a_little_too_near_to_a_zone_goes_straight_away_from_it(inside_m: float) -> None:
    corner = SPACE.corner(np.array([49.0, 45.0 - inside_m]), np.array([55.0, 30.0]), 0.05)
    np.testing.assert_allclose(corner, [49.0, 46.0], atol=1e-6)


@pytest.mark.parametrize("before_m", [0.001, 0.04])
@pytest.mark.parametrize(
    ("start", "to", "goal"),
    [
        ((50.0, 45.0), (0.0, -1.0), (35.0, 46.0)),
        ((60.0, 60.0), (0.0, 1.0), (41.0, 60.0)),
    ],
)
def test_who_is_a_little_before_a_corner_gets_round_it(
    start: tuple[float, float], to: tuple[float, float], goal: tuple[float, float], before_m: float
) -> None:
    limits = Constraints(area=AREA, keep_out=ZONES, max_step_m=100.0)
    here = np.array(start) + before_m * np.array(to)
    for _ in range(3):
        corner = SPACE.corner(here, np.array(goal), 0.05)
        assert limits.feasible(np.array([[*here, 0.0]]), np.array([[[*corner, 0.0]]])).all()
        here = corner
    np.testing.assert_allclose(here, goal)


def test_legs_are_the_ways_from_stop_to_stop() -> None:
    stops = np.array([[5.0, 30.0], [55.0, 30.0], [90.0, 30.0], [5.0, 5.0]])
    legs = SPACE.legs(stops)
    for (start, goal), leg in zip(pairwise(stops), legs, strict=True):
        np.testing.assert_allclose(leg, SPACE.way(start, goal))
    np.testing.assert_allclose(SPACE.connect(stops[0], stops[1:]), np.vstack(legs))
    assert SPACE.legs(stops[:1]) == []


@given(st.floats(0.0, 1.0), st.floats(-0.5e-6, 0.5e-6), st.floats(0.05, 3.09), st.floats(1.0, 20.0))
def test_who_is_on_the_border_of_a_zone_but_for_rounding_may_leave_it_and_may_not_enter(
    along: float, off_m: float, course_rad: float, leg_m: float
) -> None:
    zone = ZONES[0]
    x, y = 30.0 + 20.0 * along, 45.0 + off_m
    to_x, to_y = leg_m * np.cos(course_rad), leg_m * np.sin(course_rad)
    assert not enters(zone, x, y, x + to_x, y + to_y, 1e-6)
    if 0.05 < along < 0.95 and np.sin(course_rad) > 0.2:
        assert enters(zone, x, y, x + to_x, y - to_y, 1e-6)


def test_a_leg_across_a_zone_enters_it_and_one_beside_it_does_not() -> None:
    zone = ZONES[1]
    assert enters(zone, 60.0, 30.0, 90.0, 30.0, 1e-6)
    assert enters(zone, 65.0, 10.0, 62.0, 50.0, 1e-6) is False
    assert not enters(zone, 90.0, 0.0, 90.0, 60.0, 1e-6)
    assert not enters(zone, 0.0, 0.0, 60.0, 60.0, 1e-6)
