"""Stopping goes before everything else: no map, no correction and no slow disk keeps an operator's abort waiting."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from app.missions.errors import ConflictError, MissionError
from app.missions.fleet.interface import LinkState
from app.missions.live.threads import WORKERS
from app.missions.maps.builder import MapBuilder
from app.missions.operations.corrections.recorrection import corrections_view, set_tide
from app.missions.operations.corrections.review import rule, soundings_page
from app.missions.operations.history import write_note
from app.missions.operations.maps.mission_maps import export, newest_map
from app.missions.operations.measurements import measure
from app.missions.service import MissionService
from app.missions.settings import ProviderSettings
from app.missions.states import Action, MissionState, MoveRefusedError
from app.missions.views.measurements.corrections import TideCorrection
from app.missions.views.measurements.soundings import Ruling
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, state_of, until_state, until_step, view_of
from tests.support.missions.measured import NOT_USED, measured
from tests.support.missions.specs import make_spec
from tests.support.waiting import until

S = MissionState
LONG_S = 20.0
"""An answer that takes longer counts as none; maps take until a test lets them go on."""


@dataclass
class Hold:
    """Thorough maps begin, and go on when they are let."""

    begun: threading.Event = field(default_factory=threading.Event)
    free: threading.Event = field(default_factory=threading.Event)


@pytest.fixture
async def held_maps(harbour: Harbour, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Hold]:
    """Thorough maps take as long as a test wants, with the builder's own lock held."""
    hold = Hold()
    learn = MapBuilder._learn

    def held(builder: MapBuilder, compute: Callable[..., Any], *, always: bool, mapping: bool = False) -> Any:
        if always:
            hold.begun.set()
            hold.free.wait()
        return learn(builder, compute, always=always, mapping=mapping)

    monkeypatch.setattr(MapBuilder, "_learn", held)
    yield hold
    hold.free.set()


async def link_of(service: MissionService, name: str) -> LinkState:
    return next(vehicle.link for vehicle in await service.vehicles() if vehicle.name == name)


async def test_a_mission_ends_before_its_last_map_is_made(service: MissionService, held_maps: Hold) -> None:
    mission = (await service.create(sim_spec(steps=2))).id
    await act(service, mission, "start", actor="Ana")
    await until(held_maps.begun.is_set, "the last map is begun")
    async with asyncio.timeout(LONG_S):
        await until_state(service, mission, S.FINISHED)
        assert await service.vehicles() == []  # simulated: put away
        # Once more, for a vehicle that did not answer: it reaches it, and answers.
        again = await service.team_changes.stop_one(await service.get(mission), "a", actor="operator")
        assert [(stop.vehicle, stop.acknowledged) for stop in again] == [("a", True)]
        assert [member.name for member in (await view_of(service, mission)).vehicles] == ["a", "b"]
        with pytest.raises(MoveRefusedError):
            await act(service, mission, "abort", actor="Ana")
    asked = asyncio.create_task(newest_map(await service.get(mission), service.maps))
    held_maps.free.set()
    snapshot = await asked
    assert snapshot.built.soundings == (await view_of(service, mission)).progress.soundings


async def test_an_abort_answers_while_all_threads_that_make_maps_are_taken(
    service: MissionService, held_maps: Hold
) -> None:
    """Maps of other missions, being made for someone's download."""
    other = (await service.create(make_spec())).id
    await measure(await service.get(other), measured())
    mission = (await service.create(sim_spec("c", "d", steps=500))).id
    await act(service, mission, "start", actor="Ana")
    await until_step(service, mission, 1)
    maps = [asyncio.create_task(newest_map(await service.get(other), service.maps)) for _ in range(WORKERS)]
    await until(held_maps.begun.is_set, "they are begun")
    step = (await view_of(service, mission)).progress.step
    await until_step(service, mission, step + 5)  # more than was decided: vehicles do not wait for them
    async with asyncio.timeout(LONG_S):
        ways = await export(
            await service.get(mission), service.maps, ProviderSettings(), service.compute, "tracks.geojson"
        )
        assert ways.content
        one = await service.team_changes.stop_one(await service.get(mission), "c", actor="operator")
        assert [(stop.vehicle, stop.acknowledged) for stop in one] == [("c", True)]
        rest = await act(service, mission, "abort", actor="Ana")
    assert [(stop.vehicle, stop.acknowledged) for stop in rest.stops] == [("d", True)]
    assert not {"c", "d"} & {vehicle.name for vehicle in await service.vehicles()}  # simulated: put away
    held_maps.free.set()
    await asyncio.gather(*maps)


