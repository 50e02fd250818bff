"""Vehicles as missions take them: what takes long then keeps nobody waiting."""

import asyncio
import threading

import pytest

from app.missions.fleet.links import sim
from app.missions.fleet.links.simulated.launch import FloorPatch, lay
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import MissionState
from simulator.floors.terrain import Terrain
from tests.support.missions.harbour import act, sim_spec, state_of
from tests.support.waiting import until


class SlowLaying:
    """Lays sea floors when it is told to."""

    def __init__(self) -> None:
        self.begun = 0
        self.released = threading.Event()

    def __call__(self, settings: SimulationSettings, patch: FloorPatch) -> Terrain:
        self.begun += 1
        assert self.released.wait(30.0), "the service waits for it"
        return lay(settings, patch)


@pytest.fixture
def laying(monkeypatch: pytest.MonkeyPatch) -> SlowLaying:
    slow = SlowLaying()
    monkeypatch.setattr(sim, "lay", slow)
    return slow


async def test_other_missions_go_on_while_a_sea_floor_is_laid(service: MissionService, laying: SlowLaying) -> None:
    mission_id = (await service.create(sim_spec("a", "b"))).id
    starting = asyncio.create_task(act(service, mission_id, "start"))
    await until(lambda: laying.begun == 1, "a floor is being laid")
    other = await service.create(sim_spec("c"))
    assert await state_of(service, other.id) is MissionState.READY
    assert not starting.done()
    laying.released.set()
    await starting
    assert await state_of(service, mission_id) is MissionState.RUNNING
    assert laying.begun == 1, "its vehicles share one"
    live = await service.get(mission_id)
    await service.team_changes.join(live, VehicleSpec.model_validate({"name": "d", "kind": "sim"}), "Ana")
    assert laying.begun == 1
    await act(service, mission_id, "abort")
