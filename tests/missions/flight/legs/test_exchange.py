"""Legs that are not begun are exchanged for better ones: all of them and the planner's memory, or nothing."""

import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

from app.arrays import FloatArray
from app.exploration.planner.ordered import OrderedPlanner
from app.missions.fleet.interface import LinkState, Position, VehicleReport, WaypointStatus
from app.missions.flight.decisions import deciding
from app.missions.flight.decisions.deciding import Decider, moved_on, place_ahead
from app.missions.flight.decisions.decision import Decision, decide
from app.missions.flight.decisions.step_maps import StepMaps
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.legs.exchange import LegExchange
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.task.constraints import make_constraints
from app.missions.task.planner import make_planner
from app.missions.team import Member
from app.storage.database import Database
from app.storage.models import StepRow, WaypointRow
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import sim_spec

LEGS = 4
TIME_SCALE = 0.01
"""So that a leg lasts long beside a decision, however busy the machine is."""
ASIDE_M = 0.4


async def _at_once() -> None:
    """Everything is compiled."""


class Flight:
    """Two vehicles that each fly a leg and have others ahead, and what decides and commits these."""

    def __init__(self, live: LiveMission, executor: ThreadPoolExecutor) -> None:
        self.live = live
        spec = live.spec
        constraints = make_constraints(spec)
        self.planner = OrderedPlanner(make_planner(spec))
        self.leg_commit = LegCommit(live, constraints, leads=False)
        maps = StepMaps(live, executor, TIME_SCALE, 0.2, _at_once)
        self.decider = Decider(live, constraints, self.planner, maps, executor)
        ways = EnergyRange(live, constraints, self.leg_commit)
        self.exchange = LegExchange(live, self.decider, self.leg_commit, ways, TIME_SCALE)

    async def begin(self) -> None:
        for slot, vehicle in enumerate(self.live.spec.vehicles):
            member = self.live.team.join(vehicle, slot)
            member.engaged, member.link = True, LinkState.READY
            self.put(member, np.array([5.0, 5.0 + 10.0 * slot]))
        self.sound()
        places = [replace(place_ahead(m, self.live), left_m=300.0) for m in self.live.team]
        for number, decision in enumerate(await self.decider.decide(1, places, legs=LEGS), 1):
            await self.leg_commit.commit(decision, {place.vehicle: number for place in places})
            places = moved_on(places, decision)
        for member in self.live.team:
            self.leg_commit.begin_next(member)
            member.status = WaypointStatus.SENT

    def put(self, member: Member, en_m: FloatArray) -> None:
        lat, lon = self.live.frame.to_geographic(np.array(en_m[0]), np.array(en_m[1]))
        member.report = VehicleReport(member.name, 0.0, Position(float(lat), float(lon), 2.0))

    def sound(self, seed: int = 0) -> None:
        """Have soundings that the newest map does not hold."""
        rng = np.random.default_rng(seed)
        east, north = rng.uniform(1.0, 59.0, (2, 40))
        self.live.builder.add(np.column_stack([east, north, 10.0 + 0.1 * east, np.full(40, 0.05)]))
        self.live.builder.build()

    def ahead(self) -> dict[str, list[tuple[int, float, float]]]:
        return {m.name: [(leg.number, *leg.target_m.tolist()) for leg in m.ahead] for m in self.live.team}

    async def stored(self, database: Database) -> dict[str, list[tuple[int, float, float]]]:
        """The legs after the first of each vehicle, as they are written down."""
        async with database.reading() as session:
            rows = (await session.scalars(select(WaypointRow).order_by(WaypointRow.step))).all()
        return {
            m.name: [(row.step, row.east_m, row.north_m) for row in rows if row.vehicle == m.name and row.step > 1]
            for m in self.live.team
        }

    async def memory(self, database: Database) -> bytes:
        async with database.reading() as session:
            return (await session.scalars(select(StepRow.memory).order_by(StepRow.number.desc()))).all()[0]


@pytest.fixture
async def flight(service: MissionService) -> AsyncIterator[Flight]:
    planner = {"name": "cao", "options": {"search": 50}}
    limits = {"max_step_m": 8.0, "min_separation_m": 3.0}
    spec = sim_spec(budget={"minutes": 5}, side_m=60.0, planner=planner, limits=limits)
    live = await service.get((await service.create(spec)).id)
    with ThreadPoolExecutor(1) as executor:
        flight = Flight(live, executor)
        await flight.begin()
        yield flight


def finding(monkeypatch: pytest.MonkeyPatch, change: Callable[[FloatArray], FloatArray]) -> None:
    """Have decisions find other ends of legs than they do."""

    def decided(*arguments: Any, **more: Any) -> Decision:
        decision = decide(*arguments, **more)
        return replace(decision, legs=[replace(leg, target_m=change(leg.target_m)) for leg in decision.legs])

    monkeypatch.setattr(deciding, "decide", decided)


def aside(target_m: FloatArray) -> FloatArray:
    """Return a place beside a target, towards the middle of the area."""
    return np.append(target_m[:2] + np.sign(30.0 - target_m[:2]) * ASIDE_M, target_m[2:])


