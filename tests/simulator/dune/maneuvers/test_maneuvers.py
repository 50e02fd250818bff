"""Maneuvers that end by themselves, and what becomes of a vehicle whose DUNE stumbles or dies."""

import math
from collections.abc import Callable
from typing import Any

import imcpy
import pytest

from simulator.vehicles.navigation import SURFACE_DEPTH_M
from tests.support.imc.dune_bench import HOME, Bench, start_request, stop_request

SERVICE, ERROR, MANEUVER, BOOT = 0, 2, 3, 5
BLOCKED, READY, EXECUTING = 0, 1, 3
START = (50.0, 20.0, 0.0)


def placed(spec: imcpy.Message, bench: Bench, place: tuple[int, int]) -> imcpy.Message:
    lat, lon = bench.vehicle.terrain.frame.to_geodetic(*place)
    spec.lat, spec.lon = math.radians(lat), math.radians(lon)
    spec.speed, spec.speed_units = 1.2, imcpy.SpeedUnits.METERS_PS
    return spec


def goto(bench: Bench, place: tuple[int, int], depth: float) -> imcpy.Message:
    spec = placed(imcpy.Goto(), bench, place)
    spec.z, spec.z_units = depth, imcpy.ZUnits.DEPTH
    return spec


def elevator(bench: Bench, place: tuple[int, int], depth: float, flags: int = 0) -> imcpy.Message:
    spec = placed(imcpy.Elevator(), bench, place)
    spec.start_z = spec.end_z = depth
    spec.start_z_units = spec.end_z_units = imcpy.ZUnits.DEPTH
    spec.radius, spec.flags = 10.0, flags
    return spec


def plan(bench: Bench, *steps: imcpy.Message) -> None:
    request = start_request()
    spec = imcpy.PlanSpecification()
    spec.plan_id, spec.start_man_id = "cao", "0"
    for index, data in enumerate(steps):
        item = imcpy.PlanManeuver()
        item.maneuver_id, item.data = str(index), data
        spec.maneuvers.append(item)
        if index:
            link = imcpy.PlanTransition()
            link.source_man, link.dest_man, link.conditions = str(index - 1), str(index), "ManeuverIsDone"
            spec.transitions.append(link)
    request.arg = spec
    bench.say(request)


def infos(bench: Bench) -> list[str]:
    return [m.info for m in bench.all(imcpy.PlanControl)]


def run_until(bench: Bench, condition: Callable[..., Any], seconds: float) -> float:
    begun = bench.wall_s
    while not condition():
        assert bench.wall_s - begun < seconds, "waited in vain"
        bench.run(0.1)
        if round(bench.wall_s * 10) % 10 == 0:
            bench.beat()
    return bench.wall_s - begun


def over(bench: Bench) -> bool:
    return bench.states() == (SERVICE, READY)


def test_a_goto_ends_by_horizontal_nearness_before_the_depth_is_reached_and_the_next_one_at_once(bench: Bench) -> None:
    plan(bench, goto(bench, (50, 30), 3.0), goto(bench, (50, 30), 0.0))
    run_until(bench, lambda: "1: executing maneuver" in infos(bench), 30.0)
    assert bench.vehicle.position.depth_m < 1.5, "it had no time to get to 3 m"
    took = run_until(bench, lambda: over(bench), 5.0)
    assert took <= 1.0
    assert bench.vehicle.position.depth_m > 0.3, "the plan is over under water"


def test_an_elevator_circles_until_the_depth_is_reached(bench: Bench) -> None:
    plan(bench, elevator(bench, (50, 40), 4.0))
    run_until(bench, lambda: over(bench), 120.0)
    here = bench.vehicle.position
    assert here.depth_m == pytest.approx(4.0, abs=0.35)
    assert here.horizontal_distance_m(50, 40) == pytest.approx(10.0, abs=4.0)


def test_an_elevator_at_depth_and_on_its_circle_ends_at_once(bench: Bench) -> None:
    plan(bench, elevator(bench, (0, 0), 4.0, int(imcpy.Elevator.FlagsBits.CURR_POS)), goto(bench, (80, 80), 4.0))
    run_until(bench, lambda: "1: executing maneuver" in infos(bench), 60.0)
    assert bench.vehicle.position.depth_m == pytest.approx(4.0, abs=0.35)
    assert bench.vehicle.position.horizontal_distance_m(50, 20) < 15.0


