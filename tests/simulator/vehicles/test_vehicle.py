import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulator.vehicles.vehicle import STEP_S, Guidance, Motion, SteeringTarget, Vehicle, VehicleLimits, wrap

NO_ERROR = (0.0, 0.0)
DEEP = 100.0


def fly(vehicle: Vehicle, seconds: int, bottom: Any = DEEP, error: Any = NO_ERROR) -> list[tuple[float, ...]]:
    """Motions after each step."""
    track: list[tuple[float, ...]] = []
    for _ in range(round(seconds / STEP_S)):
        vehicle.step(error, bottom)
        m = vehicle.motion
        track.append((m.east_m, m.north_m, m.depth_m, m.heading_rad, m.pitch_rad, m.surge_mps))
    return track


def distance(vehicle: Vehicle, target: SteeringTarget) -> float:
    return math.hypot(vehicle.motion.east_m - target.east_m, vehicle.motion.north_m - target.north_m)


@settings(max_examples=40, deadline=None)
@given(
    east=st.floats(-80, 80),
    north=st.floats(-80, 80),
    z=st.floats(0, 20),
    speed=st.floats(0, 5),
    heading=st.floats(-math.pi, math.pi),
    loiter=st.booleans(),
)
def test_the_limits_are_never_exceeded(
    east: float, north: float, z: Any, speed: float, heading: float, loiter: bool
) -> None:
    limits = VehicleLimits()
    vehicle = Vehicle(Motion(heading_rad=heading), limits)
    vehicle.goto(SteeringTarget(east, north, z, speed))
    if loiter:
        vehicle.loiter()
    track = fly(vehicle, 60)
    slack = 1e-9
    for before, after in pairwise(track):
        assert after[5] <= limits.max_speed_mps + slack
        assert abs(after[5] - before[5]) <= limits.acceleration_mps2 * STEP_S + slack
        assert abs(wrap(after[3] - before[3])) <= limits.turn_rate_radps * STEP_S + slack
        assert abs(after[4]) <= limits.pitch_rad + slack
        assert after[2] >= 0.0
        assert math.hypot(after[0] - before[0], after[1] - before[1]) <= limits.max_speed_mps * STEP_S + slack


@settings(max_examples=40, deadline=None)
@given(
    east=st.floats(-60, 60),
    north=st.floats(-60, 60),
    heading=st.floats(-math.pi, math.pi),
    current=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
)
def test_every_target_is_passed_closely(east: float, north: float, heading: float, current: Any) -> None:
    vehicle = Vehicle(Motion(heading_rad=heading), current=current)
    target = SteeringTarget(east, north, 3.0)
    vehicle.goto(target)
    nearest = math.inf
    for _ in range(1800):
        vehicle.step(NO_ERROR, DEEP)
        nearest = min(nearest, distance(vehicle, target))
        if nearest < 1.5:
            break
    assert nearest < 1.5


