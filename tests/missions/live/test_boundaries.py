"""Vehicles that go where they must not be."""

import numpy as np
import pytest

from app.missions.alarm_kinds import AlarmKind
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.fleet.links.simulated.launch import FloorPatch, Launch
from app.missions.live.boundaries import Boundaries
from app.missions.operations.history import events_after
from app.missions.preflight.survey import preflight
from app.missions.safety.room import WAITING_CIRCLE_M
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.vehicle import Sensor, VehicleKind
from app.missions.task.constraints import make_constraints
from app.missions.views.mission import CheckStatus, EventView, Level
from simulator.equipment import Equipment
from simulator.floors.seafloors import generate
from simulator.sonars.sensors import SonarNoise
from simulator.world import SimulatedVehicle
from tests.support.missions.harbour import Rover, act, view_of
from tests.support.missions.specs import LAT, LON, lon_lat, make_spec, rectangle
from tests.support.waiting import until

AREA = np.array([[0.0, 0], [100, 0], [100, 100], [0, 100]])
ZONE = np.array([[40.0, 40], [60, 40], [60, 60], [40, 60]])


def told(boundaries: Boundaries, places: list[tuple[float, float]]) -> list[tuple[AlarmKind | None, str]]:
    lines = [boundaries.judge("a", place, 2.0, at_s) for at_s, place in enumerate(places)]
    return [(line.alarm if line.begins else None, line.message) for found in lines for line in found]


def test_an_entry_into_a_zone_is_one_alarm_and_its_end_says_how_long_and_how_far() -> None:
    way = [(30.0, 50.0), (39.9, 50.0), (41.0, 50.0), (44.0, 50.0), (40.5, 50.0), (39.5, 50.0), (40.2, 50.0), (35, 50)]
    assert told(Boundaries(AREA, [ZONE]), way) == [
        (AlarmKind.ZONE_ENTERED, "a is in keep-out zone 1, at 2.0 m depth: abort it if it goes on"),
        (None, "a is no longer in keep-out zone 1: it was for 5 s, by up to 4.0 m"),
    ]


def test_the_alarm_of_zones_ends_when_the_vehicle_is_in_none_of_them() -> None:
    boundaries = Boundaries(AREA, [ZONE, ZONE + np.array([10.0, 0.0])])
    lines = [line for east in (45.0, 55.0, 65.0, 75.0) for line in boundaries.judge("a", (east, 50.0), 2.0, east)]
    assert [(line.data["zone"], line.begins, line.ends) for line in lines] == [
        (1, True, False),
        (2, True, False),
        (1, False, False),
        (2, False, True),
    ]


def test_leaving_the_area_is_an_alarm_beyond_the_circle_of_waiting_and_coming_from_outside_is_none() -> None:
    boundaries = Boundaries(AREA, [])
    assert told(boundaries, [(-80, 50), (-30, 50), (5, 50), (-15, 50), (5, 50)]) == []
    assert told(boundaries, [(-21, 50)]) == [
        (AlarmKind.AREA_LEFT, "a is outside the area, at 2.0 m depth: abort it if it goes on")
    ]
    assert boundaries.breach("a") == "outside the area"
    assert told(boundaries, [(-15, 50)]) == []
    assert [alarm for alarm, _ in told(boundaries, [(-9, 50)])] == [None]
    assert boundaries.breach("a") == ""


def test_who_was_led_out_of_the_area_comes_in_again_without_an_alarm() -> None:
    boundaries = Boundaries(AREA, [])
    assert not boundaries.judge("a", (50, 50), 2.0, 0.0)
    assert not boundaries.judge("a", (-10, 50), 2.0, 0.0, may_leave=True)
    assert not boundaries.judge("a", (-80, 50), 2.0, 0.0, may_leave=True)
    assert not boundaries.comes_in("a")
    assert told(boundaries, [(-80, 50), (-30, 50)]) == []
    assert boundaries.comes_in("a")
    assert told(boundaries, [(5, 50)]) == []
    assert not boundaries.comes_in("a")
    assert len(told(boundaries, [(-21, 50)])) == 1


def test_a_vehicle_that_left_the_mission_is_forgotten() -> None:
    boundaries = Boundaries(AREA, [ZONE])
    assert len(told(boundaries, [(50, 50)])) == 1
    boundaries.forget("a")
    assert boundaries.breach("a") == ""