def test_station_keeping_floats_up_in_its_place_for_as_long_as_asked(bench: Bench) -> None:
    station = placed(imcpy.StationKeeping(), bench, (50, 45))
    station.radius, station.duration = 15.0, 40
    plan(bench, goto(bench, (50, 50), 3.0), station)
    run_until(bench, lambda: "1: executing maneuver" in infos(bench), 60.0)
    place = bench.vehicle.position
    assert place.depth_m > 1.0
    took = run_until(bench, lambda: over(bench), 80.0)
    assert took == pytest.approx(40.0, abs=2.0)
    assert bench.vehicle.position.depth_m == pytest.approx(0.0, abs=0.1)
    assert bench.vehicle.position.horizontal_distance_m(place.east_m, place.north_m) < 15.0


@pytest.mark.parametrize("waits", [True, False])
def test_a_pop_up_ends_at_the_surface(bench: Bench, waits: bool) -> None:
    up = placed(imcpy.PopUp(), bench, (50, 60))
    bits = imcpy.PopUp.FlagsBits
    up.flags = int(bits.CURR_POS) | (int(bits.WAIT_AT_SURFACE) if waits else 0)
    up.duration = 8
    plan(bench, goto(bench, (50, 60), 3.0), up)
    run_until(bench, lambda: "1: executing maneuver" in infos(bench), 60.0)
    assert bench.vehicle.position.depth_m > 1.5
    submerged_s = run_until(bench, lambda: bench.vehicle.position.depth_m < SURFACE_DEPTH_M, 60.0)
    at_surface_s = run_until(bench, lambda: over(bench), 30.0)
    assert submerged_s > 3.0
    assert at_surface_s == pytest.approx(8.0, abs=2.0) if waits else at_surface_s < 8.0
    assert bench.vehicle.position.depth_m < SURFACE_DEPTH_M


def follow_somewhere(bench: Bench) -> None:
    bench.say(start_request())
    bench.run(20.0, lambda: bench.follow(50, 150))
    assert bench.states() == (MANEUVER, EXECUTING)


def test_a_late_vehicle_state_blocks_the_engine_while_the_maneuver_goes_on(bench: Bench) -> None:
    follow_somewhere(bench)
    bench.node.plan.miss_vehicle_state()
    assert bench.last(imcpy.PlanControlState).state == imcpy.PlanControlState.StateEnum.BLOCKED
    before = bench.vehicle.position.north_m
    bench.run(10.0, lambda: bench.follow(50, 150))
    assert bench.states() == (MANEUVER, BLOCKED), "so it stays"
    assert bench.vehicle.position.north_m > before + 5.0
    bench.say(stop_request(request_id=7))
    assert infos(bench)[-1] == "no plan is running, request ignored"
    assert bench.states() == (MANEUVER, BLOCKED), "a STOP has no effect"
    bench.say(start_request(request_id=8))
    assert bench.states() == (MANEUVER, EXECUTING), "a START has"


def test_a_blocked_vehicle_stops_at_an_abort_or_when_its_maneuver_ends(bench: Bench) -> None:
    follow_somewhere(bench)
    bench.node.plan.miss_vehicle_state()
    bench.say(imcpy.Abort())
    bench.run(2.0, bench.beat)
    assert over(bench)
    plan(bench, goto(bench, (50, 60), 1.0), goto(bench, (50, 150), 1.0))
    bench.node.plan.miss_vehicle_state()
    run_until(bench, lambda: over(bench), 120.0)
    assert "1: executing maneuver" not in infos(bench), "an engine that is blocked starts nothing"


def test_a_crash_under_water_is_followed_by_a_start_without_plan_or_memory(bench: Bench) -> None:
    follow_somewhere(bench)
    bench.run(10.0, lambda: bench.follow(50, 150))
    assert bench.vehicle.position.depth_m > 1.0
    uid = announced(bench)
    bench.node.crash(down_s=3.0)
    bench.wire.sent.clear()
    bench.announced.sent.clear()
    bench.run(2.5, bench.beat)
    assert not bench.wire.sent
    assert not bench.announced.sent
    bench.run(1.0)
    assert announced(bench) != uid, "every start has its own"
    bench.introduce()
    bench.run(3.0, bench.beat)
    assert bench.states() == (BOOT, BLOCKED)
    assert not bench.wire.sent, "contacts are looked for every 5 s"
    bench.run(6.0, bench.beat)
    assert over(bench)
    state = bench.last(imcpy.PlanControlState)
    assert (state.plan_id, int(state.last_outcome)) == ("", 0)
    bench.run(30.0, bench.beat)
    assert bench.vehicle.position.depth_m < 0.1, "it floats up"
    assert bench.node.address == HOME


def announced(bench: Bench) -> str:
    return bench.announced.sent[-1][0].services.split("uid/")[1].split(";")[0]
