from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, Limit, inside_area

L_SHAPE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 40.0], [40.0, 40.0], [40.0, 100.0], [0.0, 100.0]])
ZONE = np.array([[10.0, 10.0], [30.0, 12.0], [28.0, 30.0], [12.0, 28.0]])
coordinate = st.floats(-20.0, 120.0)
point = st.tuples(coordinate, coordinate)


def limits_broken(constraints: Any, origin: Any, target: Any, bottom: Any = None) -> Any:
    names = tuple("abcdef"[: len(origin)])
    found = constraints.violations(names, np.array(origin, float), np.array(target, float), bottom)
    return {(v.vehicle, v.limit) for v in found}


@given(start=point, end=point)
@settings(max_examples=200, deadline=None)
def test_area_and_keep_out_agree_with_shapely(start: Any, end: Any) -> None:
    area, zone = Polygon(L_SHAPE), Polygon(ZONE)
    leg = LineString([start, end])
    free = area.difference(zone)
    if not free.buffer(-0.01).contains(Point(start)):
        return
    # Only clear cases: legs that graze a corner within a centimetre may be judged either way.
    if free.buffer(-0.01).contains(leg):
        expected = True
    elif leg.difference(free.buffer(0.01)).length > 25.0 or not free.buffer(0.01).contains(Point(end)):
        expected = False
    else:
        return
    constraints = Constraints(L_SHAPE, (ZONE,), max_step_m=1000.0)
    origin, target = np.array([[*start, 1.0]]), np.array([[[*end, 1.0]]])
    assert constraints.feasible(origin, target)[0] == expected


part = st.floats(0.02, 0.98)


@given(
    notch=st.tuples(st.floats(5.0, 90.0), st.floats(20.0, 80.0), st.floats(0.05, 2.0)),
    west_of_it=st.tuples(part, st.floats(0.0, 1.0)),
    east_of_it=st.tuples(part, st.floats(0.0, 1.0)),
)
@settings(max_examples=200, deadline=None)
def test_no_leg_crosses_a_notch_of_the_area_however_narrow_it_is(
    notch: tuple[float, float, float], west_of_it: tuple[float, float], east_of_it: tuple[float, float]
) -> None:
    """Legs were looked at in seven places, and crossed what lay between these."""
    south, west, width = notch
    east = west + width
    corners = [(0, 0), (100, 0), (100, 100), (east, 100), (east, south), (west, south), (west, 100), (0, 100)]
    start = np.array([west_of_it[0] * west, 99.0 * west_of_it[1] + 0.5, 1.0])
    end = np.array([east + east_of_it[0] * (100.0 - east), 99.0 * east_of_it[1] + 0.5, 1.0])
    leg, area = LineString([start[:2], end[:2]]), Polygon(corners)
    if (leg.difference(area).length > 0.0) != (leg.difference(area.buffer(0.01)).length > 0.0):
        return  # it grazes a corner
    constraints = Constraints(np.array(corners, dtype=float), max_step_m=1000.0)
    assert constraints.feasible(start[None], end[None, None])[0] == area.covers(leg)


@pytest.mark.parametrize(
    ("target", "limit"),
    [
        ([50.0, 20.0, 3.0], Limit.STEP),
        ([22.0, 20.0, 0.5], Limit.MIN_DEPTH),
        ([22.0, 20.0, 9.0], Limit.MAX_DEPTH),
        ([-1.0, 20.0, 3.0], Limit.AREA),
        ([22.0, 20.0, 7.5], Limit.ALTITUDE),
    ],
    ids=lambda x: x.name if isinstance(x, Limit) else "",
)
def test_each_limit_is_named_with_the_vehicle(target: Any, limit: Any, square: FloatArray) -> None:
    bottom = Bottom(0.0, 0.0, 10.0, np.full((10, 10), 8.0))
    constraints = Constraints(square, max_step_m=20.0, min_depth_m=1.0, max_depth_m=8.5, min_altitude_m=1.0)
    origin = np.array([[15.0, 20.0, 3.0]])
    broken = limits_broken(constraints, origin, [target], bottom)
    assert ("a", limit) in broken
    assert not constraints.feasible(origin, np.array([[target]]), bottom)[0]