def test_alarms_of_before_a_restart_end_where_the_vehicle_is_clear() -> None:
    boundaries = Boundaries(AREA, [ZONE])
    boundaries.recall({(AlarmKind.ZONE_ENTERED, "a"), (AlarmKind.AREA_LEFT, "a"), (AlarmKind.AREA_LEFT, "b")})
    assert told(boundaries, [(-15, 50), (-9, 50), (20, 50)]) == [
        (None, "a is in no keep-out zone any more"),
        (None, "a is no longer outside the area"),
    ]
    again = Boundaries(AREA, [ZONE])
    again.recall({(AlarmKind.ZONE_ENTERED, "a")})
    assert [alarm for alarm, _ in told(again, [(50, 50), (20, 50)])] == [AlarmKind.ZONE_ENTERED, None]


@pytest.mark.parametrize("speed_mps", [0.5, 1.0, 1.5, 2.0])
def test_no_vehicle_that_waits_at_its_waypoint_circles_farther_than_the_margin(speed_mps: float) -> None:
    terrain = generate("harbour", 0, width_m=200, height_m=200, origin=(LAT, LON))
    body = SimulatedVehicle(
        "a",
        terrain,
        (80.0, 88.0, 0.0),
        np.random.default_rng(1),
        Equipment(noise=SonarNoise(relative_sd=0.01)),
    )
    body.go_to(100, 100, 2.0, speed_mps, arrival_radius_m=3.0)
    farthest_m = 0.0
    for _ in range(1200):
        body.advance(0.1)
        if body.arrived or farthest_m:
            farthest_m = max(farthest_m, body.position.horizontal_distance_m(100, 100))
    assert 5.0 < farthest_m < WAITING_CIRCLE_M


def test_waypoints_stay_a_waiting_circle_away_from_zones_by_default() -> None:
    zone, margin = make_constraints(make_spec(100, keep_out=[rectangle(40, 40, 60, 60)])).keep_out
    assert zone[:, 0].min() - margin[:, 0].min() == pytest.approx(WAITING_CIRCLE_M, abs=0.05)


@pytest.mark.parametrize(("margin_m", "warned"), [(5.0, True), (10.0, False), (25.0, False)])
async def test_the_checklist_warns_of_a_margin_that_waiting_vehicles_overstep(
    service: MissionService, margin_m: float, warned: bool
) -> None:
    limits = {"max_step_m": 8, "keep_out_margin_m": margin_m}
    mission = await service.create(make_spec(100, keep_out=[rectangle(40, 40, 60, 60)], limits=limits))
    checks = {check.id: check for check in (preflight(await service.get(mission.id))).checks}
    assert ("waiting" in checks) is warned
    if warned:
        assert checks["waiting"].status is CheckStatus.WARNING


@pytest.mark.slow
async def test_a_vehicle_reported_in_a_zone_is_an_alarm_of_its_mission(service: MissionService) -> None:
    spec = make_spec(100, steps=50, vehicles=[{"name": "a", "kind": "rest"}], keep_out=[rectangle(40, 40, 60, 60)])
    mission = (await service.create(spec)).id
    rover = Rover(service, mission, "a", 10, 10)
    await rover.post()
    await act(service, mission, "start", actor="Ana")

    async def post_at(east_m: float, north_m: float) -> None:
        lon, lat = lon_lat(east_m, north_m)
        await rover.post(lat_deg=lat, lon_deg=lon)

    async def lines() -> list[EventView]:
        return [line for line in await events_after(await service.get(mission)) if line.kind == "boundary"]

    await post_at(50, 50)
    await until(lines, "the entry is in the log")
    [line] = await lines()
    assert (line.level, line.data["vehicle"], line.data["zone"]) == (Level.ALARM, "a", 1)
    [view] = (await view_of(service, mission)).vehicles
    assert view.breach == "in keep-out zone 1"
    await post_at(30, 50)

    async def ended() -> bool:
        return len(await lines()) == 2

    await until(ended, "its end is in the log")
    [view] = (await view_of(service, mission)).vehicles
    assert view.breach == ""
    await act(service, mission, "abort", actor="Ana")


async def test_simulated_vehicles_of_another_mission_are_launched_anew(service: MissionService) -> None:
    link = SimFleetLink(SimulationSettings(), 1.0)
    places = []
    for mission, east_m in (("m1", 20), ("m1", 40), ("m2", 60)):
        lon, lat = lon_lat(east_m, 20)
        link.launch(Launch("a", mission, Sensor.DVL, FloorPatch((LAT, LON), 100, 100), start=(lat, lon), noise=0.01))
        [info] = link.vehicles()
        assert info.report is not None
        places.append(round((info.report.position.lon_deg - LON) / (lon_lat(1, 0)[0] - LON)))
    assert places == [20, 20, 60]
    link.put_away("a")
    assert link.vehicles() == []
    assert VehicleKind(link.kind) is VehicleKind.SIM
