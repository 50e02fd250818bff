"""Every way out of a mission with a recovery point leads home."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from app.missions.alarm_kinds import AlarmKind
from app.missions.errors import ConflictError
from app.missions.fleet.interface import FaultKind
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.flown import Phase
from app.missions.operations.history import events_after
from app.missions.recovery.berths import home_of
from app.missions.running.homecoming import call_home, hold
from app.missions.safety.room import CIRCLE_M
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from app.missions.states import Action, MissionState
from app.missions.team import Withdrawal
from app.missions.views.mission import MissionView, VehicleView
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, until_step, view_of
from tests.support.missions.specs import FRAME, lon_lat, rectangle
from tests.support.waiting import until

INSIDE, OUTSIDE = lon_lat(15.0, 4.0), lon_lat(15.0, -60.0)


def recovered(*names: str, point: tuple[float, float] = INSIDE, **changes: Any) -> MissionSpec:
    """A mission with a recovery point."""
    recovery = {"point": point} | changes.pop("recovery", {})
    return sim_spec(*names, recovery=recovery, **changes)


def from_home_m(vehicle: VehicleView, point: tuple[float, float]) -> float:
    assert vehicle.lat_deg is not None
    assert vehicle.lon_deg is not None
    east, north = FRAME.to_local(vehicle.lat_deg, vehicle.lon_deg)
    home_east, home_north = FRAME.to_local(point[1], point[0])
    return math.hypot(float(east) - float(home_east), float(north) - float(home_north))


async def words_of(service: MissionService, mission: MissionView, kind: str) -> list[str]:
    live = await service.get(mission.id)
    return [event.message for event in await events_after(live, 0, 1000) if event.kind == kind]


async def phase_of(service: MissionService, mission: MissionView, name: str) -> Phase | None:
    return next(v.phase for v in (await view_of(service, mission.id)).vehicles if v.name == name)


@pytest.mark.slow
@pytest.mark.parametrize("point", [INSIDE, OUTSIDE])
async def test_at_the_end_of_a_mission_everybody_goes_home(service: MissionService, point: tuple[float, float]) -> None:
    mission = await service.create(recovered("a", "b", point=point, steps=3))
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}
    assert max(from_home_m(vehicle, point) for vehicle in ended.vehicles) < 25.0
    assert max(vehicle.depth_m or 0.0 for vehicle in ended.vehicles) < 1.5, "they have come up"
    words = await words_of(service, mission, "recovery")
    assert sum("is home" in line for line in words) == 2, words
    assert not await words_of(service, mission, "boundary")


def unlike(**changes: Any) -> MissionSpec:
    """A mission of a fast vehicle and a slow one, equally far."""
    speeds = {"fast": 2.0, "slow": 0.5}
    vehicles = [{"name": name, "kind": "sim", "speed_mps": speed} for name, speed in speeds.items()]
    limits = {"max_step_m": 20.0, "min_separation_m": 0.0}
    shape = {"side_m": 100.0, "limits": limits, "budget": {"km_per_vehicle": 0.15}, "vehicles": vehicles}
    return recovered(point=lon_lat(50.0, -20.0), **(shape | changes))


@pytest.mark.slow
async def test_who_has_flown_its_way_goes_home_while_others_survey(service: MissionService) -> None:
    mission = await service.create(unlike())
    await act(service, mission.id, "start")
    fast, _ = (await service.get(mission.id)).team
    await until(lambda: fast.withdrawal is not None, "the fast one has flown its way")
    shown = (await view_of(service, mission.id)).vehicles
    assert [vehicle.part_done for vehicle in shown] == [True, False]
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert {waypoint.status for waypoint in ended.waypoints} == {"reached"}, "what was flown is not given up"
    told = [words for words in await words_of(service, mission, "recovery") if "goes home" in words]
    assert told == ["fast goes home: it has flown its way", "slow goes home: everybody has flown its way"]


@pytest.mark.slow
async def test_who_is_to_stop_in_the_end_waits_for_the_others(service: MissionService) -> None:
    mission = await service.create(unlike(recovery={"on_finish": "stop"}))
    await act(service, mission.id, "start")
    fast, _ = (await service.get(mission.id)).team
    await until_state(service, mission.id, MissionState.FINISHED)
    assert fast.withdrawal is None, "it surveyed until the end"
    assert not [words for words in await words_of(service, mission, "recovery") if "goes home" in words]


@pytest.mark.slow
async def test_who_is_lost_keeps_no_mission_open_whose_others_are_home(service: MissionService) -> None:
    mission = await service.create(unlike(step_deadline_s=30.0))
    await act(service, mission.id, "start")
    fast, _ = (await service.get(mission.id)).team
    await until(lambda: fast.withdrawal is not None, "the fast one has flown its way")
    link = service.hub._links[VehicleKind.SIM]
    assert isinstance(link, SimFleetLink)
    link.silence("slow")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert ended.reason == "everybody has flown its way but slow"
    assert {vehicle.name: vehicle.phase for vehicle in ended.vehicles}["fast"] is Phase.HOME
    assert "slow did not come home: it cannot be reached" in await words_of(service, mission, "recovery")


async def test_a_mission_may_want_its_vehicles_to_stop_where_they_are(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=OUTSIDE, steps=2, recovery={"on_finish": "stop"}))
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert [vehicle.phase for vehicle in ended.vehicles] == [Phase.STOPPED]
    assert from_home_m(ended.vehicles[0], OUTSIDE) > 25.0


@pytest.mark.parametrize("action", [Action.FINISH, Action.ABORT])
async def test_finish_and_abort_bring_everybody_home_when_asked(service: MissionService, action: Action) -> None:
    mission = await service.create(recovered("a", "b", point=OUTSIDE, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    state = MissionState.FINISHED if action is Action.FINISH else MissionState.ABORTED
    answer = await service.act(live, action, actor="Ana", note="wind", return_home=True)
    assert answer.mission.state is MissionState.RUNNING
    assert answer.mission.ending is state
    await until(lambda: live.header.state is not MissionState.RUNNING, "everybody is home")
    ended = await view_of(service, mission.id)
    assert (ended.state, ended.reason, ended.ending) == (state, "wind", None)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}


async def test_a_second_finish_stops_those_on_their_way(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=lon_lat(15.0, -600.0), steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    assert (await act(service, mission.id, "finish")).mission.ending is MissionState.FINISHED
    ended = await act(service, mission.id, "finish")
    assert ended.mission.state is MissionState.FINISHED
    assert [stop.acknowledged for stop in ended.stops] == [True]


@pytest.mark.parametrize("return_home", [True, None])
async def test_what_is_being_aborted_cannot_be_finished(service: MissionService, return_home: bool | None) -> None:
    mission = await service.create(recovered("a", point=lon_lat(15.0, -600.0), steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    answer = await service.act(live, Action.ABORT, actor="Ana", return_home=True)
    assert Action.FINISH not in answer.mission.allowed_actions
    with pytest.raises(ConflictError, match="it is aborted by Ana, as soon as everybody is home"):
        await service.act(live, Action.FINISH, actor="Rui", return_home=return_home)
    assert (await act(service, mission.id, "abort")).mission.state is MissionState.ABORTED


async def test_a_mission_that_has_not_begun_is_aborted_with_nobody_to_bring_home(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    aborted = await service.act(live, Action.ABORT, actor="Ana", return_home=True)
    assert aborted.mission.state is MissionState.ABORTED


async def test_an_abort_stops_at_once_unless_asked_otherwise(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=OUTSIDE, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    answer = await act(service, mission.id, "abort")
    assert answer.mission.state is MissionState.ABORTED
    assert [stop.acknowledged for stop in answer.stops] == [True]


async def test_without_a_recovery_point_nobody_can_be_asked_to_return(service: MissionService) -> None:
    mission = await service.create(sim_spec("a", steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    live = await service.get(mission.id)
    with pytest.raises(ConflictError, match="no vehicle has a recovery point"):
        await service.act(live, Action.FINISH, actor="Ana", return_home=True)
    with pytest.raises(ConflictError, match="no recovery point"):
        await call_home(live, "a", "Ana")
    assert (await act(service, mission.id, "finish")).mission.state is MissionState.FINISHED


@pytest.mark.slow
async def test_a_vehicle_goes_home_for_a_battery_and_comes_back(service: MissionService) -> None:
    mission = await service.create(recovered("a", "b", point=OUTSIDE, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    await call_home(live, "a", "Ana")
    on_its_way = next(v for v in (await view_of(service, mission.id)).vehicles if v.name == "a")
    vehicle = live.team.members["a"]
    berth_m = home_of(vehicle.spec, vehicle.slot, live.spec, live.team.specs)
    assert berth_m is not None
    lat, lon = live.frame.to_geographic(*berth_m)
    assert on_its_way.way_home[-1] == pytest.approx((float(lon), float(lat)), abs=1e-6)
    with pytest.raises(ConflictError, match="called home by Ana"):
        await call_home(live, "a", "Ana")

    async def is_home() -> bool:
        return await phase_of(service, mission, "a") is Phase.HOME

    await until(is_home, "a is home")
    there = next(v for v in (await view_of(service, mission.id)).vehicles if v.name == "a")
    assert (there.way_home, there.turn_back_point) == ([], None)
    before, other = live.team.members["a"].legs, live.team.members["b"].legs
    await until(lambda: live.team.members["b"].legs > other + 2, "b goes on meanwhile")
    assert live.team.members["a"].legs == before
    await service.send_on(live, "a", "Ana")
    assert await phase_of(service, mission, "a") is not Phase.HOME
    await until(lambda: live.team.members["a"].legs > before + 2, "a surveys again")

    async def surveys() -> bool:
        return await phase_of(service, mission, "a") in (Phase.SURVEY, Phase.TRANSIT)

    await until(surveys, "a is seen to survey again")
    await act(service, mission.id, "abort")


async def test_resuming_a_vehicle_of_a_paused_mission_says_that_it_is_paused(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=OUTSIDE))
    await act(service, mission.id, "start")
    await act(service, mission.id, "pause")
    live = await service.get(mission.id)
    with pytest.raises(ConflictError, match="the mission is paused") as refused:
        await service.send_on(live, "a", "Ana")
    assert refused.value.remedy == "It is paused: resume, finish or abort it"
    await act(service, mission.id, "abort")


async def test_what_a_vehicle_is_at_is_known_when_its_clock_has_jumped(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=OUTSIDE, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    member = live.team.members["a"]
    report = member.report
    assert report is not None
    flown_m = member.flown.flown_m
    member.flown.phase = Phase.HOME
    live.reports.take(replace(report, time_s=report.time_s + 3600.0), live.spec, running=True)
    assert member.flown.phase in (Phase.SURVEY, Phase.TRANSIT)
    assert member.flown.flown_m == flown_m, "where it was meanwhile nobody knows"
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_a_vehicle_that_is_held_waits_until_it_is_sent_on(service: MissionService) -> None:
    starts = {"a": lon_lat(35.0, 60.0), "b": lon_lat(85.0, 60.0)}
    vehicles = [{"name": name, "kind": "sim", "start": start} for name, start in starts.items()]
    mission = await service.create(recovered(vehicles=vehicles, point=OUTSIDE, side_m=120.0, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    a, b = live.team.members["a"], live.team.members["b"]
    await hold(live, "a", "Ana")
    with pytest.raises(ConflictError, match="held by Ana"):
        await hold(live, "a", "Ana")
    await until(lambda: a.withdrawal is not None and a.withdrawal.led and not a.ordered, "a is held")
    before, other = a.legs, b.legs
    await until(lambda: b.legs > other + 3, "b goes on meanwhile")
    assert a.legs == before
    await until(lambda: a.flown.phase is Phase.STOPPED, "its next report is that of one that is held")
    await until(lambda: a.waits_m is not None, "it circles")
    circles = {v.name: v.waiting_circle for v in (await view_of(service, mission.id)).vehicles}
    assert circles["b"] is None
    assert circles["a"] is not None
    lon, lat = circles["a"].centre
    east, north = FRAME.to_local(lat, lon)
    room = Point(float(east), float(north)).buffer(circles["a"].radius_m)
    assert Polygon(live.spec.local_area()).buffer(0.1).contains(room)
    # What is stored lets a restart go on with it.
    assert a.withdrawal is not None
    assert Withdrawal.recall(a.withdrawal.remember()) == replace(a.withdrawal, led=False)
    await service.send_on(live, "a", "Ana")
    await until(lambda: a.legs > before + 2, "a surveys again")
    assert all(v.waiting_circle is None for v in (await view_of(service, mission.id)).vehicles)
    await hold(live, "b", "Ana")
    await call_home(live, "b", "Ana")

    async def is_home() -> bool:
        return await phase_of(service, mission, "b") is Phase.HOME

    await until(is_home, "b is home, though it was held")
    await act(service, mission.id, "abort")


@pytest.mark.parametrize("stopped_by", ["a pause", "a restart"])
async def test_who_waited_before_the_mission_was_stopped_waits_in_circles_after_it(
    harbour: Harbour, stopped_by: str
) -> None:
    service = harbour.service
    vehicles = [
        {"name": name, "kind": "sim", "start": lon_lat(east_m, 60.0)} for name, east_m in (("a", 35.0), ("b", 85.0))
    ]
    mission = await service.create(sim_spec(vehicles=vehicles, side_m=120.0, steps=4))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    live = await service.get(mission.id)
    await hold(live, "b", "Ana")
    team = live.team.members

    def waiting() -> bool:
        done = not team["a"].ordered and team["a"].way_left_m(live.spec) == 0.0
        return done and all(member.controllable and member.waits_m is not None for member in team.values())

    await until(waiting, "one is held, one is done")
    if stopped_by == "a pause":
        await act(service, mission.id, "pause")
        await act(service, mission.id, "resume")
    else:
        service = await harbour.reopen()
        live = await service.get(mission.id)
    team = live.team.members
    await until(waiting, "both are told to wait")
    assert team["a"].withdrawal is None
    assert team["b"].withdrawal is not None
    assert team["b"].withdrawal.response is Response.HOLD
    area = Polygon(live.spec.local_area())
    centres_m = {member.name: member.waits_m for member in team.values() if member.waits_m is not None}
    assert all(area.contains(Point(centre_m)) for centre_m in centres_m.values())
    circles = {v.name: v.waiting_circle for v in (await view_of(service, mission.id)).vehicles}
    assert None not in circles.values()
    began_m = {member.name: member.place_m(live.frame) for member in team.values()}

    def under_way() -> bool:
        return all(math.dist(member.place_m(live.frame), began_m[member.name]) > 3.0 for member in team.values())

    await until(under_way, "their motors run")

    def on_circles() -> bool:
        return all(math.dist(team[name].place_m(live.frame), at_m) < 2.0 * CIRCLE_M for name, at_m in centres_m.items())

    await until(on_circles, "they go round where they were told to wait")
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_vehicles_that_fly_in_steps_of_the_whole_team_come_home_too(service: MissionService) -> None:
    spec = recovered("a", "b", point=OUTSIDE, steps=1000, limits={"max_step_m": 8.0, "com_range_m": 500.0})
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    await call_home(live, "a", "Ana")

    async def is_home() -> bool:
        return await phase_of(service, mission, "a") is Phase.HOME

    await until(is_home, "a is home")
    step = live.header.step
    await until_step(service, mission.id, step + 2)
    await service.send_on(live, "a", "Ana")
    flown = live.team.members["a"].legs
    await until(lambda: live.team.members["a"].legs > flown, "a takes part again")
    await act(service, mission.id, "finish")
    ended = await until_ended(service, mission.id)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}


@pytest.mark.slow
@pytest.mark.parametrize("limits", [{}, {"max_step_m": 8.0, "com_range_m": 500.0}], ids=["apart", "one team"])
async def test_who_is_sent_on_while_nobody_else_surveys_goes_on(
    service: MissionService, limits: dict[str, Any]
) -> None:
    far = lon_lat(15.0, -300.0)
    mission = await service.create(recovered("a", point=far, steps=1000, **({"limits": limits} if limits else {})))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    await call_home(live, "a", "Ana")
    a = live.team.members["a"]
    await until(lambda: a.flown.phase is Phase.RETURNING and a.ordered, "a is on its way")
    before = a.legs
    await service.send_on(live, "a", "Ana")
    await until(lambda: a.legs > before + 2, "a surveys again")
    await call_home(live, "a", "Ana")
    ended = await until_ended(service, mission.id)
    assert (ended.state, ended.vehicles[0].phase) == (MissionState.FINISHED, Phase.HOME)
    assert limits or ended.reason == "nobody surveys any more"


WAITS: dict[str, Any] = {"recovery": {"wait_for_batteries": True}}


@pytest.mark.slow
@pytest.mark.parametrize("limits", [{}, {"max_step_m": 8.0, "com_range_m": 500.0}], ids=["apart", "one team"])
async def test_a_mission_may_wait_until_its_only_vehicle_has_another_battery(
    harbour: Harbour, limits: dict[str, Any]
) -> None:
    service = harbour.service
    mission = await service.create(recovered("a", steps=9, **(WAITS | ({"limits": limits} if limits else {}))))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)

    async def home_again(times: int) -> MissionView:
        live = await service.get(mission.id)
        await call_home(live, "a", "Ana")

        async def told() -> bool:
            return (
                len([w for w in await words_of(service, mission, "waiting") if "every vehicle is home" in w]) == times
            )

        await until(told, "the operator is told")
        return await view_of(service, mission.id)

    waits = await home_again(1)
    assert (waits.state, waits.vehicles[0].phase, waits.progress.eta_s) == (MissionState.RUNNING, Phase.HOME, None)
    assert (await words_of(service, mission, "waiting"))[0].endswith(
        ": resume who has another battery, or finish the mission"
    )
    # Also when the service is started anew meanwhile.
    service = await harbour.reopen()
    await service.missions()
    live = await service.get(mission.id)
    a = live.team.members["a"]
    before = a.legs
    await service.send_on(live, "a", "Ana")
    await until(lambda: a.legs > before, "a surveys again")
    await until(lambda: not live.journal.alarms.standing([AlarmKind.NO_VEHICLE]), "the alarm is over")
    ended = await until_ended(service, mission.id)
    assert (ended.state, ended.vehicles[0].phase) == (MissionState.FINISHED, Phase.HOME)
    assert ended.reason in ("every step is done", "everybody has flown its way")


async def test_a_mission_that_waits_for_batteries_can_be_finished(service: MissionService) -> None:
    mission = await service.create(recovered("a", "b", steps=1000, **WAITS))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    for name in ("a", "b"):
        await call_home(live, name, "Ana")

    async def told() -> bool:
        return bool(await words_of(service, mission, "waiting"))

    await until(told, "both are home, and the operator is told")
    await act(service, mission.id, "finish", actor="Ana")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}
    assert not live.journal.alarms.standing([AlarmKind.NO_VEHICLE])


@pytest.mark.parametrize("limits", [{}, {"max_step_m": 8.0, "com_range_m": 500.0}], ids=["apart", "one team"])
@pytest.mark.parametrize("action", [Action.FINISH, pytest.param(Action.ABORT, marks=pytest.mark.slow)])
async def test_a_mission_that_is_ended_while_somebody_surveys_waits_for_no_batteries(
    service: MissionService, limits: dict[str, Any], action: Action
) -> None:
    mission = await service.create(recovered("a", "b", steps=1000, **(WAITS | ({"limits": limits} if limits else {}))))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    await call_home(live, "a", "Ana")
    await until(lambda: live.team.members["a"].is_home, "a is home")
    await service.act(live, action, actor="Ana", return_home=True)
    ended = await until_ended(service, mission.id)
    assert ended.state is (MissionState.FINISHED if action is Action.FINISH else MissionState.ABORTED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}
    assert await words_of(service, mission, "waiting") == []


@pytest.mark.slow
async def test_who_joins_while_everybody_goes_home_surveys_and_comes_home_too(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=lon_lat(15.0, -300.0), steps=4))
    await act(service, mission.id, "start")
    live = await service.get(mission.id)
    a = live.team.members["a"]
    await until(lambda: a.withdrawal is not None and a.flown.phase is Phase.RETURNING, "a is on its way home")
    b = VehicleSpec(name="b", kind=VehicleKind.SIM, start=lon_lat(15.0, 15.0))
    await service.team_changes.join(live, b, "Ana")
    ended = await until_ended(service, mission.id)
    assert {vehicle.name: vehicle.phase for vehicle in ended.vehicles} == {"a": Phase.HOME, "b": Phase.HOME}


async def test_nobody_joins_a_mission_that_is_ending(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=lon_lat(15.0, -300.0), steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    await act(service, mission.id, "finish")
    live = await service.get(mission.id)
    with pytest.raises(ConflictError, match="the mission is ending"):
        await service.team_changes.join(live, VehicleSpec(name="b", kind=VehicleKind.SIM), "Ana")
    await act(service, mission.id, "abort")


@pytest.mark.parametrize("limits", [{}, {"max_step_m": 8.0, "com_range_m": 500.0}], ids=["apart", "one team"])
async def test_a_mission_waits_for_who_is_held_by_a_failsafe(service: MissionService, limits: dict[str, Any]) -> None:
    spec = sim_spec("a", steps=1000, failsafes={"vehicle_error": "hold"}, **({"limits": limits} if limits else {}))
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    link = service.hub._links[VehicleKind.SIM]
    assert isinstance(link, SimFleetLink)
    link.fail("a", FaultKind.ERROR, "a fin is stuck")
    a = live.team.members["a"]
    await until(lambda: a.withdrawal is not None and a.withdrawal.led, "it is held")
    before = a.legs
    link.mend("a", FaultKind.ERROR)
    await until(lambda: a.withdrawal is None, "the error is over")
    await until(lambda: a.legs > before + 2, "a surveys again")
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_simulated_vehicles_are_where_they_were_when_the_service_restarts(harbour: Harbour) -> None:
    service = harbour.service
    vehicles = [{"name": name, "kind": "sim", "endurance_min": 30.0} for name in ("a", "b")]
    mission = await service.create(recovered(vehicles=vehicles, point=OUTSIDE, side_m=120.0, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    await call_home(live, "a", "Ana")
    a, b = live.team.members["a"], live.team.members["b"]
    began_m = b.place_m(live.frame)
    await until(lambda: a.flown.phase is Phase.HOME and math.dist(b.place_m(live.frame), began_m) > 40.0, "a is home")
    assert a.report is not None
    assert a.report.battery_pct is not None
    at_home_m, left_pct = a.place_m(live.frame), a.report.battery_pct
    assert left_pct < 99.0
    service = await harbour.reopen()
    live = await service.get(mission.id)
    a = live.team.members["a"]
    await until(lambda: a.report is not None and a.report.battery_pct is not None, "a is heard")
    assert math.dist(a.place_m(live.frame), at_home_m) < 3.0
    assert a.report is not None
    assert a.report.battery_pct == pytest.approx(left_pct, abs=0.5)
    await until(lambda: live.team.members["b"].legs > b.legs + 2, "b goes on")
    lon, lat, _ = np.array((await live.trails.newest())["b"]).T
    assert np.abs(np.diff(live.frame.to_local(lat, lon))).max() < 30.0, "it did not begin anew"
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_a_service_that_restarts_goes_on_bringing_everybody_home(harbour: Harbour) -> None:
    service = harbour.service
    mission = await service.create(recovered("a", "b", point=lon_lat(15.0, -300.0), steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    await service.act(await service.get(mission.id), Action.ABORT, actor="Ana", return_home=True)

    async def told() -> list[str]:
        return [words for words in await words_of(service, mission, "recovery") if " goes home: " in words]

    async def both_told() -> bool:
        return len(await told()) == 2

    await until(both_told, "both go home")
    service = await harbour.reopen()
    ended = await until_ended(service, mission.id)
    assert ended.state is MissionState.ABORTED
    assert ended.progress.step < 20, "nobody went on surveying"
    assert len(await told()) == 2, "each is told of once"
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}


async def until_ended(service: MissionService, mission_id: str) -> MissionView:
    async def ended() -> bool:
        return (await view_of(service, mission_id)).state not in (MissionState.RUNNING, MissionState.PAUSED)

    await until(ended, "the mission has ended")
    return await view_of(service, mission_id)


async def test_a_paused_mission_is_finished_at_home_too(service: MissionService) -> None:
    mission = await service.create(recovered("a", point=OUTSIDE, steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    await act(service, mission.id, "pause")
    assert (await act(service, mission.id, "finish")).mission.state is MissionState.RUNNING
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert [vehicle.phase for vehicle in ended.vehicles] == [Phase.HOME]


@pytest.mark.slow
async def test_vehicles_turn_back_in_time(harbour_closed: Harbour) -> None:
    """Five minutes of energy: it is home long before its steps are done, with some of it left."""
    # Its reserve is a minute: a machine that is busy for a second may not use that up.
    service = await harbour_closed.open(time_scale=12.0)
    vehicles = [{"name": "a", "kind": "sim", "endurance_min": 5.0}]
    spec = recovered(point=OUTSIDE, vehicles=vehicles, steps=1000)
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    (vehicle,) = ended.vehicles
    assert vehicle.phase is Phase.HOME
    assert ended.progress.step < 1000
    assert vehicle.energy_left_pct is not None
    assert 0.0 < vehicle.energy_left_pct < 70.0


async def test_vehicles_are_called_home_though_no_line_can_be_written(service: MissionService) -> None:
    mission = await service.create(recovered("a", "b", steps=1000, failsafes={"vehicle_error": "return"}))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    link = service.hub._links[VehicleKind.SIM]
    assert isinstance(link, SimFleetLink)
    async with live.journal._logging:
        for name in ("a", "b"):
            link.fail(name, FaultKind.ERROR, "a fin is stuck")
        await until(lambda: all(member.withdrawal is not None for member in live.team), "both are called home")
        assert not await words_of(service, mission, "failsafe")

    async def told() -> bool:
        return sum("a fin is stuck" in line for line in await words_of(service, mission, "failsafe")) == 2

    await until(told, "it is told why")
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_the_way_home_keeps_clear_of_zones(service: MissionService) -> None:
    spec = recovered(
        point=lon_lat(10.0, 8.0),
        side_m=70.0,
        steps=4,
        keep_out=[rectangle(0, 32, 45, 36)],
        limits={"max_step_m": 8.0, "keep_out_margin_m": 8.0},
        vehicles=[{"name": "a", "kind": "sim", "start": list(lon_lat(15.0, 60.0))}],
    )
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert [vehicle.phase for vehicle in ended.vehicles] == [Phase.HOME]
    assert not await words_of(service, mission, "boundary")


@pytest.mark.parametrize(
    ("recovery", "words"),
    [
        ({"point": lon_lat(0.0, -20_000.0)}, "from the area"),
        ({"point": lon_lat(15.0, 15.0)}, "keep_out.0"),
    ],
)
def test_recovery_points_are_near_and_clear(recovery: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        sim_spec("a", recovery=recovery, keep_out=[rectangle(10, 10, 20, 20)])


async def test_nobody_of_a_mission_that_ended_is_sent_on(service: MissionService) -> None:
    mission = await service.create(recovered("a", steps=3))
    live = await service.get(mission.id)
    with pytest.raises(ConflictError, match="the mission is ready: nobody is led"):
        await service.send_on(live, "a", "Ana")
    await act(service, mission.id, "start")
    await until_state(service, mission.id, MissionState.FINISHED)
    with pytest.raises(ConflictError, match="the mission is finished: nobody is led"):
        await service.send_on(live, "a", "Ana")
    with pytest.raises(ConflictError, match="the mission is finished: nobody is held"):
        await hold(live, "a", "Ana")
    assert await phase_of(service, mission, "a") is Phase.HOME
    assert not [line for line in await words_of(service, mission, "recovery") if "goes on" in line]


async def test_what_a_mission_that_was_finished_refuses_is_said_of_a_finished_one(service: MissionService) -> None:
    mission = await service.create(recovered("a", steps=1000))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    await act(service, mission.id, "finish")
    await until_state(service, mission.id, MissionState.FINISHED)
    live = await service.get(mission.id)
    with pytest.raises(ConflictError, match="the mission is finished: nobody is held"):
        await hold(live, "a", "Ana")
    with pytest.raises(ConflictError, match="the mission is finished: nobody is led") as refused:
        await call_home(live, "a", "Ana")
    assert "create a new mission" in refused.value.remedy


async def test_a_mission_in_steps_of_the_team_whose_vehicles_were_all_called_home_says_so(
    service: MissionService,
) -> None:
    limits = {"max_step_m": 5.0, "com_range_m": 200.0, "min_separation_m": 1.0}
    mission = await service.create(recovered("a", "b", steps=1000, limits=limits))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live = await service.get(mission.id)
    for name in ("a", "b"):
        await call_home(live, name, "Ana")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert ended.reason == "nobody surveys any more"
