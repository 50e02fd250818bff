"""Closest points of approach, held against looking at every tenth of a second."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.missions.traffic.approach import DIVE_S, TimedWay, closest_approach, planned_way

WITHIN_S = 120.0
STEP_S = 0.1

metres = st.floats(-800.0, 800.0)
speeds = st.floats(-12.0, 12.0)
corners = st.lists(st.tuples(metres, metres, st.sampled_from([0.0, 2.0, 12.0])), min_size=1, max_size=4)


def sampled(ship: np.ndarray, velocity: np.ndarray, way: TimedWay, least_m: float) -> float:
    """Return the least distance at sampled times at which the vehicle counts as shallow."""
    best = np.inf
    for now_s in np.arange(0.0, WITHIN_S + 0.5 * STEP_S, STEP_S):
        leg = max(int(np.searchsorted(way.time_s, now_s, side="right")) - 1, 0)
        last = len(way.time_s) - 1
        up_later = way.depth_m[min(leg + 1, last)] < least_m
        diving = way.depth_m[leg] < least_m and now_s - way.time_s[leg] <= DIVE_S
        if not (up_later or diving):
            continue
        place = np.array([np.interp(now_s, way.time_s, way.place_m[:, axis]) for axis in (0, 1)])
        best = min(best, float(np.hypot(*(ship + now_s * velocity - place))))
    return best


@settings(max_examples=40)
@given(ship=st.tuples(metres, metres), velocity=st.tuples(speeds, speeds), ends=corners, speed=st.floats(0.5, 3.0))
def test_no_moment_is_closer_than_what_is_found_and_what_is_found_comes_to_pass(
    ship: tuple[float, float], velocity: tuple[float, float], ends: list[tuple[float, float, float]], speed: float
) -> None:
    (east, north, depth), *rest = ends
    way = planned_way(np.array([east, north]), depth, [(np.array(end[:2]), end[2]) for end in rest], speed)
    ships, velocities = np.array([ship]), np.array([velocity])
    [found], [in_s] = closest_approach(ships, velocities, way, 5.0, WITHIN_S)
    seen = sampled(ships[0], velocities[0], way, 5.0)
    if np.isinf(found):
        assert np.isinf(seen)
        return
    fastest = float(np.hypot(*velocity)) + speed
    assert found <= seen + 1e-6
    # A leg shorter than a step of the slow way may fall between two looks.
    if np.isfinite(seen) and (np.diff(way.time_s) > STEP_S).all():
        assert seen <= found + fastest * STEP_S
    assert 0.0 <= in_s <= WITHIN_S
    place = [np.interp(in_s, way.time_s, way.place_m[:, axis]) for axis in (0, 1)]
    assert np.hypot(*(ships[0] + in_s * velocities[0] - place)) == pytest.approx(found, abs=1e-6)


def test_a_vehicle_that_stays_deep_meets_nobody() -> None:
    way = planned_way(np.zeros(2), 12.0, [(np.array([100.0, 0.0]), 12.0)], 1.0)
    distance, _ = closest_approach(np.zeros((1, 2)), np.zeros((1, 2)), way, 5.0, WITHIN_S)
    assert np.isinf(distance).all()


def test_a_deep_vehicle_meets_a_ship_where_it_will_come_up() -> None:
    ship, velocity = np.array([[50.0, -500.0]]), np.array([[0.0, 5.0]])
    way = planned_way(np.zeros(2), 12.0, [(np.array([50.0, 0.0]), 0.0)], 1.0)
    [distance], [in_s] = closest_approach(ship, velocity, way, 5.0, WITHIN_S)
    assert distance == pytest.approx(0.0, abs=1e-9)
    assert in_s == pytest.approx(100.0)


def test_ships_are_told_apart() -> None:
    ships = np.array([[0.0, 300.0], [400.0, 0.0], [30.0, 40.0]])
    way = planned_way(np.zeros(2), 0.0, [], 0.0)
    distance, in_s = closest_approach(ships, np.zeros((3, 2)), way, 5.0, WITHIN_S)
    assert distance == pytest.approx([300.0, 400.0, 50.0])
    assert in_s == pytest.approx([0.0, 0.0, 0.0])
