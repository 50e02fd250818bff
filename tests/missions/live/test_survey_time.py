"""What the time in which a vehicle surveys takes of a mission that lasts so many minutes."""

from collections.abc import Awaitable, Callable
from functools import partial

import numpy as np
import pytest

from app.missions.clock import told_by
from app.missions.fleet.interface import LinkCapabilities, LinkState, Position, VehicleReport, WaypointOrder
from app.missions.fleet.interface import WaypointStatus as Status
from app.missions.flown import Flown, Phase
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.running import homecoming
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.states import MissionState
from app.missions.team import Member, Withdrawal, WithdrawalCause
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, view_of
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until

SPEED_MPS, MINUTES = 2.0, 30.0
TIME_SCALE = 50.0
"""Of the service."""
WHOLE_M = MINUTES * 60.0 * SPEED_MPS


class UnderWay:
    """A vehicle on a leg of 100 m, all of which is counted, as it reports where it is."""

    def __init__(self, live: LiveMission) -> None:
        self.live = live
        self.member: Member = live.team.join(live.spec.vehicles[0], 0)
        self.member.link = LinkState.ENGAGED
        self.member.committed.legs, self.member.committed.way_m = 1, 100.0
        self.member.target_m = np.array([10.0, 110.0])
        self.member.order = WaypointOrder(live.id, 1, "a", self.at(110.0), SPEED_MPS, 3.0, 1.0)
        self.member.status = Status.ACKNOWLEDGED
        self.reports(0.0, 10.0)

    def reports(self, time_s: float, north_m: float, *, standing: bool = False, running: bool = True) -> None:
        report = VehicleReport("a", time_s, self.at(north_m))
        self.live.reports.take(report, self.live.spec, running=running, standing=standing)

    def at(self, north_m: float) -> Position:
        lat, lon = self.live.frame.to_geographic(np.array(10.0), np.array(north_m))
        return Position(float(lat), float(lon), 2.0)

    @property
    def left_m(self) -> float:
        return self.member.way_left_m(self.live.spec)


@pytest.fixture
async def under_way(service: MissionService) -> Callable[..., Awaitable[UnderWay]]:
    async def made(**budget: float) -> UnderWay:
        asked = budget or {"minutes": MINUTES}
        spec = sim_spec("a", side_m=120.0, speed_mps=SPEED_MPS, budget=asked)
        live = await service.get((await service.create(spec)).id)
        live.header.state = MissionState.RUNNING
        return UnderWay(live)

    return made


Made = Callable[..., Awaitable[UnderWay]]


async def test_who_flies_its_leg_at_its_speed_has_what_its_legs_leave(under_way: Made) -> None:
    vehicle = await under_way()
    for time_s in (10.0, 20.0, 30.0):
        vehicle.reports(time_s, 10.0 + SPEED_MPS * time_s)
        assert vehicle.left_m == pytest.approx(WHOLE_M - 100.0, abs=0.1)


async def test_a_mission_in_minutes_never_shows_more_steps_than_it_has(under_way: Made) -> None:
    live = (await under_way()).live
    assert live.progress().steps == live.spec.steps
    live.header.step = live.spec.steps + 14
    assert live.progress().steps == live.spec.steps + 14


