"""Vehicles that fly on their own time: nobody waits, nobody is repeated, and whoever comes too close gets no leg."""

import asyncio
from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point, Polygon
from sqlalchemy import select

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import Position, WaypointOrder, WaypointReport, WaypointStatus
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.flight import runner
from app.missions.flight.decisions import deciding
from app.missions.flight.decisions.decision import Decision, decide
from app.missions.flight.legs.commit import NO_LEG, LegCommit
from app.missions.flight.legs.demand import MOST_AHEAD, LegDemand
from app.missions.flight.legs.exchange import LegExchange
from app.missions.flight.runner import nearest_leg
from app.missions.flight.survey_end import NOT_WAITED_FOR
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.safety import room
from app.missions.service import MissionService
from app.missions.states import MissionState
from app.missions.team import Member
from app.storage.database import Database
from app.storage.models import StepRow, WaypointRow
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, until_state
from tests.support.missions.specs import LAT, LON
from tests.support.waiting import until

pytestmark = pytest.mark.usefixtures("simulated_time")

APART = {"limits": {"max_step_m": 5.0, "min_separation_m": 0.0}}


class Flown:
    """What vehicles were ordered and what they told, as the link saw it, by vehicle."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ordered: dict[str, list[tuple[float, int]]] = defaultdict(list)
        self.ahead: dict[str, list[tuple[int, int]]] = defaultdict(list)
        """How many legs a vehicle had ahead when it got to the end of one: (step, legs)."""
        self.live: LiveMission | None = None
        self.held: dict[str, list[Position]] = defaultdict(list)
        order = SimFleetLink.order

        async def noted(link: SimFleetLink, waypoint: WaypointOrder) -> None:
            if waypoint.step == NO_LEG:
                self.held[waypoint.vehicle].append(waypoint.position)
            else:
                self.ordered[waypoint.vehicle].append((asyncio.get_running_loop().time(), waypoint.step))
            await order(link, waypoint)

        monkeypatch.setattr(SimFleetLink, "order", noted)
        start = SimFleetLink.start

        async def listening(link: SimFleetLink, sink: Any) -> None:
            def told(event: Any) -> None:
                reached = isinstance(event, WaypointReport) and event.status is WaypointStatus.REACHED
                if reached and self.live is not None:
                    legs = len(self.live.team.members[event.vehicle].ahead)
                    self.ahead[event.vehicle].append((event.step, legs))
                sink(event)

            await start(link, told)

        monkeypatch.setattr(SimFleetLink, "start", listening)


@pytest.mark.slow
async def test_no_vehicle_waits_for_a_decision_that_takes_long(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = Flown(monkeypatch)

    decided = deciding.Decider.decide

    async def slow(*arguments: Any, **more: Any) -> list[Decision]:
        await asyncio.sleep(0.2)
        return await decided(*arguments, **more)

    monkeypatch.setattr(deciding.Decider, "decide", slow)
    service = await harbour_closed.open(time_scale=5.0)
    mission = (await service.create(sim_spec(steps=12, side_m=60.0, planner={"name": "lawnmower"}, **APART))).id
    flown.live = await service.get(mission)
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    for name in ("a", "b"):
        assert sorted({step for _, step in flown.ordered[name]}) == list(range(1, 13))
        # Of a vehicle that waits for no decision, the next leg is written down before the one before it is flown.
        ahead = np.array([legs for step, legs in flown.ahead[name] if step < 12])
        assert (ahead >= 1).all(), ahead


@pytest.mark.slow
async def test_a_mission_ends_only_when_nothing_is_left_after_all_was_flown(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[bool] = []
    """Of each look after the third leg, whether all legs had been flown."""
    flown = Flown(monkeypatch)

    def seen_late(number: int, *arguments: Any, **more: Any) -> Decision:
        decision = decide(number, *arguments, **more)
        assert flown.live is not None
        [member] = flown.live.team
        all_flown = not member.ordered and not member.ahead
        if number < 4 or (number == 4 and all_flown):
            return decision
        # As long as legs are still to be flown nothing seems to be left.
        looked.append(all_flown)
        return replace(decision, legs=[], done=frozenset({member.name}))

    monkeypatch.setattr(deciding, "decide", seen_late)
    service = await harbour_closed.open(time_scale=5.0)
    mission = (await service.create(sim_spec("a", steps=12, side_m=60.0, planner={"name": "lawnmower"}, **APART))).id
    flown.live = await service.get(mission)
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    assert sorted({step for _, step in flown.ordered["a"]}) == [1, 2, 3, 4]
    assert not looked[0]
    assert looked[-1]


@pytest.mark.slow
async def test_everybody_flies_its_own_legs_and_a_step_is_begun_once(
    service: MissionService, database: Database
) -> None:
    mission = (await service.create(sim_spec("a", "b", "c", steps=6, side_m=60.0, **APART))).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    async with database.reading() as session:
        rows = (await session.scalars(select(WaypointRow))).all()
        steps = (await session.scalars(select(StepRow).order_by(StepRow.number))).all()
    assert [step.number for step in steps] == [1, 2, 3, 4, 5, 6]
    assert [bool(step.memory) for step in steps] == [False] * 5 + [True]
    flown = {name: sorted(row.step for row in rows if row.vehicle == name) for name in "abc"}
    assert flown == {name: [1, 2, 3, 4, 5, 6] for name in "abc"}
    assert {row.status for row in rows} == {"reached"}


async def test_a_vehicle_that_does_not_move_keeps_nobody(service: MissionService) -> None:
    vehicles = [{"name": "a", "kind": "sim"}, {"name": "stuck", "kind": "rest"}]
    mission = await service.create(sim_spec(steps=6, step_deadline_s=300, vehicles=vehicles, **APART))
    stuck = Rover(service, mission.id, "stuck")
    await stuck.post()
    begun = asyncio.get_running_loop().time()
    await act(service, mission.id, "start")
    async with asyncio.timeout(60):
        live = await service.get(mission.id)
        while (live.team.members["a"].legs, live.team.members["a"].ordered) != (6, False):  # noqa: ASYNC110
            await asyncio.sleep(0.05)
    # A step that waited for it would have taken its whole deadline.
    assert asyncio.get_running_loop().time() - begun < 300 / service.settings.time_scale * 6
    order = live.team.members["stuck"].order
    assert order is not None
    assert order.step == 1
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_a_vehicle_that_misses_a_leg_is_waited_for_until_it_has_missed_three(service: MissionService) -> None:
    vehicles = [{"name": "a", "kind": "sim"}, {"name": "stuck", "kind": "rest"}]
    mission = await service.create(sim_spec(steps=4, step_deadline_s=20, vehicles=vehicles, **APART))
    await Rover(service, mission.id, "stuck").post()
    await act(service, mission.id, "start")
    ended = await until_state(service, mission.id, MissionState.FINISHED)
    assert ended.reason == "every step is done but stuck"
    assert (await service.get(mission.id)).team.named("stuck").misses == NOT_WAITED_FOR == 3


@pytest.mark.slow
async def test_vehicles_that_meet_are_kept_apart_on_the_way(service: MissionService, database: Database) -> None:
    limits = {"max_step_m": 8.0, "min_separation_m": 6.0, "max_depth_m": 2.0, "min_depth_m": 2.0}
    frame, vehicles = LocalFrame(LAT, LON), []
    for name, east_m in (("a", 2.0), ("b", 8.0), ("c", 14.0)):
        lat, lon = map(float, frame.to_geographic(east_m, 2.0))
        vehicles.append({"name": name, "kind": "sim", "depth_m": 2.0, "start": [lon, lat]})
    spec = sim_spec(steps=16, side_m=30.0, vehicles=vehicles, limits=limits, planner={"name": "random"})
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    view = await until_state(service, mission, MissionState.FINISHED)
    assert view.progress.step == 16
    told = [line.message for line in await events_after(await service.get(mission)) if line.kind == "safety"]
    # On a busy machine legs are decided at other times, and of few it may be none.
    assert any("its next leg passes" in message for message in told)


@pytest.mark.slow
async def test_a_vehicle_that_comes_back_while_its_leg_is_written_gets_numbers_of_its_own(
    service: MissionService, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, gone = LegCommit._store, False

    async def stored_while_it_leaves(self: LegCommit, step: StepRow, rows: list[WaypointRow]) -> None:
        nonlocal gone
        await store(self, step, rows)
        if step.number == 2 and not gone:
            gone = True
            live = await service.get(self._live.id)
            await service.team_changes.take_out(live, "a", actor="Ana")
            await service.team_changes.rejoin(live, "a", actor="Ana")

    monkeypatch.setattr(LegCommit, "_store", stored_while_it_leaves)
    mission = (await service.create(sim_spec(steps=15, side_m=60.0, **APART))).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    async with database.reading() as session:
        rows = (await session.scalars(select(WaypointRow))).all()
    assert gone
    assert sorted(row.step for row in rows if row.vehicle == "b") == list(range(1, 16))
    assert max(row.step for row in rows if row.vehicle == "a") == 15


@pytest.mark.slow
async def test_who_comes_back_flies_as_many_legs_as_the_others_have_left_not_as_many_as_are_undecided(
    service: MissionService, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decisions that take long give vehicles many legs at once, here all of them."""
    monkeypatch.setattr(LegDemand, "legs_at_once", lambda *_: MOST_AHEAD)
    mission = (await service.create(sim_spec(steps=15, side_m=60.0, **APART))).id
    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: live.team.named("a").legs, "a leg")
    await service.team_changes.take_out(live, "a", actor="Ana")
    await until(lambda: live.team.named("b").legs == 15, "all legs of the other one")
    await service.team_changes.rejoin(live, "a", actor="Ana")
    of_b = live.team.named("b")
    flown = of_b.legs - len(of_b.ahead)
    await until_state(service, mission, MissionState.FINISHED)
    async with database.reading() as session:
        rows = (await session.scalars(select(WaypointRow))).all()
    assert len([row for row in rows if row.vehicle == "b"]) == 15
    assert len([row for row in rows if row.vehicle == "a" and row.step > flown]) == 15 - flown > 1


