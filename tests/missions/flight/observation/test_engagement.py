"""Vehicles are asked to follow until they do."""

import re
from dataclasses import replace
from datetime import datetime
from typing import Any

import pytest

from app.missions.clock import now
from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import FleetEvent, Position, RestartReport, VehicleInfo, VehicleReport
from app.missions.live.vehicle_reports import VehicleReports
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.team import Member
from app.storage.queries import telemetry as telemetry_queries
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, until_step
from tests.support.missions.specs import make_spec
from tests.support.waiting import until


async def test_a_vehicle_without_a_fix_is_no_reason_to_end_the_mission(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before its first fix a vehicle says that it is at 0, 0, which is on no mission's frame."""
    info, take = FleetHub.info, VehicleReports.take

    def without_a_fix(name: str) -> VehicleReport:
        return VehicleReport(name, 0.0, Position(0.0, 0.0, 0.0), None, None, None, None)

    def lost(hub: FleetHub, key: VehicleKey) -> VehicleInfo:
        told = info(hub, key)
        return replace(told, report=without_a_fix("b")) if key[1] == "b" else told

    def take_lost(reports: VehicleReports, event: FleetEvent, spec: MissionSpec, *, running: bool) -> None:
        at_zero = isinstance(event, VehicleReport) and event.vehicle == "b"
        take(reports, without_a_fix("b") if at_zero else event, spec, running=running)

    mission = await service.create(sim_spec("a", "b", steps=30))
    live = await service.get(mission.id)
    monkeypatch.setattr(FleetHub, "info", lost)
    monkeypatch.setattr(VehicleReports, "take", take_lost)
    foretold: list[Any] = []

    async def make(_spec: MissionSpec, *, members: list[Member], **_: object) -> None:
        foretold.extend(member.report for member in members)

    monkeypatch.setattr(service.forecaster, "make", make)
    await service.forecaster.of_mission(live)
    assert foretold == [None, None]
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 4)
    assert live.header.state is MissionState.RUNNING
    assert not live.team.members["b"].legs
    await act(service, mission.id, "abort")


async def test_a_vehicle_that_restarted_is_said_to_follow_again_however_soon_it_does(service: MissionService) -> None:
    mission = await service.create(sim_spec("a", "b", steps=30))
    live = await service.get(mission.id)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    live.reports.take(RestartReport("a", "DUNE on board has restarted"), live.spec, running=True)

    async def follows() -> bool:
        return [event.message for event in await events_after(live)].count("a follows") == 2

    await until(follows, "it follows again")
    assert live.team.named("a").engaged
    step = live.header.step
    await until_step(service, mission.id, step + 2)
    await act(service, mission.id, "abort")


@pytest.mark.slow
async def test_a_vehicle_that_is_not_heard_after_a_restart_is_said_to_have_been_heard_before(harbour: Harbour) -> None:
    service = harbour.service
    mission = (await service.create(make_spec(steps=200, vehicles=[{"name": "b", "kind": "rest"}]))).id
    began = now()
    async with Rover(service, mission, "b", 20, 20):
        await act(service, mission, "start")
        await until_step(service, mission, 1)

        async def stored() -> bool:
            async with harbour.database.reading() as session:
                return "b" in await telemetry_queries.last_heard(session, mission)

        await until(stored, "it is stored when it was heard")
    live = await (await harbour.reopen()).get(mission)

    async def told() -> list[str]:
        return [event.message for event in await events_after(live) if "not heard since" in event.message]

    await until(told, "it is missed")
    [said] = await told()
    found = re.search(r"^b: not heard since the service was started, last at ([0-9: -]+) UTC; let it post", said)
    assert found is not None, said
    assert abs((datetime.fromisoformat(found[1] + "+00:00") - began).total_seconds()) < 120.0
    assert "never heard" not in said
    await act(harbour.service, mission, "abort")
