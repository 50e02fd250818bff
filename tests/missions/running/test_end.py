"""A service that ends: once it stops its vehicles nobody makes it lead them again, and missions stay as they are."""

import asyncio

import pytest

from app.missions.errors import ConflictError
from app.missions.fleet.interface import LinkState
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.states import Action, MissionState
from tests.support.missions.harbour import Harbour, act, sim_spec, state_of, until_state, until_step
from tests.support.missions.specs import lon_lat

RECOVERY = {"point": lon_lat(10.0, 10.0)}

pytestmark = pytest.mark.usefixtures("simulated_time")


async def flown(service: MissionService) -> LiveMission:
    """A mission that has flown a little."""
    mission = await service.create(sim_spec("a", "b", steps=500, recovery=RECOVERY))
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 1)
    return await service.get(mission.id)


def nobody_follows(service: MissionService) -> bool:
    return not service._runs and all(info.state is not LinkState.ENGAGED for info, _ in service.hub.vehicles())


@pytest.mark.slow
@pytest.mark.parametrize("action", [Action.FINISH, Action.ABORT])
async def test_a_paused_mission_is_not_brought_home_by_a_service_that_ends(harbour: Harbour, action: Action) -> None:
    service = harbour.service
    live = await flown(service)
    await act(service, live.id, "pause")
    await service.stop_vehicles()
    with pytest.raises(ConflictError, match="the service ends"):
        await service.act(live, action, actor="Ana", return_home=True)
    assert nobody_follows(service)
    again = await harbour.reopen()
    assert await state_of(again, live.id) is MissionState.PAUSED
    assert (await again.get(live.id)).ending is None
    await again.act(await again.get(live.id), action, actor="Ana", return_home=True)
    await until_state(again, live.id, MissionState.FINISHED if action is Action.FINISH else MissionState.ABORTED)


async def test_a_running_mission_that_is_finished_while_the_service_ends_is_brought_home_by_the_next_one(
    harbour: Harbour,
) -> None:
    live = await flown(harbour.service)
    await harbour.service.stop_vehicles()
    await harbour.service.act(live, Action.FINISH, actor="Ana", return_home=True)
    assert nobody_follows(harbour.service)
    assert live.header.state is MissionState.RUNNING
    again = await harbour.reopen()
    await until_state(again, live.id, MissionState.FINISHED)


async def test_reading_a_mission_at_sea_takes_up_no_flight_while_the_service_ends(harbour: Harbour) -> None:
    service = harbour.service
    live = await flown(service)
    await service.stop_vehicles()
    service._registry.drop()
    assert [summary.state for summary in await service.missions()] == [MissionState.RUNNING]
    assert nobody_follows(service)
    again = await harbour.reopen()
    assert await state_of(again, live.id) is MissionState.RUNNING
    await until_step(again, live.id, live.header.step + 1)


@pytest.mark.parametrize("waits_for", ["lock", "site"])
async def test_a_start_that_waited_when_the_service_began_to_end_is_refused(
    harbour: Harbour, waits_for: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = harbour.service
    mission = await service.create(sim_spec("a", "b"))
    live = await service.get(mission.id)
    on, reached = asyncio.Event(), asyncio.Event()

    async def begin(_live: LiveMission) -> None:
        reached.set()
        await on.wait()

    if waits_for == "site":
        monkeypatch.setattr(service.sites, "begin", begin)
        starting = asyncio.create_task(act(service, live.id, "start"))
        await reached.wait()
        await service.stop_vehicles()
        on.set()
    else:
        async with service._supervisor.acting(live.id):
            starting = asyncio.create_task(act(service, live.id, "start"))
            for _ in range(10):
                await asyncio.sleep(0)  # it waits for the lock
            await service.stop_vehicles()
    with pytest.raises(ConflictError, match="the service ends"):
        await starting
    assert nobody_follows(service)
    assert await state_of(service, live.id) is MissionState.READY
    assert await state_of(await harbour.reopen(), live.id) is MissionState.READY


async def test_a_start_that_was_written_when_the_service_began_to_end_is_flown_by_the_next_one(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = harbour.service
    mission = await service.create(sim_spec("a", "b", steps=500))
    live = await service.get(mission.id)
    enter = live.enter

    def entered(state: MissionState, *facts: object) -> None:
        enter(state, *facts)  # type: ignore[arg-type]
        service.begin_no_more()

    monkeypatch.setattr(live, "enter", entered)
    await act(service, live.id, "start")
    assert live.header.state is MissionState.RUNNING
    await service.stop_vehicles()
    assert nobody_follows(service)
    await until_step(await harbour.reopen(), live.id, 1)
