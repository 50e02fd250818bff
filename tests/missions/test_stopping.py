"""Stopping goes before everything else: no map, no correction and no slow disk keeps an operator's abort waiting."""

import asyncio
import threading
from collections.abc import AsyncIterator
from dataclasses import dataclass, field

import pytest

from app.missions.errors import ConflictError, MissionError
from app.missions.fleet.interface import LinkState
from app.missions.maps.builder import MapBuilder
from app.missions.service import WORKERS, MissionService
from app.missions.states import Action, MissionState, MoveRefusedError
from app.missions.views.corrections import TideCorrection
from app.missions.views.soundings import Ruling
from app.storage import missions as mission_queries
from tests.support.missions.harbour import Harbour, Rover, sim_spec, state_of, until_state, until_step
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
    learn = MapBuilder.learn

    def held(builder: MapBuilder, *, always: bool = False) -> None:
        if always:
            hold.begun.set()
            hold.free.wait()
        learn(builder, always=always)

    monkeypatch.setattr(MapBuilder, "learn", held)
    yield hold
    hold.free.set()


async def link_of(service: MissionService, name: str) -> LinkState:
    return next(vehicle.link for vehicle in await service.vehicles() if vehicle.name == name)


async def test_a_mission_ends_before_its_last_map_is_made(service: MissionService, held_maps: Hold) -> None:
    mission = (await service.create(sim_spec(steps=2))).id
    await service.act(mission, Action.START, actor="Ana")
    await until(held_maps.begun.is_set, "the last map is begun")
    async with asyncio.timeout(LONG_S):
        await until_state(service, mission, S.FINISHED)
        assert await service.vehicles() == []  # simulated: put away
        # Once more, for a vehicle that did not answer: it reaches it, and answers.
        again = await service.abort_vehicle(mission, "a")
        assert [(stop.vehicle, stop.acknowledged) for stop in again.stops] == [("a", True)]
        assert [member.name for member in (await service.mission(mission)).vehicles] == ["a", "b"]
        with pytest.raises(MoveRefusedError):
            await service.act(mission, Action.ABORT, actor="Ana")
    asked = asyncio.create_task(service.map(mission))
    held_maps.free.set()
    snapshot = await asked
    assert snapshot.built.soundings == (await service.mission(mission)).progress.soundings


async def test_an_abort_answers_while_all_planning_threads_are_taken(service: MissionService, held_maps: Hold) -> None:
    """Maps of other missions, being made for someone's download."""
    other = (await service.create(make_spec())).id
    await service.measure(other, measured())
    mission = (await service.create(sim_spec("c", "d", steps=500))).id
    await service.act(mission, Action.START, actor="Ana")
    await until_step(service, mission, 1)
    maps = [asyncio.create_task(service.map(other)) for _ in range(WORKERS)]
    await until(held_maps.begun.is_set, "they are begun")
    async with asyncio.timeout(LONG_S):
        one = await service.abort_vehicle(mission, "c")
        assert [(stop.vehicle, stop.acknowledged) for stop in one.stops] == [("c", True)]
        rest = await service.act(mission, Action.ABORT, actor="Ana")
    assert [(stop.vehicle, stop.acknowledged) for stop in rest.stops] == [("d", True)]
    assert not {"c", "d"} & {vehicle.name for vehicle in await service.vehicles()}  # simulated: put away
    held_maps.free.set()
    await asyncio.gather(*maps)


async def test_a_ruling_or_a_correction_that_waits_for_a_thread_keeps_no_abort_waiting(
    service: MissionService, held_maps: Hold
) -> None:
    mission = (await service.create(sim_spec("c", steps=500))).id
    await service.act(mission, Action.START, actor="Ana")
    await until_step(service, mission, 1)
    other = (await service.create(make_spec())).id
    await service.measure(other, measured())
    (rejected,) = (await service.review(other, NOT_USED)).items
    maps = [asyncio.create_task(service.map(other)) for _ in range(WORKERS)]
    await until(held_maps.begun.is_set, "they are begun")
    waiting = [
        asyncio.create_task(service.set_tide(mission, TideCorrection(level_m=1.0))),
        asyncio.create_task(service.set_tide(other, TideCorrection(level_m=1.0))),
        asyncio.create_task(service.rule(other, rejected.id, Ruling.RESTORED)),
    ]
    async with asyncio.timeout(LONG_S):
        for _ in range(5):  # the database's turn is taken and given in line: whoever stands before it has been there
            await service.write_note(other, "still there", actor="Ana")
        stopped = await service.abort_vehicle(mission, "c")
    assert [(stop.vehicle, stop.acknowledged) for stop in stopped.stops] == [("c", True)]
    held_maps.free.set()
    await asyncio.gather(*maps, *waiting)
    assert (await service.corrections(mission)).tide.level_m == 1.0


@pytest.mark.parametrize("whole", [True, False])
async def test_a_stop_does_not_wait_for_the_database(harbour: Harbour, whole: bool) -> None:
    """Another transaction takes long: the vehicles are stopped meanwhile, and the answer comes when it is written."""
    service = harbour.service
    mission = (await service.create(sim_spec("a", steps=500, limits={"max_step_m": 20.0}))).id
    await service.act(mission, Action.START, actor="Ana")
    await until_step(service, mission, 1)
    async with harbour.database.writing():
        abort = service.act(mission, Action.ABORT, actor="Ana") if whole else service.abort_vehicle(mission, "a")
        answer = asyncio.create_task(abort)
        async with asyncio.timeout(LONG_S):

            async def stopped() -> bool:
                return await link_of(service, "a") is LinkState.READY

            await until(stopped, "the vehicle is stopped")
        assert not answer.done()
    view = await answer
    assert [(stop.vehicle, stop.acknowledged) for stop in view.stops] == [("a", True)]
    assert await state_of(service, mission) is (S.ABORTED if whole else S.RUNNING)
    reopened = await harbour.reopen()
    present = [(vehicle.name, vehicle.active) for vehicle in (await reopened.mission(mission)).vehicles]
    assert present == [("a", whole)]


async def test_a_vehicle_that_did_not_acknowledge_is_told_again_after_the_end(service: MissionService) -> None:
    mission = (await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))).id
    rover = Rover(service, mission, "a")
    await rover.post()
    await service.act(mission, Action.START, actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    first = await service.act(mission, Action.ABORT, actor="Ana")
    assert [stop.acknowledged for stop in first.stops] == [False]
    again = asyncio.create_task(service.abort_vehicle(mission, "a"))
    await until(service._supervisor.acting(mission).locked, "it is told again")
    with pytest.raises(ConflictError, match="aborted: stop and hold"):
        await rover.poll()
    assert [(stop.acknowledged, stop.detail) for stop in (await again).stops] == [(True, "told at its poll")]

    other = (await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))).id
    await service.act(other, Action.START, actor="Ana")
    with pytest.raises(MissionError, match="takes part in mission") as refused:
        await service.abort_vehicle(mission, "a")
    assert other in refused.value.remedy
    await service.act(other, Action.ABORT, actor="Ana")


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
            await service.act(one, Action.START, actor="Ana")
    assert (await service.mission(one)).state is MissionState.READY
    assert (await service.act(other, Action.START, actor="Ana")).mission.state is MissionState.RUNNING