@pytest.mark.slow
async def test_vehicles_that_fall_silent_while_legs_are_exchanged_are_waited_for(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when an exchange waits for a full disk longer than vehicles may be silent."""
    silent: list[Member] = []
    look = LegExchange.look

    async def long_look(exchange: LegExchange) -> bool:
        changed = await look(exchange)
        if not silent and len(live.team.plannable) == 2:
            silent.extend(live.team.plannable)
            for member in silent:
                member.engaged = False
            asyncio.get_running_loop().call_later(0.3, come_back)
        return changed

    def come_back() -> None:
        for member in silent:
            member.engaged = True

    monkeypatch.setattr(LegExchange, "look", long_look)
    monkeypatch.setattr(LegDemand, "_lasts_s", lambda *_: 1e6)  # nobody is in a hurry, however slow the machine is
    service = await harbour_closed.open(time_scale=5.0)
    mission = (await service.create(sim_spec(steps=9, side_m=60.0, **APART))).id
    live = await service.get(mission)
    await act(service, mission, "start")
    view = await until_state(service, mission, MissionState.FINISHED)
    assert len(silent) == 2
    assert view.reason == "every step is done"


async def test_after_a_pause_no_leg_is_left_out_as_after_a_restart(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A later leg may pass the vehicle closer than the one that it flies."""
    monkeypatch.setattr(runner, "nearest_leg", lambda *_: 1)
    service = await harbour_closed.open(time_scale=2.0)
    mission = (await service.create(sim_spec("a", steps=60, side_m=60.0, **APART))).id

    async def left_out() -> int:
        await live.journal.flush()
        async with harbour_closed.database.reading() as session:
            rows = (await session.scalars(select(WaypointRow))).all()
        return sum("while nobody was there" in row.reason for row in rows)

    async def resumed(times: int) -> bool:
        return sum("going on after step" in event.message for event in await events_after(live)) == times

    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: len(live.team.named("a").ahead) >= 2, "several legs")
    await act(service, mission, "pause")
    await act(service, mission, "resume")
    await until(lambda: resumed(1), "it goes on")
    assert await left_out() == 0
    await until(lambda: len(live.team.named("a").ahead) >= 2, "several legs again")
    service = await harbour_closed.reopen(time_scale=2.0)
    live = await service.get(mission)
    await until(lambda: resumed(2), "it goes on")
    assert await left_out() == 1
    await act(service, mission, "abort")


