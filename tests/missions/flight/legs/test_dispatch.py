"""Legs that take too long: each is ended once, and nobody's next one with it."""

import asyncio

import numpy as np
import pytest

from app.missions.fleet.interface import (
    LinkState,
    Position,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from app.missions.team import Member, Withdrawal
from app.missions.views.mission import Level
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import LAT, LON
from tests.support.waiting import until


def send_on(live: LiveMission, member: Member, step: int) -> None:
    """Let a vehicle fly a leg that is late at once."""
    place = Position(LAT + 1e-4, LON + 1e-4, 2.0)
    member.report = VehicleReport(member.name, 0.0, place)
    member.set_order(WaypointOrder(live.id, step, member.name, place, 1.0, 3.0, 1.0), np.array([9.0, 9.0]))
    member.link, member.status = LinkState.ENGAGED, WaypointStatus.ACKNOWLEDGED
    member.leg.began_s, member.leg.allowed_s = asyncio.get_running_loop().time(), 0.0


@pytest.fixture
async def late(service: MissionService) -> tuple[LiveMission, Dispatch]:
    live = await service.get((await service.create(sim_spec("a", "b"))).id)
    committing = LegCommit(live, make_constraints(live.spec), leads=True)
    for vehicle in live.spec.vehicles:
        if live.team.get(vehicle.name) is None:
            live.team.join(vehicle, len(live.team.members))
    for member in live.team:
        member.followed = member.engaged = True
        send_on(live, member, 1)
    return live, Dispatch(live, service.hub, committing, 1.0, persistent=False)


async def test_a_vehicle_that_is_sent_on_while_others_lateness_is_written_down_keeps_its_leg(
    late: tuple[LiveMission, Dispatch], monkeypatch: pytest.MonkeyPatch
) -> None:
    live, dispatch = late
    log = live.journal.log

    async def slow(level: Level, kind: str, message: str, **details: object) -> None:
        # Meanwhile another task finds the second one late as well, and sends it on.
        second = live.team.members["b"]
        if kind == "straggler" and second.order is not None and second.order.step == 1:
            if second.ordered:
                dispatch.settle(second, WaypointStatus.MISSED, "late")
            send_on(live, second, 2)
        await log(level, kind, message, **details)

    monkeypatch.setattr(live.journal, "log", slow)
    assert {member.name for member in await dispatch.settle_late()} == {"a", "b"}
    second = live.team.members["b"]
    assert second.order is not None
    assert (second.order.step, second.ordered) == (2, True)


async def test_a_way_home_that_is_given_up_gives_a_vehicle_no_more_to_fly(late: tuple[LiveMission, Dispatch]) -> None:
    live, dispatch = late
    member = live.team.members["a"]
    member.committed.way_m = 500.0
    LegCommit(live, make_constraints(live.spec), leads=True).lead_home(
        member, [(np.array([50.0, 9.0]), 2.0), (np.array([90.0, 9.0]), 2.0), (np.array([90.0, 9.0]), 0.0)]
    )
    assert len(dispatch.give_up_legs(member, "b lies on its way home")) == 4
    assert (member.committed.way_m, member.committed.spared) == (500.0, 0)


async def test_only_those_that_are_asked_about_are_judged(late: tuple[LiveMission, Dispatch]) -> None:
    live, dispatch = late
    first, second = live.team.members["a"], live.team.members["b"]
    assert await dispatch.settle_late([second]) == [second]
    assert (first.ordered, second.ordered) == (True, False)


async def test_a_leg_that_was_given_up_is_over_whatever_its_vehicle_still_tells_of_it(
    late: tuple[LiveMission, Dispatch],
) -> None:
    """Else who is held, or called home, just when a leg is sent to it has that leg to fly again."""
    live, dispatch = late
    member = live.team.members["a"]
    member.status = WaypointStatus.SENT
    dispatch.give_up_legs(member, "held by Ana")
    for status in (WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED):
        live.receive(WaypointReport("a", live.id, 1, status))
        assert not member.ordered
        assert member.status is WaypointStatus.MISSED
    member.withdrawal = Withdrawal(Response.HOLD, "held by Ana")
    assert await dispatch.settle_late([member]) == []


async def test_who_is_left_alone_with_another_console_keeps_its_leg(late: tuple[LiveMission, Dispatch]) -> None:
    live, dispatch = late
    first, second = live.team.members["a"], live.team.members["b"]
    for member in (first, second):
        member.leg.allowed_s = 0.05
    first.link, first.engaged = LinkState.READY, False
    keeping = asyncio.create_task(dispatch.keep())
    await until(lambda: not second.ordered, "the other one is late")
    assert first.ordered
    first.link, first.engaged = LinkState.ENGAGED, True
    live.changed.set()
    await until(lambda: not first.ordered, "it follows again, and is late")
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
