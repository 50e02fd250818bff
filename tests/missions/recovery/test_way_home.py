"""Ways home stay on the ground that is allowed, and are as short as that lets them be."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.missions.recovery.way_home import CORRIDOR_M, WaysHome, homeward_ground, way_time_s

SQUARE = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 200.0], [0.0, 200.0]])


def box(west: float, south: float, east: float, north: float) -> FloatArray:
    return np.array([[west, south], [east, south], [east, north], [west, north]])


def length_m(start: FloatArray, way: FloatArray) -> float:
    return sum(float(np.hypot(*(b - a))) for a, b in pairwise([start, *way]))


places = st.tuples(st.floats(5.0, 195.0), st.floats(5.0, 195.0)).map(np.array)


@settings(deadline=None, max_examples=40)
@given(start=places, home=places, west=st.floats(20, 120), south=st.floats(20, 120), side=st.floats(10, 60))
def test_a_way_keeps_clear_of_a_zone_and_is_hardly_longer_than_around_it(
    start: FloatArray, home: FloatArray, west: float, south: float, side: float
) -> None:
    zone = box(west, south, west + side, south + side)
    constraints = Constraints(SQUARE, (zone,))
    around = Polygon(zone).buffer(1.0)
    if around.contains(Point(start)) or around.contains(Point(home)):
        return
    way = WaysHome(constraints, home).way(start)
    assert way is not None
    np.testing.assert_allclose(way[-1], home)
    assert not LineString(np.vstack([start, way])).intersects(Polygon(zone))
    straight_m = float(np.hypot(*(home - start)))
    assert straight_m - 1e-6 <= length_m(start, way) <= straight_m + 2 * side + 4.0
    if not LineString(np.array([start, home])).intersects(around):
        assert length_m(start, way) == pytest.approx(straight_m, abs=0.1)


def test_home_outside_is_reached_along_a_corridor() -> None:
    home = np.array([100.0, -300.0])
    start = np.array([10.0, 190.0])
    way = WaysHome(Constraints(SQUARE), home).way(start)
    assert way is not None
    free = Polygon(SQUARE).union(LineString(np.array([[100.0, 0.0], home])).buffer(CORRIDOR_M + 1e-6))
    assert free.covers(LineString(np.vstack([start, way])))
    assert homeward_ground(Constraints(SQUARE), np.array([50.0, 50.0])).area is SQUARE


def test_a_wall_across_leaves_no_way() -> None:
    wall = Constraints(SQUARE, (box(-10, 90, 210, 110),))
    assert WaysHome(wall, np.array([100.0, 20.0])).way(np.array([100.0, 150.0])) is None


def test_a_vehicle_outside_comes_in_first() -> None:
    way = WaysHome(Constraints(SQUARE), np.array([150.0, 100.0])).way(np.array([-20.0, 100.0]))
    assert way is not None
    assert way[0][0] == pytest.approx(0.5, abs=0.1)


def test_known_shallows_are_gone_around() -> None:
    depth = np.full((20, 20), 15.0)
    depth[8:12, 0:15] = 0.5
    start, home = np.array([30.0, 180.0]), np.array([30.0, 20.0])
    way = WaysHome(Constraints(SQUARE), home, Bottom(0.0, 0.0, 10.0, depth), least_m=1.5).way(start)
    assert way is not None
    assert not LineString(np.vstack([start, way])).intersects(Polygon(box(0, 80, 150, 120)))


@given(course=st.floats(0, 2 * math.pi), current=st.floats(0, 0.9))
def test_a_current_never_helps(course: float, current: float) -> None:
    start, way = np.zeros(2), np.array([[0.0, 100.0]])
    still_s = way_time_s(start, way, 1.0, (0.0, 0.0))
    time_s = way_time_s(start, way, 1.0, (current * math.sin(course), current * math.cos(course)))
    assert still_s == pytest.approx(100.0)
    assert time_s >= still_s - 1e-9


def test_against_a_current_it_takes_longer_and_at_last_for_ever() -> None:
    start, way = np.zeros(2), np.array([[0.0, 100.0]])
    assert way_time_s(start, way, 1.0, (0.0, -0.5)) == pytest.approx(200.0)
    assert way_time_s(start, way, 1.0, (0.0, 0.5)) == pytest.approx(100.0), "what helps is not counted"
    assert math.isinf(way_time_s(start, way, 1.0, (0.0, -1.0)))
    assert math.isinf(way_time_s(start, way, 1.0, (1.2, 0.0)))