@pytest.mark.slow
async def test_what_was_flown_is_the_same_after_the_service_started_again(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle tells where it is while the end is written down, too."""
    keep_flown = mission_queries.keep_flown

    async def slowly(*arguments: Any) -> None:
        await keep_flown(*arguments)
        heard = live.team.named("a").report
        await until(lambda: live.team.named("a").report is not heard, "it tells where it is meanwhile")

    monkeypatch.setattr(mission_queries, "keep_flown", slowly)
    service = await harbour_closed.open(time_scale=10.0)
    mission = (await service.create(sim_spec("a", steps=400, side_m=60.0, **APART))).id
    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: live.team.named("a").flown.on_plan_m > 10.0, "it flies")
    await act(service, mission, "finish")
    await until_state(service, mission, MissionState.FINISHED)
    before = live.team.named("a").flown.remember()
    service = await harbour_closed.reopen()
    assert (await service.get(mission)).team.named("a").flown.remember() == before


@pytest.mark.slow
async def test_a_fast_vehicle_flies_more_legs_in_the_same_minutes(harbour_closed: Harbour) -> None:
    service = await harbour_closed.open(time_scale=15.0)
    vehicles = [{"name": "fast", "kind": "sim", "speed_mps": 2.0}, {"name": "slow", "kind": "sim", "speed_mps": 0.8}]
    limits = {"max_step_m": 20.0, "min_separation_m": 0.0}
    spec = sim_spec(side_m=120.0, vehicles=vehicles, budget={"minutes": 4}, planner={"name": "cao"}, limits=limits)
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    view = await until_state(service, mission, MissionState.FINISHED)
    flown = {vehicle.name: vehicle for vehicle in view.vehicles}
    assert flown["fast"].on_plan_m > 1.8 * flown["slow"].on_plan_m > 0.0
    # Whoever is still on its last leg flies it to its end; a boundary is no place to stop at.
    assert flown["fast"].on_plan_m <= 1.25 * 2.0 * 240.0
    assert {str(vehicle.phase) for vehicle in view.vehicles} == {"stopped"}
    assert view.efficiency_pct is not None
    assert view.efficiency_pct > 50.0


@pytest.mark.slow
async def test_who_has_flown_everything_circles_inside_the_area(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = Flown(monkeypatch)
    service = await harbour_closed.open(time_scale=20.0)
    vehicles = [
        {"name": "fast", "kind": "sim", "speed_mps": 2.0},
        {"name": "slow", "kind": "sim", "speed_mps": 0.7},
    ]
    spec = sim_spec(
        side_m=100.0,
        vehicles=vehicles,
        budget={"km_per_vehicle": 0.15},
        # Nobody waits for the other to pass.
        limits={"max_step_m": 20.0, "min_separation_m": 0.0},
        planner={"name": "lawnmower"},
    )
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    assert flown.held["fast"]
    for place in flown.held["fast"]:
        east, north = spec.frame().to_local(np.array(place.lat_deg), np.array(place.lon_deg))
        assert Polygon(spec.local_area()).buffer(-room.CIRCLE_M + 0.01).contains(Point(float(east), float(north)))


@given(st.integers(0, 10_000))
def test_the_leg_that_goes_on_from_a_place_on_it_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = np.cumsum(rng.uniform(5.0, 20.0, (5, 2)), axis=0)  # never comes back
    which, part = int(rng.integers(1, 5)), rng.uniform(0.05, 0.95)
    place = ends[which - 1] + part * (ends[which] - ends[which - 1])
    assert nearest_leg(place, ends) == which
    before = ends[0] - rng.uniform(1.0, 20.0, 2)
    assert nearest_leg(before, ends) == 0


@pytest.mark.parametrize("part", [0.05, 0.5, 0.95])
def test_a_vehicle_in_the_middle_of_its_line_is_on_it_and_not_on_the_one_beside_it(part: float) -> None:
    begin = np.array([0.0, 150.0])
    ends = np.array([[0.0, 5.0], [25.0, 5.0], [25.0, 150.0], [50.0, 150.0]])
    assert nearest_leg(begin + part * (ends[0] - begin) + 1.0, ends, begin) == 0


@pytest.mark.slow
async def test_after_a_restart_the_rest_of_a_line_is_flown(harbour_closed: Harbour) -> None:
    service = await harbour_closed.open(time_scale=10.0)
    spec = sim_spec(
        "a",
        side_m=100.0,
        planner={"name": "lawnmower"},
        budget={"minutes": 10},
        limits={"max_step_m": 100.0},
    )
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    await act(service, mission, "start")

    def half_way() -> bool:
        member = live.team.named("a")
        if not (member.ordered and len(member.ahead) >= 2 and member.legs - len(member.ahead) >= 2):
            return False
        assert member.target_m is not None
        assert member.leg.start_m is not None
        long_m = np.hypot(*(member.target_m - member.leg.start_m))
        left_m = np.hypot(*(member.target_m - member.place_m(live.frame)))
        return bool(long_m > 50.0 and 0.3 * long_m < left_m < 0.7 * long_m)

    await until(half_way, "it is in the middle of a line")
    flown = live.team.named("a").legs - len(live.team.named("a").ahead)
    service = await harbour_closed.reopen(time_scale=10.0)
    live = await service.get(mission)
    await until(lambda: live.team.named("a").ordered, "it goes on")
    order = live.team.named("a").order
    assert order is not None
    assert order.step == flown
    await act(service, mission, "abort")


async def test_legs_that_are_barred_are_flown_another_way_and_none_goes_on_from_where_they_were_to_end(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[int] = []
    """Numbers of the legs that were looked at before they were begun."""
    dropped: list[np.ndarray] = []
    barred = LegCommit.barred

    def barred_once(committing: LegCommit, member: Member) -> str:
        begun.append(member.ahead[0].number)
        if not dropped and len(member.ahead) > 1 and member.ahead[0].number > 2:
            dropped.extend(leg.target_m for leg in member.ahead)
            return "something lies there"
        return barred(committing, member)

    monkeypatch.setattr(LegCommit, "barred", barred_once)
    service = await harbour_closed.open(time_scale=5.0)
    mission = (await service.create(sim_spec("a", steps=9, side_m=60.0, planner={"name": "lawnmower"}, **APART))).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    async with harbour_closed.database.reading() as session:
        rows = (await session.scalars(select(WaypointRow).order_by(WaypointRow.step))).all()
    reached = np.array([[row.east_m, row.north_m] for row in rows if row.status == WaypointStatus.REACHED])
    assert len(dropped) > 1
    assert sum(row.status == WaypointStatus.MISSED for row in rows) == len(dropped)
    for end in dropped:
        assert np.hypot(*(reached - end).T).min() <= 0.5
    steps = np.hypot(*np.diff(np.vstack([reached]), axis=0).T)
    assert steps.max() <= 2 * 5.0 + 1e-6, "each leg goes on from where its vehicle is"
