"""What nobody flies is no step, and what was decided while a link was away is sent all the same."""

from dataclasses import replace
from typing import Any

import pytest

from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import LinkState, VehicleRefusedError
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.flight.decisions import deciding
from app.missions.flight.decisions.decision import Decision, decide
from app.missions.flight.legs.commit import LegCommit
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.spec.vehicle import VehicleKind
from app.missions.states import MissionState
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import act, sim_spec, until_state, view_of
from tests.support.waiting import until

REASON = "leaves no safe depth"


async def test_a_step_in_which_every_order_is_refused_does_not_count(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoilt, asked = True, 0

    def refusing(*arguments: Any, **more: Any) -> Decision:
        nonlocal asked
        asked += 1
        decision = decide(*arguments, **more)
        return replace(decision, legs=[replace(leg, refusal=REASON) for leg in decision.legs]) if spoilt else decision

    monkeypatch.setattr(deciding, "decide", refusing)
    mission = (await service.create(sim_spec(steps=3))).id
    await act(service, mission, "start", actor="Ana")
    await until(lambda: asked >= 4, "it was decided again and again")
    view = await view_of(service, mission)
    assert view.progress.step == 0
    assert REASON in view.reason
    told = [event for event in await events_after(await service.get(mission)) if REASON in event.message]
    assert [event.level for event in told] == ["alarm"], "it is told once"
    spoilt = False
    view = await until_state(service, mission, MissionState.FINISHED)
    assert view.progress.step == 3
    assert {str(waypoint.status) for waypoint in view.waypoints} == {"reached"}
    assert REASON not in view.reason


async def test_a_step_that_every_vehicle_turns_down_is_sent_again(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    order, refused = FleetHub.order, 0

    async def refusing(hub: FleetHub, key: Any, waypoint: Any) -> None:
        nonlocal refused
        if refused < 4:
            refused += 1
            raise VehicleRefusedError(key[1], "not engaged", "Engage it first")
        await order(hub, key, waypoint)

    monkeypatch.setattr(FleetHub, "order", refusing)
    mission = (await service.create(sim_spec(steps=2))).id
    await act(service, mission, "start", actor="Ana")
    view = await until_state(service, mission, MissionState.FINISHED)
    assert refused == 4
    async with service._database.reading() as session:
        steps = [await mission_queries.waypoints_between(session, mission, number, number) for number in (1, 2)]
    assert view.progress.step == 2
    assert {row.status for rows in steps for row in rows} == {"reached"}


INSIDE = {"max_step_m": 8.0, "border_margin_m": 8.0}
"""No vehicle is carried out of the area by its turns, from where its next leg would be barred."""


async def test_a_waypoint_that_is_committed_while_the_link_is_away_is_sent(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit = LegCommit.commit

    async def committed_in_a_gap(self: LegCommit, decision: Decision, numbers: dict[str, int]) -> None:
        await commit(self, decision, numbers)
        for member in self._live.team:
            member.link = LinkState.LOST

    monkeypatch.setattr(LegCommit, "commit", committed_in_a_gap)
    mission = (await service.create(sim_spec(steps=2, side_m=60.0, step_deadline_s=200, limits=INSIDE))).id
    await act(service, mission, "start", actor="Ana")
    await until_state(service, mission, MissionState.FINISHED)
    async with service._database.reading() as session:
        steps = [await mission_queries.waypoints_between(session, mission, number, number) for number in (1, 2)]
    assert all(row.status in ("sent", "acknowledged", "reached") for rows in steps for row in rows)
    assert all(row.status == "reached" for row in steps[0]) or any(row.status != "planned" for row in steps[1])


async def test_a_vehicle_that_falls_silent_while_it_is_asked_is_lost(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def silenced(hub: FleetHub, key: VehicleKey) -> None:
        link = hub.link(VehicleKind.SIM)
        assert isinstance(link, SimFleetLink)
        link.silence(key[1])
        await until(lambda: hub.info(key).state is LinkState.LOST, "it is silent")
        raise VehicleRefusedError(key[1], "silent for 12 s, last heard at the surface", "Bring its link up first")

    monkeypatch.setattr(FleetHub, "engage", silenced)
    mission = (await service.create(sim_spec(steps=2))).id
    await act(service, mission, "start", actor="Ana")
    live = await service.get(mission)

    async def is_lost() -> bool:
        return any(event.level == "alarm" and "is lost" in event.message for event in await events_after(live))

    await until(is_lost, "it may follow us")
