"""What is taken for a failure of a vehicle, and what is not."""

from dataclasses import replace

import pytest

from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import LinkState, Position, VehicleInfo, VehicleRefusedError, VehicleReport
from app.missions.flight.decisions.decision import make_constraints
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.way_home.failsafe_watch import FailsafeWatch
from app.missions.service import MissionService
from app.missions.spec.failsafes import Failsafe
from tests.support.missions.harbour import act, sim_spec, until_step
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until


async def test_one_whose_way_home_cannot_be_told_keeps_nobody_from_looking_after_the_others(
    service: MissionService,
) -> None:
    recovery = {"point": lon_lat(2, 2)}
    live = await service.get((await service.create(sim_spec("a", "b", recovery=recovery))).id)
    a, b = live.team.members["a"], live.team.members["b"]
    lon, lat = lon_lat(20, 20)
    for member in (a, b):
        member.report = VehicleReport(member.name, 0.0, Position(lat, lon, 2.0))
    # As a description of before this was checked has it.
    a.spec = a.spec.model_copy(update={"recovery_point": (lat, lon)})
    constraints = make_constraints(live.spec)
    committing = LegCommit(live, constraints, leads=True)
    await FailsafeWatch(live, service.hub, EnergyRange(live, constraints, committing), 1.0).look()
    assert a.way_home_m is None
    assert b.way_home_m is not None


async def test_only_who_is_heard_can_follow_another_console(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle that starts anew announces itself before it speaks, and can only be refused meanwhile."""
    info, age_s = FleetHub.info, 40.0

    def told(hub: FleetHub, key: VehicleKey) -> VehicleInfo:
        known = info(hub, key)
        return replace(known, state=LinkState.HEARD, age_s=age_s) if key[1] == "b" else known

    async def refuse(_hub: FleetHub, key: VehicleKey) -> None:
        raise VehicleRefusedError(key[1], "it executes a plan of another console", "Stop that plan")

    mission = await service.create(sim_spec("a", "b", steps=1000))
    live = await service.get(mission.id)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    b = live.team.members["b"]
    monkeypatch.setattr(FleetHub, "engage", refuse)
    monkeypatch.setattr(FleetHub, "info", told)
    await until(lambda: bool(b.refusal), "it refuses")
    step = live.header.step
    await until_step(service, mission.id, step + 8)
    assert not [one for one in b.failsafes if one.failsafe is Failsafe.OTHER_CONSOLE]
    age_s = 0.2
    await until(lambda: any(one.failsafe is Failsafe.OTHER_CONSOLE for one in b.failsafes), "somebody else has it")
    await act(service, mission.id, "abort")
