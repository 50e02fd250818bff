import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.equipment import Equipment
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.sonars.sensors import SonarNoise
from simulator.sonars.swath import SwathSonar
from simulator.vehicles.navigation import LEAST_VARIANCE_M2, Navigation
from simulator.vehicles.vehicle import Guidance, VehicleLimits
from simulator.world import SimulatedVehicle

HARBOUR = seafloors.generate("harbour", 0)
FLAT = seafloors.generate("flat", 0)
DEEP = Terrain(np.full((101, 101), 20.0), 1.0)


def vehicle(
    terrain: Terrain = HARBOUR,
    start: tuple[int, int, int] = (20, 20, 0),
    seed: int = 0,
    start_time_s: float = 0.0,
    **carried: Any,
) -> SimulatedVehicle:
    rng = np.random.default_rng(seed)
    return SimulatedVehicle("one", terrain, start, rng, Equipment(**carried), start_time_s=start_time_s)


def test_it_arrives_and_circles_there() -> None:
    v = vehicle()
    v.go_to(70, 60, 2.0, arrival_radius_m=3.0)
    assert not v.arrived
    for _ in range(300):
        v.advance(1.0)
        if v.arrived:
            break
    assert v.arrived
    assert v.position.horizontal_distance_m(70, 60) <= 3.5
    assert v.position.depth_m == pytest.approx(2.0, abs=0.1)
    v.advance(60.0)
    assert v.position.horizontal_distance_m(70, 60) == pytest.approx(7.5, abs=0.5)


@given(st.floats(0.8, 2.5), st.floats(0.0, math.tau), st.floats(0.0, 5.0), st.floats(0.0, math.tau))
def test_it_is_at_rest_where_it_was_to_stop(
    speed_mps: float, course_rad: float, depth_m: float, heading_rad: float
) -> None:
    place = (50.0 + 40.0 * math.sin(course_rad), 50.0 + 40.0 * math.cos(course_rad))
    limits = VehicleLimits(max_speed_mps=2.5)
    rng = np.random.default_rng(0)
    v = SimulatedVehicle("one", DEEP, (50, 50, depth_m), rng, Equipment(limits=limits), heading_rad=heading_rad)
    v.go_to(*place, 0.0, speed_mps, arrival_radius_m=3.0, stops=True)
    v.advance(300.0)
    assert v.arrived
    assert v.state.speed_mps == 0.0
    assert v.position.depth_m == 0.0
    assert v.position.horizontal_distance_m(*place) <= 5.0


def test_one_that_floats_away_is_brought_back_and_one_that_is_too_deep_circles_up() -> None:
    v = vehicle(DEEP, (20, 20, 0))
    v.go_to(60, 20, 0.0, arrival_radius_m=3.0, stops=True)
    v.advance(120.0)
    assert v.vehicle.guidance is Guidance.IDLE
    v.vehicle.motion.north_m = 30.0
    assert not v.arrived
    v.advance(120.0)
    assert v.arrived

    v = vehicle(DEEP, (20, 20, 18))
    v.go_to(30, 20, 0.0, arrival_radius_m=3.0, stops=True)
    circled = False
    for _ in range(300):
        v.advance(1.0)
        circled |= v.vehicle.guidance is Guidance.LOITER
    assert circled
    assert v.position.depth_m < 0.1


def test_a_new_target_replaces_the_old_one() -> None:
    v = vehicle()
    v.go_to(22, 20, 1.0)
    v.advance(30.0)
    assert v.arrived
    v.go_to(80, 20, 1.0)
    assert not v.arrived
    v.advance(20.0)
    assert v.state.guidance is Guidance.GOTO


@pytest.mark.parametrize("sensor", ["single", "dvl"])
def test_footprints_lie_on_the_sea_floor(sensor: str) -> None:
    v = vehicle(sensor=sensor)
    v.go_to(60, 70, 2.0)
    measurements = v.advance(60.0)
    assert {m.source for m in measurements} == {{"single": "Altimeter", "dvl": "DVL"}[sensor]}
    for m in measurements[::7]:
        if m.valid:
            floor = float(HARBOUR.depth_at(m.footprint.east_m, m.footprint.north_m))
            assert m.footprint.depth_m == pytest.approx(floor, abs=2e-3)
    assert sum(m.valid for m in measurements) > 0.9 * len(measurements)


def test_a_multibeam_measures_whole_swaths_at_its_rate() -> None:
    v = vehicle(sensor="multibeam", swath=SwathSonar(beams=16, rate_hz=2.0), start_time_s=1000.0)
    v.go_to(60, 70, 2.0)
    pings = v.advance_swath(10.0)
    np.testing.assert_allclose([ping.time_s for ping in pings], 1000.0 + np.arange(1, 21) * 0.5)
    assert {(ping.vehicle, ping.source, len(ping.angles_rad)) for ping in pings} == {("one", "Multibeam", 16)}
    with pytest.raises(ValueError, match="whole swaths"):
        v.advance(1.0)
    with pytest.raises(ValueError, match="not multibeam"):
        vehicle().advance_swath(1.0)


