"""What is taken for a failure of a vehicle, and what is not."""

from dataclasses import replace

import pytest

from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import LinkState, VehicleInfo, VehicleRefusedError
from app.missions.service import MissionService
from app.missions.spec.failsafes import Failsafe
from tests.support.missions.harbour import act, sim_spec, until_step
from tests.support.waiting import until


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
