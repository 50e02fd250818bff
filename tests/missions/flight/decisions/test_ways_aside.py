"""Where vehicles go to let others pass lies inside the area and outside zones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.missions.flight.decisions.separation import ways_aside
from app.missions.safety.room import ways_beside, ways_in

AREA = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
ZONE = np.array([[40.0, 40.0], [60.0, 40.0], [60.0, 60.0], [40.0, 60.0]])
LIMITS = Constraints(AREA, keep_out=(ZONE,), max_step_m=8.0)


def ways_from(east_m: float, north_m: float, *, or_nearer: bool = False) -> np.ndarray:
    target = np.array([east_m - 8.0, north_m, 2.0])
    return ways_aside(np.array([east_m, north_m, 2.0]), target, LIMITS, Bottom.unknown(), or_nearer=or_nearer)


@pytest.mark.parametrize("outside_m", [0.0, 0.5, 3.0, 6.0])
def test_from_a_little_outside_they_lead_inside(outside_m: float) -> None:
    ways = ways_from(100.0 + outside_m, 50.0)
    assert len(ways)
    assert all(Polygon(AREA).buffer(1e-5).covers(Point(way[:2])) for way in ways)


def test_from_farther_outside_than_a_leg_they_lead_nearer_where_that_will_do() -> None:
    assert not len(ways_from(120.0, 50.0))
    ways = ways_from(120.0, 50.0, or_nearer=True)
    assert len(ways)
    assert all(Polygon(AREA).distance(Point(way[:2])) < 20.0 for way in ways)


@pytest.mark.parametrize("inside_m", [0.0, 0.5, 3.0, 6.0])
def test_from_inside_a_zone_they_lead_out_of_it(inside_m: float) -> None:
    ways = ways_from(60.0 - inside_m, 50.0)
    assert len(ways)
    assert not any(Polygon(ZONE).buffer(-1e-5).contains(Point(way[:2])) for way in ways)


def test_who_comes_from_far_outside_may_come_in_anywhere_that_no_zone_bars() -> None:
    zone = np.array([[102.0, 40.0], [110.0, 40.0], [110.0, 60.0], [102.0, 60.0]])
    limits, place = Constraints(AREA, keep_out=(zone,)), np.array([130.0, 50.0])
    entries = ways_in(limits, place, 1.0)
    assert len(entries) > 10
    assert all(Polygon(AREA).covers(Point(entry)) for entry in entries)
    assert not any(Polygon(zone).intersects(LineString([place, entry])) for entry in entries)
    away_m = [float(np.hypot(*(entry - place))) for entry in entries]
    assert away_m == sorted(away_m)


@given(st.floats(62.0, 110.0), st.floats(-10.0, 110.0), st.floats(5.0, 30.0))
def test_who_waits_outside_may_go_beside_where_it_is_no_farther_outside_and_off_zones(
    east_m: float, north_m: float, reach_m: float
) -> None:
    area, zone = np.array([[0.0, 0.0], [25.0, 0.0], [25.0, 90.0], [0.0, 90.0]]), Polygon(ZONE)
    limits, place = Constraints(area, keep_out=(ZONE,)), np.array([east_m, north_m])
    ways = ways_beside(limits, place, reach_m)
    assert len(ways) >= 2, "one of two that stand beside each other gets away"
    outside_m = Polygon(area).distance(Point(place))
    for way in ways:
        assert np.hypot(*(way - place)) <= reach_m + 1e-9
        assert Polygon(area).distance(Point(way)) <= outside_m + 0.5
        assert not zone.intersects(LineString([place, way]))