def test_measurements_come_at_the_ping_period_in_time_order() -> None:
    v = vehicle(ping_period_s=0.5, start_time_s=1000.0)
    times = [m.time_s for m in v.advance(3.0) + v.advance(2.0)]
    np.testing.assert_allclose(times, 1000.0 + np.arange(1, 11) * 0.5)


def test_time_may_pass_in_any_portions() -> None:
    once, often = vehicle(), vehicle()
    for v in (once, often):
        v.go_to(80, 80, 2.0)
    at_once = once.advance(60.0)
    in_portions = [m for _ in range(400) for m in often.advance(0.15)]
    assert [m.range_m for m in in_portions] == [m.range_m for m in at_once]
    assert often.time_s == pytest.approx(60.0)


def test_the_seed_decides_everything() -> None:
    noise = SonarNoise(0.05, 0.05, 0.05)
    runs = []
    for seed in (1, 1, 2):
        v = vehicle(sensor="dvl", seed=seed, noise=noise, drift_m2ps=0.02)
        v.go_to(80, 80, 2.0)
        runs.append([m.range_m for m in v.advance(60.0)])
    np.testing.assert_array_equal(runs[0], runs[1])
    assert runs[0] != runs[2]


def test_hitting_the_bottom_is_recorded_once_per_contact() -> None:
    v = vehicle(FLAT, start=(10, 50, 0))
    v.go_to(90, 50, 50.0)
    v.advance(120.0)
    assert v.collided
    assert len(v.collisions) == 1
    time_s, place = v.collisions[0]
    assert 0 < time_s <= 120.0
    assert place.depth_m == pytest.approx(FLAT.max_depth_m)
    assert v.state.collisions == 1


def test_nobody_hits_the_bottom_while_staying_above_it() -> None:
    v = vehicle()
    v.go_to(90, 90, 1.0)
    v.advance(200.0)
    assert not v.collided


def test_stopped_it_comes_up_and_leaves_its_target() -> None:
    v = vehicle()
    v.go_to(80, 80, 2.5)
    v.advance(30.0)
    v.stop()
    v.advance(60.0)
    assert v.position.depth_m == 0.0
    assert not v.arrived
    assert v.state.speed_mps == pytest.approx(0.0, abs=1e-6)


def test_measurements_are_placed_by_the_vehicles_own_reckoning() -> None:
    v = vehicle(drift_m2ps=0.5)
    v.go_to(80, 80, 2.0)
    m = v.advance(120.0)[-1]
    de, dn = m.position.east_m - m.true_position.east_m, m.position.north_m - m.true_position.north_m
    assert math.hypot(de, dn) > 0.5
    assert m.footprint.east_m == pytest.approx(m.position.east_m)


def test_it_measures_nothing_outside_of_the_terrain() -> None:
    v = vehicle(start=(99, 50, 0))
    v.go_to(130, 50, 1.0)
    measurements = v.advance(60.0)
    assert measurements[0].valid
    assert not measurements[-1].valid
    assert math.isnan(measurements[-1].range_m)
    assert math.isnan(v.state.altitude_m)


@pytest.mark.parametrize(
    ("start", "message"),
    [((-1, 5, 0), "east must be 0 to 100 m"), ((50, 50, 90), "start depth 90"), ((50, 50, -1), "start depth -1")],
)
def test_impossible_starts_are_refused(start: tuple[int, int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        vehicle(start=start)


def test_impossible_targets_and_times_are_refused() -> None:
    v = vehicle()
    with pytest.raises(ValueError, match="not finite"):
        v.go_to(math.nan, 0, 0)
    with pytest.raises(ValueError, match="dt_s is -1"):
        v.advance(-1.0)


def test_dead_reckoning_is_a_random_walk_whose_variance_is_told() -> None:
    errors = []
    for seed in range(300):
        navigation = Navigation(0.02, np.random.default_rng(seed))
        for _ in range(100):
            navigation.step(5.0, 1.0)
        errors.append(navigation.error_m)
    assert np.var(errors) == pytest.approx(2.0, rel=0.2)
    assert navigation.variance_m2 == pytest.approx(2.0 + LEAST_VARIANCE_M2)
    assert not navigation.has_fix


def test_a_fix_at_the_surface_ends_the_drift() -> None:
    navigation = Navigation(0.02, np.random.default_rng(0))
    for _ in range(1000):
        navigation.step(5.0, 1.0)
    assert math.hypot(*navigation.error_m) > 1.0
    navigation.step(0.0, 1.0)
    assert math.hypot(*navigation.error_m) < 0.5
    assert navigation.has_fix
    assert navigation.variance_m2 == LEAST_VARIANCE_M2


def test_without_drift_the_position_is_exact() -> None:
    v = vehicle()
    v.go_to(80, 80, 2.0)
    v.advance(100.0)
    assert v.position == v.true_position


@pytest.mark.parametrize("drift", [-1.0, math.nan])
def test_impossible_drift_is_refused(drift: float) -> None:
    with pytest.raises(ValueError, match="drift is"):
        Navigation(drift, np.random.default_rng(0))