def test_reasons_tell_value_and_limit(square: FloatArray) -> None:
    constraints = Constraints(square, max_step_m=5.0)
    violation = constraints.violations(("lauv-1",), np.array([[50.0, 50, 2]]), np.array([[62.0, 50, 2]]))[0]
    assert str(violation) == "lauv-1: step of 12.00 m is longer than 5 m"
    assert violation.value_m == pytest.approx(12.0)


def test_a_single_vehicle_needs_no_communication(square: FloatArray) -> None:
    constraints = Constraints(square, com_range_m=1.0)
    assert constraints.feasible(np.array([[50.0, 50, 2]]), np.array([[[51.0, 50, 2]]]))[0]


def test_every_vehicle_needs_another_in_range(square: FloatArray) -> None:
    constraints = Constraints(square, com_range_m=8.0, max_step_m=50.0)
    origin = np.array([[50.0, 50, 2], [55.0, 50, 2], [60.0, 50, 2]])
    chain, torn = origin.copy(), origin.copy()
    chain[2, 0], torn[2, 0] = 62.0, 64.0
    assert constraints.feasible(origin, np.stack([chain, torn])).tolist() == [True, False]
    assert limits_broken(constraints, origin, torn) == {("c", Limit.COM_RANGE)}


def test_vehicles_may_not_pass_each_other_too_closely(square: FloatArray) -> None:
    constraints = Constraints(square, max_step_m=30.0, min_separation_m=4.0, min_vertical_separation_m=3.0)
    origin = np.array([[40.0, 50, 2], [60.0, 50, 2]])
    swapped = origin[::-1]
    assert limits_broken(constraints, origin, swapped) == {("a", Limit.SEPARATION), ("b", Limit.SEPARATION)}
    apart = origin + np.array([[0, 0, 0], [0, 0, 4.0]])
    assert limits_broken(constraints, apart, apart[::-1] * [1, 1, 0] + apart * [0, 0, 1]) == set()


def test_a_broken_limit_may_only_get_better(square: FloatArray) -> None:
    constraints = Constraints(square, max_step_m=10.0)
    outside = np.array([[-30.0, 50.0, 2.0]])
    back, further = np.array([[-21.0, 50.0, 2.0]]), np.array([[-31.0, 50.0, 2.0]])
    assert constraints.feasible(outside, np.stack([back, further, outside])).tolist() == [True, False, False]


def test_the_bottom_is_watched_along_the_whole_leg(square: FloatArray) -> None:
    depth = np.full((10, 10), 10.0)
    depth[5, 5] = 2.5
    ridge = Bottom(0.0, 0.0, 10.0, depth)
    constraints = Constraints(square, max_step_m=40.0, min_altitude_m=1.0)
    origin, over = np.array([[40.0, 55.0, 2.0]]), np.array([[70.0, 55.0, 2.0]])
    assert limits_broken(constraints, origin, over, ridge) == {("a", Limit.ALTITUDE)}
    assert limits_broken(constraints, origin, over, Bottom.unknown()) == set()


def test_bottom_from_landmarks_is_the_closest_known_depth() -> None:
    axis = np.arange(0.5, 20.0)
    east, north = np.meshgrid(axis, axis)
    xy = np.column_stack([east.ravel(), north.ravel()])
    depth = xy[:, 0] + 100.0 * xy[:, 1]
    bottom = Bottom.from_landmarks(xy, depth)
    at = bottom.at(xy)
    assert np.nanmax(np.abs(at - depth)) <= 101.0 * bottom.cell_m
    assert np.isnan(bottom.at(np.array([500.0, 0.0])))


def test_points_inside_area_match_shapely() -> None:
    points = np.random.default_rng(0).uniform(-10, 110, (400, 2))
    free = Polygon(L_SHAPE).difference(Polygon(ZONE))
    expected = [free.contains(Point(p)) for p in points]
    assert inside_area(Constraints(L_SHAPE, (ZONE,)), points).tolist() == expected