async def test_a_ruling_or_a_correction_that_waits_for_a_thread_keeps_no_abort_waiting(
    service: MissionService, held_maps: Hold
) -> None:
    mission = (await service.create(sim_spec("c", steps=500))).id
    await act(service, mission, "start", actor="Ana")
    await until_step(service, mission, 1)
    other = (await service.create(make_spec())).id
    await measure(await service.get(other), measured())
    (rejected,) = (await soundings_page(await service.get(other), NOT_USED)).items
    maps = [asyncio.create_task(newest_map(await service.get(other), service.maps)) for _ in range(WORKERS)]
    await until(held_maps.begun.is_set, "they are begun")
    waiting = [
        asyncio.create_task(set_tide(await service.get(mission), TideCorrection(level_m=1.0), actor="operator")),
        asyncio.create_task(set_tide(await service.get(other), TideCorrection(level_m=1.0), actor="operator")),
        asyncio.create_task(rule(await service.get(other), rejected.id, Ruling.RESTORED, actor="operator")),
    ]
    async with asyncio.timeout(LONG_S):
        for _ in range(5):  # the database's turn is taken and given in line: whoever stands before it has been there
            await write_note(await service.get(other), "still there", actor="Ana")
        stopped = await service.team_changes.stop_one(await service.get(mission), "c", actor="operator")
    assert [(stop.vehicle, stop.acknowledged) for stop in stopped] == [("c", True)]
    held_maps.free.set()
    await asyncio.gather(*maps, *waiting)
    assert (corrections_view(await service.get(mission))).tide.level_m == 1.0


@pytest.mark.parametrize("whole", [True, False])
async def test_a_stop_does_not_wait_for_the_database(harbour: Harbour, whole: bool) -> None:
    """Another transaction takes long: the vehicles are stopped meanwhile, and the answer comes when it is written."""
    service = harbour.service
    mission = (await service.create(sim_spec("a", steps=500, limits={"max_step_m": 20.0}))).id
    await act(service, mission, "start", actor="Ana")
    await until_step(service, mission, 1)
    async with harbour.database.writing():
        live = await service.get(mission)

        async def abort() -> list[tuple[str, bool]]:
            if whole:
                stops = (await service.act(live, Action.ABORT, actor="Ana")).stops
                return [(stop.vehicle, stop.acknowledged) for stop in stops]
            one = await service.team_changes.stop_one(live, "a", actor="operator")
            return [(stop.vehicle, stop.acknowledged) for stop in one]

        answer = asyncio.create_task(abort())
        async with asyncio.timeout(LONG_S):

            async def stopped() -> bool:
                return await link_of(service, "a") is LinkState.READY

            await until(stopped, "the vehicle is stopped")
        assert not answer.done()
    assert await answer == [("a", True)]
    assert await state_of(service, mission) is (S.ABORTED if whole else S.RUNNING)
    reopened = await harbour.reopen()
    present = [(vehicle.name, vehicle.active) for vehicle in (await view_of(reopened, mission)).vehicles]
    assert present == [("a", whole)]


@pytest.mark.slow
async def test_a_vehicle_that_did_not_acknowledge_is_told_again_after_the_end(service: MissionService) -> None:
    mission = (await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))).id
    rover = Rover(service, mission, "a")
    await rover.post()
    await act(service, mission, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    first = await act(service, mission, "abort", actor="Ana")
    assert [stop.acknowledged for stop in first.stops] == [False]
    again = asyncio.create_task(service.team_changes.stop_one(await service.get(mission), "a", actor="operator"))
    await until(service._supervisor.acting(mission).locked, "it is told again")
    with pytest.raises(ConflictError, match="aborted: stop and hold"):
        await rover.poll()
    assert [(stop.acknowledged, stop.detail) for stop in await again] == [(True, "told at its poll")]

    other = (await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))).id
    await act(service, other, "start", actor="Ana")
    with pytest.raises(MissionError, match="takes part in mission") as refused:
        await service.team_changes.stop_one(await service.get(mission), "a", actor="operator")
    assert other in refused.value.remedy
    await act(service, other, "abort", actor="Ana")


async def test_a_start_that_cannot_be_written_leaves_the_vehicles_free(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = harbour.service
    one, other = [(await service.create(sim_spec("a"))).id for _ in range(2)]

    async def fail(*_: object) -> None:
        raise OSError("disk full")

    with monkeypatch.context() as patch:
        patch.setattr(mission_queries, "set_state", fail)
        with pytest.raises(OSError, match="disk full"):
            await act(service, one, "start", actor="Ana")
    assert (await view_of(service, one)).state is MissionState.READY
    assert (await act(service, other, "start", actor="Ana")).mission.state is MissionState.RUNNING