async def test_turns_and_waiting_take_the_time_that_they_take(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.reports(20.0, 10.0)
    assert vehicle.left_m == pytest.approx(WHOLE_M - 100.0 - 20.0 * SPEED_MPS, abs=0.1)
    vehicle.reports(45.0, 60.0)
    assert vehicle.left_m == pytest.approx(WHOLE_M - 100.0 - 20.0 * SPEED_MPS, abs=0.1)


async def test_who_is_faster_than_its_speed_gets_no_more_legs_for_that(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.reports(10.0, 100.0)
    assert vehicle.left_m == pytest.approx(WHOLE_M - 100.0)


async def test_the_way_into_the_area_is_no_time_of_the_survey(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.live.boundaries.forget("a")
    vehicle.reports(1.0, -200.0)
    before_s = vehicle.member.flown.survey_s
    for time_s, north_m in ((21.0, -160.0), (61.0, -80.0), (101.0, 0.5)):
        vehicle.reports(time_s, north_m)
    assert vehicle.member.flown.phase is Phase.TRANSIT
    assert vehicle.member.flown.survey_s == before_s
    vehicle.reports(111.0, 20.5)
    assert vehicle.member.flown.survey_s == before_s + 10.0


async def test_a_silence_is_time_too(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.reports(600.0, 110.0)
    assert vehicle.left_m == pytest.approx(WHOLE_M - 600.0 * SPEED_MPS, abs=0.1)


async def test_a_clock_that_is_set_forward_is_no_time_and_no_energy(under_way: Made, service: MissionService) -> None:
    vehicle = await under_way()
    vehicle.member.capabilities = LinkCapabilities()
    report = partial(VehicleReport, "a", position=vehicle.at(10.0), speed_mps=SPEED_MPS, battery_pct=90.0)
    used_s = vehicle.member.energy.used_s

    def told(clock_s: float, at_s: float) -> float:
        with told_by(lambda: 1.7e9 + at_s / service.settings.time_scale):
            vehicle.live.reports.take(report(time_s=clock_s), vehicle.live.spec, running=True)
        return vehicle.member.flown.survey_s

    vehicle.member.report = vehicle.member.clock_ahead_s = None
    assert told(100.0, 0.0) == 0.0
    assert told(110.0, 10.0) == 10.0
    assert told(3720.0, 20.0) == pytest.approx(20.0), "it was set forward by an hour"
    assert told(3730.0, 30.0) == pytest.approx(30.0)
    assert told(140.0, 40.0) == pytest.approx(30.0), "it was set back"
    assert told(3750.0, 50.0) == pytest.approx(40.0), "and forward again"
    assert told(4350.0, 650.0) == pytest.approx(640.0), "a silence is time"
    for late_s in (4450.0, 4550.0, 4650.0):
        told(late_s, 1250.0)
    assert vehicle.member.flown.survey_s == pytest.approx(940.0), (
        "what comes late, all at once, tells of time that has passed"
    )
    assert vehicle.member.energy.used_s - used_s == pytest.approx(940.0, abs=1.0)


@pytest.mark.parametrize("how", ["standing", "paused", "surfacing", "held", "on its way there"])
async def test_time_that_is_not_spent_surveying_does_not_count(under_way: Made, how: str) -> None:
    vehicle = await under_way()
    member = vehicle.member
    member.surfacing = how == "surfacing"
    member.withdrawal = Withdrawal(Response.HOLD, "a person wants it", asked=True) if how == "held" else None
    member.committed.legs = 0 if how == "on its way there" else 1
    for time_s in (30.0, 60.0):
        vehicle.reports(time_s, 10.0, standing=how == "standing", running=how != "paused")
    member.surfacing, member.withdrawal, member.committed.legs = False, None, 1
    vehicle.reports(60.0, 10.0)
    assert vehicle.left_m == pytest.approx(WHOLE_M - 100.0)
    assert member.flown.phase is Phase.SURVEY


async def test_kilometres_are_those_of_legs_however_long_they_take(under_way: Made) -> None:
    vehicle = await under_way(km_per_vehicle=2.0)
    vehicle.reports(500.0, 20.0)
    assert vehicle.left_m == pytest.approx(2000.0 - 100.0)
    assert vehicle.member.flown.survey_s == pytest.approx(500.0)


async def test_who_comes_back_has_used_its_time(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.reports(50.0, 10.0)
    left_m, team = vehicle.left_m, vehicle.live.team
    team.leave("a", vehicle.live.header.created_at)
    again = team.join(vehicle.live.spec.vehicles[0], 0)
    assert again.way_left_m(vehicle.live.spec) == left_m < WHOLE_M - 100.0


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_vehicles_that_wait_for_each_other_all_the_time_survey_for_their_minutes(service: MissionService) -> None:
    limits = {"max_step_m": 8.0, "min_separation_m": 5.0, "max_depth_m": 2.0, "min_depth_m": 2.0}
    vehicles = [{"name": name, "kind": "sim", "depth_m": 2.0} for name in "abc"]
    spec = sim_spec(side_m=40.0, vehicles=vehicles, limits=limits, planner={"name": "random"}, budget={"minutes": 4.0})
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    live = await service.get(mission)
    survey_s = np.array([member.flown.survey_s for member in live.team])
    # The legs that a vehicle has when its time is up are flown to their end, with what it has to wait there: up to a
    # minute for each of two or three. Waiting that does not count made 22 minutes of the four.
    assert np.median(survey_s) < 240.0 + 180.0, survey_s
    assert survey_s.min() > 240.0 - 30.0, survey_s
    assert max(member.committed.way_m for member in live.team) < 240.0 * live.spec.speed_mps + 1.0


@pytest.mark.parametrize("budget", [{"minutes": MINUTES}, {"km_per_vehicle": WHOLE_M / 1000.0}])
async def test_a_survey_takes_as_long_as_is_left_of_its_budget(under_way: Made, budget: dict[str, float]) -> None:
    """However long its legs took: they are as long as its lines are."""
    vehicle = await under_way(**budget)
    live = vehicle.live
    live.reports.leg_s = 3.0
    for time_s in (10.0, 11.0):
        vehicle.reports(time_s, 30.0)
    progress = live.progress()
    assert progress.minutes_left is not None
    assert progress.eta_s is not None
    assert 0.9 * MINUTES < progress.minutes_left <= MINUTES
    assert progress.eta_s == pytest.approx(60.0 * progress.minutes_left / TIME_SCALE)


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_a_survey_with_lines_at_a_distance_ends_with_the_last_of_them_and_says_when(
    service: MissionService,
) -> None:
    limits = {"max_step_m": 30.0, "max_depth_m": 2.0, "min_depth_m": 2.0}
    planner = {"name": "lawnmower", "options": {"line_spacing_m": 20.0, "line_heading_deg": 90.0}}
    home = {"point": list(lon_lat(-10.0, -10.0))}
    spec = sim_spec(side_m=100.0, cell_m=4.0, limits=limits, planner=planner, budget={"minutes": 90.0}, recovery=home)
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    live = await service.get(mission)
    told_s: list[float] = []

    async def ended() -> bool:
        progress = live.progress()
        if live.header.state is MissionState.RUNNING and live.team.going_on and progress.terms:
            told_s.append(progress.eta_s or 0.0)
        return live.header.state is MissionState.FINISHED

    await until(ended, "the mission has ended")
    flown_s = max(member.flown.survey_s for member in live.team)
    lines_s = 5 * 99.0 / 2 / live.spec.speed_mps
    assert lines_s < flown_s < 3.0 * lines_s < 0.2 * 90 * 60.0, (
        "with turns, ways to lines, and half a line more for one"
    )
    assert max(told_s) < 2.0 * lines_s, "the time that is left of the budget is not told"
    assert live.header.reason == "all lines are flown"
    told = [event.message for event in await events_after(live)]
    assert {f"{name} goes home: no line is left for it" for name in "ab"} <= set(told)


async def test_when_everybody_goes_home_no_leg_is_to_come(under_way: Callable[..., Awaitable[UnderWay]]) -> None:
    vehicle = await under_way(minutes=MINUTES)
    live = vehicle.live
    assert (live.progress().eta_s or 0.0) > 100.0 / TIME_SCALE
    vehicle.member.withdrawal = Withdrawal(Response.RETURN, "called home by Ana")
    assert live.progress().eta_s == 0.0


async def test_the_way_home_is_not_left_of_the_survey(under_way: Made) -> None:
    vehicle = await under_way(km_per_vehicle=0.1)
    member = vehicle.member
    for time_s in (10.0, 11.0):
        vehicle.reports(time_s, 30.0)
    assert member.flown.left_m == pytest.approx(80.0, abs=0.1), "of the only leg that it may fly"
    member.withdrawal = Withdrawal(Response.RETURN, "it has flown its way", cause=WithdrawalCause.PART_DONE)
    vehicle.reports(20.0, 50.0)
    assert member.flown.left_m == 0.0


async def test_who_is_held_or_home_waits_for_no_decision(under_way: Callable[..., Awaitable[UnderWay]]) -> None:
    vehicle = await under_way(minutes=MINUTES)
    member = vehicle.member
    member.drop_order()
    vehicle.reports(10.0, 20.0)
    assert member.flown.idle_s == 10.0
    for response in (Response.HOLD, Response.RETURN):
        member.withdrawal = Withdrawal(response, "asked by Ana", over=response is Response.RETURN)
        vehicle.reports(member.report.time_s + 10.0 if member.report else 0.0, 20.0)
    assert member.flown.idle_s == 10.0


async def test_what_was_flown_is_stored_with_the_track(under_way: Made, service: MissionService) -> None:
    """A process that is killed leaves both as of the same moment."""
    vehicle = await under_way()
    live = vehicle.live
    for time_s in (5.0, 10.0, 15.0):
        vehicle.reports(time_s, 10.0 + SPEED_MPS * time_s)
        await live.journal.flush()
    async with live.database.reading() as session:
        (row,) = await mission_queries.vehicles_of(session, live.id)
        positions = await mission_queries.last_positions(session, live.id)
    stored = Flown.recall(row.flown)
    assert positions["a"].time_s == 15.0
    assert stored.flown_m == pytest.approx(30.0, abs=0.1)
    assert stored.remember() == vehicle.member.flown.remember()


async def test_while_the_service_was_down_nobody_was_idle(under_way: Made) -> None:
    vehicle = await under_way()
    vehicle.member.drop_order()
    vehicle.reports(5.0, 10.0)
    assert vehicle.member.flown.idle_s == 5.0
    # As it is known after a restart: where it was last, and nothing of its clock.
    vehicle.member.clock_ahead_s = None
    vehicle.reports(12.0, 10.0)
    assert vehicle.member.flown.idle_s == 5.0
    vehicle.reports(14.0, 10.0)
    assert vehicle.member.flown.idle_s == 7.0


@pytest.mark.slow
async def test_of_a_mission_that_ended_phase_and_battery_are_told_after_a_restart(harbour_closed: Harbour) -> None:
    service = await harbour_closed.open(time_scale=20.0)
    spec = sim_spec("a", side_m=40.0, budget={"minutes": 5}, recovery={"point": lon_lat(5.0, 5.0)})
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: live.team.named("a").flown.on_plan_m > 5.0, "it surveys")
    await homecoming.call_home(live, "a", "Ana")
    before = (await until_state(service, mission, MissionState.FINISHED)).vehicles[0]
    service = await harbour_closed.reopen()
    after = (await view_of(service, mission)).vehicles[0]
    assert (before.phase, after.phase) == (Phase.HOME, Phase.HOME)
    assert before.battery_pct is not None
    assert after.battery_pct == pytest.approx(before.battery_pct, abs=1.0)
    assert after.energy_left_pct == pytest.approx(before.energy_left_pct, abs=2.0)
    figures = ("flown_m", "on_plan_m", "idle_s")
    # What it drifts at home until the service ends is written down with the next thing that happens.
    expected = [pytest.approx(getattr(before, name), abs=0.5) for name in figures]
    assert [getattr(after, name) for name in figures] == expected