async def test_legs_that_come_out_the_same_stay(flight: Flight, database: Database) -> None:
    before = flight.ahead()
    assert {len(legs) for legs in before.values()} == {LEGS - 1}
    flight.exchange._looked_at = flight.live.builder.newest
    assert not await flight.exchange.look()  # no newer map
    flight.sound(1)
    assert not await flight.exchange.look()
    assert flight.ahead() == before == await flight.stored(database)
    assert flight.exchange._looked_at is flight.live.builder.newest


async def test_better_legs_replace_those_ahead_with_their_numbers(
    flight: Flight, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, way_m = flight.ahead(), {m.name: m.committed.way_m for m in flight.live.team}
    finding(monkeypatch, aside)
    flight.sound(1)
    assert await flight.exchange.look()
    after = flight.ahead()
    for name, legs in after.items():
        assert [leg[0] for leg in legs] == [leg[0] for leg in before[name]]
        for (_, east, north), (_, east_before, north_before) in zip(legs, before[name], strict=True):
            assert (east, north) != (east_before, north_before)
    assert after == await flight.stored(database)
    assert await flight.memory(database) == flight.planner.snapshot()
    for member in flight.live.team:
        lengths_m = []
        for legs in (before[member.name], after[member.name]):
            assert member.target_m is not None
            ends = np.array([member.target_m, *(leg[1:] for leg in legs)])
            lengths_m.append(float(np.hypot(*np.diff(ends, axis=0).T).sum()))
        assert member.committed.way_m - way_m[member.name] == pytest.approx(lengths_m[1] - lengths_m[0])


async def test_what_could_not_be_written_leaves_everything_as_it_was(
    flight: Flight, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process ends in the middle of the transaction: there the old legs are, with the memory they came with."""

    class EndedError(Exception):
        pass

    async def ending(*_: Any) -> None:
        raise EndedError

    before, memory, remembered = flight.ahead(), await flight.memory(database), flight.planner.snapshot()
    finding(monkeypatch, aside)
    flight.sound(1)
    monkeypatch.setattr(mission_queries, "remember", ending)
    with pytest.raises(EndedError):
        await flight.exchange.look()
    assert flight.ahead() == before == await flight.stored(database)
    assert await flight.memory(database) == memory
    assert flight.planner.snapshot() == remembered


async def test_a_leg_that_begins_soon_stays(
    flight: Flight, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = flight.ahead()
    soon, later = flight.live.team
    assert soon.target_m is not None
    flight.put(soon, soon.target_m)
    finding(monkeypatch, aside)
    flight.sound(1)
    assert await flight.exchange.look()
    after = flight.ahead()
    assert after[soon.name][0] == before[soon.name][0]
    assert after[soon.name][1:] != before[soon.name][1:]
    assert after[later.name][0] != before[later.name][0]
    assert after == await flight.stored(database)


async def test_a_leg_that_was_begun_meanwhile_is_not_exchanged_and_the_planner_knows(
    flight: Flight, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory, early = flight.planner.snapshot(), next(iter(flight.live.team))

    def begins(target_m: FloatArray) -> FloatArray:
        if len(early.ahead) == LEGS - 1:
            flight.leg_commit.begin_next(early)
        return aside(target_m)

    before = await flight.stored(database)
    finding(monkeypatch, begins)
    flight.sound(1)
    assert not await flight.exchange.look()
    assert before == await flight.stored(database)
    assert flight.planner.snapshot() == memory
    assert early.order is not None
    assert early.order.step == 2
    assert len(early.ahead) == LEGS - 2


@pytest.mark.parametrize("where", ["too close", "outside"])
async def test_legs_that_may_not_be_flown_replace_none(
    flight: Flight, database: Database, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    before, memory = flight.ahead(), flight.planner.snapshot()

    def together(*arguments: Any, **more: Any) -> Decision:
        decision = decide(*arguments, **more)
        if where == "outside":
            return replace(decision, legs=[replace(leg, refusal="outside of the area") for leg in decision.legs])
        place = decision.legs[0].target_m
        return replace(decision, legs=[replace(leg, target_m=place) for leg in decision.legs])

    monkeypatch.setattr(deciding, "decide", together)
    flight.sound(1)
    assert not await flight.exchange.look()
    assert flight.ahead() == before == await flight.stored(database)
    assert flight.planner.snapshot() == memory


async def test_legs_decided_together_do_not_count_as_one_slow_decision(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else more legs would be decided together the next time, and more still after that, while vehicles wait."""

    def slow(*arguments: Any, **more: Any) -> Decision:
        time.sleep(0.05)
        return decide(*arguments, **more)

    monkeypatch.setattr(deciding, "decide", slow)
    flight.decider.takes_s = 0.0
    places = [replace(place_ahead(m, flight.live), left_m=300.0) for m in flight.live.team]
    began_s = time.monotonic()
    decisions = await flight.decider.decide(LEGS + 1, places, legs=LEGS)
    assert len(decisions) == LEGS
    assert flight.decider.takes_s <= (time.monotonic() - began_s) / LEGS