@pytest.mark.parametrize("current", [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5), (0.35, -0.35)])
@pytest.mark.parametrize("heading", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("place", [(0.0, 60.0), (5.0, 5.0), (-30.0, 3.0), (2.0, -8.0)])
def test_half_its_speed_of_current_keeps_it_from_no_target(
    place: tuple[float, float], heading: float, current: tuple[float, float]
) -> None:
    vehicle = Vehicle(Motion(heading_rad=wrap(heading)), current=current)
    target = SteeringTarget(*place, 3.0, 1.0)
    vehicle.goto(target)
    nearest = math.inf
    for _ in range(3000):
        vehicle.step(NO_ERROR, DEEP)
        nearest = min(nearest, distance(vehicle, target))
    assert nearest < 3.0


@pytest.mark.parametrize("clockwise", [True, False])
def test_it_stays_near_where_it_circles_in_a_current(clockwise: bool) -> None:
    vehicle = Vehicle(current=(0.5, 0.0))
    target = SteeringTarget(30.0, 20.0, 3.0, 1.0)
    vehicle.goto(target)
    vehicle.loiter(clockwise=clockwise)
    fly(vehicle, 120)
    for p in fly(vehicle, 240):
        assert math.hypot(p[0] - 30.0, p[1] - 20.0) < 20.0


def test_it_flies_straight_in_a_cross_current() -> None:
    vehicle = Vehicle(current=(0.3, 0.0))
    vehicle.goto(SteeringTarget(0.0, 200.0, 2.0))
    track = fly(vehicle, 120)
    assert max(abs(p[0]) for p in track) < 3.0, "it crabs instead of being set aside"


@pytest.mark.parametrize("asked", [1.0, 1.2, 1.5])
def test_it_keeps_speed_and_depth(asked: float) -> None:
    vehicle = Vehicle()
    vehicle.goto(SteeringTarget(0.0, 1000.0, 4.0, asked))
    track = fly(vehicle, 90)
    for p in track[-200:]:
        assert p[5] == pytest.approx(asked, abs=0.01)
        assert p[2] == pytest.approx(4.0, abs=0.05)
    assert max(p[2] for p in track) < 4.3, "no overshoot towards the bottom"


def test_it_keeps_altitude_over_a_slope() -> None:
    vehicle = Vehicle()
    vehicle.goto(SteeringTarget(0.0, 1000.0, 3.0, 1.2, by_altitude=True))
    for _ in range(1500):
        bottom = 8.0 + 0.05 * vehicle.motion.north_m
        vehicle.step(NO_ERROR, bottom)
    assert bottom - vehicle.motion.depth_m == pytest.approx(3.0, abs=0.5)


@pytest.mark.parametrize("clockwise", [True, False])
@pytest.mark.parametrize("radius", [5.0, 7.5, 20.0])
def test_it_circles_around_a_reached_target(radius: float, clockwise: bool) -> None:
    vehicle = Vehicle()
    target = SteeringTarget(30.0, 20.0, 3.0)
    vehicle.goto(target)
    vehicle.loiter(radius, clockwise=clockwise)
    fly(vehicle, 120)
    track = fly(vehicle, 120)
    for p in track:
        assert math.hypot(p[0] - 30.0, p[1] - 20.0) == pytest.approx(radius, abs=0.5)
    turned = sum(wrap(b[3] - a[3]) for a, b in pairwise(track))
    assert (turned > 0) == clockwise


def test_without_motor_it_floats_up_and_stays_up() -> None:
    vehicle = Vehicle(Motion(depth_m=2.0))
    track = fly(vehicle, 60)
    assert track[-1][2] == 0.0
    assert track[-1][5] == 0.0


def test_without_motor_it_drifts_with_the_current() -> None:
    vehicle = Vehicle(current=(0.2, -0.1))
    fly(vehicle, 100)
    assert vehicle.motion.east_m == pytest.approx(20.0)
    assert vehicle.motion.north_m == pytest.approx(-10.0)


def test_the_bottom_stops_it() -> None:
    vehicle = Vehicle()
    vehicle.goto(SteeringTarget(0.0, 500.0, 20.0))
    hits = [vehicle.step(NO_ERROR, 6.0) for _ in range(600)]
    assert any(hits)
    assert vehicle.motion.depth_m == 6.0


def test_it_steers_by_where_it_believes_to_be() -> None:
    vehicle = Vehicle()
    target = SteeringTarget(0.0, 60.0, 2.0)
    vehicle.goto(target)
    nearest = math.inf
    for _ in range(900):
        vehicle.step((5.0, 0.0), DEEP)
        nearest = min(nearest, math.hypot(vehicle.motion.east_m + 5.0, vehicle.motion.north_m - 60.0))
    assert nearest < 1.0


def test_a_new_vehicle_is_idle() -> None:
    vehicle = Vehicle()
    assert vehicle.guidance is Guidance.IDLE
    fly(vehicle, 10)
    assert vehicle.distance_m == 0.0


@given(st.floats(-100, 100))
def test_wrapped_angles_are_the_same_angle(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
