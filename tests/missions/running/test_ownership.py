"""Services that share a database: each mission is one's, others take it up, and who lost it writes nothing more."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack
from typing import Any
from unittest.mock import Mock

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from app.missions.errors import ConflictError, MissionElsewhereError, NotAMemberError
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.live.load import take_up
from app.missions.operations.history import events_after
from app.missions.running import failover, registry
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.states import MissionState
from app.missions.views.mission import Level, MissionSummary
from app.storage.database import CONNECTIONS, Database
from app.storage.models import MissionRow
from app.storage.processes.membership import HEARD
from app.storage.queries import consoles
from app.storage.upkeep import migrate
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, until_step, view_of
from tests.support.missions.specs import make_spec
from tests.support.storage.cable import cable_to
from tests.support.storage.databases import Databases, postgres_server, query
from tests.support.waiting import until


@pytest.fixture
async def open_service(
    make_settings: Callable[..., ServiceSettings], either_url: str
) -> AsyncIterator[Callable[[], "Harbour"]]:
    """Opens services on one database; what is still open in the end is closed."""
    async with AsyncExitStack() as stack:

        def make() -> Harbour:
            harbour = Harbour(lambda **changes: make_settings(**({"database_url": either_url} | changes)))
            stack.push_async_callback(harbour.close)
            return harbour

        yield make


@pytest.fixture
def two(open_service: Callable[[], Harbour]) -> tuple[Harbour, Harbour]:
    return open_service(), open_service()


async def test_a_mission_is_its_first_askers(two: tuple[Harbour, Harbour]) -> None:
    one, other = [await harbour.open() for harbour in two]
    mission = await one.create(make_spec())
    with pytest.raises(MissionElsewhereError):
        await view_of(other, mission.id)
    peer = await other.process.owner(mission.id)
    assert peer is not None
    assert peer.secret == one.process.secret
    assert await one.process.owner(mission.id) is None
    assert [m.id for m in await one.missions()] == [mission.id]
    assert await other.missions() == []


@pytest.mark.slow
async def test_running_missions_go_to_whoever_is_left(two: tuple[Harbour, Harbour]) -> None:
    one, other = [await harbour.open() for harbour in two]
    missions = [(await one.create(sim_spec(f"v{k}", steps=500))).id for k in range(3)]
    for mission in missions:
        await act(one, mission, "start", actor="Ana")
        await until_step(one, mission, 1)
    before = {mission: (await view_of(one, mission)).progress.step for mission in missions}
    await two[0].close()
    for mission in missions:

        async def taken_up(mission: str = mission) -> bool:
            return other.process.number in query_owner(two[1], mission)

        await until(taken_up, "the other process has it")
        await until_step(other, mission, before[mission] + 1)
        assert (await act(other, mission, "abort", actor="Ben")).mission.state is MissionState.ABORTED


async def test_a_process_knows_the_ids_by_which_others_on_its_database_led_vehicles(
    two: tuple[Harbour, Harbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plans are called by them: who takes a mission up ends those of a process that is gone."""
    ids: dict[SimFleetLink, int] = {}
    told: list[tuple[int, set[int]]] = []

    def console_id(link: SimFleetLink) -> int:
        return ids.setdefault(link, 0x3F01 + len(ids))

    def know_peers(link: SimFleetLink, known: frozenset[int]) -> None:
        told.append((console_id(link), set(known)))

    monkeypatch.setattr(SimFleetLink, "console_id", property(console_id))
    monkeypatch.setattr(SimFleetLink, "know_peers", know_peers)
    for harbour in two:
        await harbour.open()
    assert told == [(0x3F01, {0x3F01}), (0x3F02, {0x3F01, 0x3F02})]
    await two[0].reopen()
    assert told[2:] == [(0x3F03, {0x3F01, 0x3F02, 0x3F03})], "as after another id in the settings"
    mission = (await two[0].service.create(sim_spec(steps=500))).id
    await act(two[0].service, mission, "start")
    await until_step(two[0].service, mission, 1)
    await two[0].close()
    await until(lambda: len(told) > 3, "the other process takes the mission up")
    assert told[3] == (0x3F02, {0x3F01, 0x3F02, 0x3F03})


async def test_a_mission_is_taken_up_later_where_the_ids_of_others_cannot_be_read(
    two: tuple[Harbour, Harbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = two
    monkeypatch.setattr(SimFleetLink, "console_id", 0x3F01)
    one, other = await first.open(), await second.open()
    mission = (await one.create(sim_spec(steps=500))).id
    await act(one, mission, "start")
    await until_step(one, mission, 1)
    read = consoles.ids
    refused: list[bool] = []

    async def once_in_trouble(session: Any) -> frozenset[int]:
        if not refused:
            refused.append(True)
            raise OperationalError("select", {}, Exception("the connection was lost"))
        return await read(session)

    monkeypatch.setattr(consoles, "ids", once_in_trouble)
    await first.close()
    await until(lambda: refused != [], "the other process tries to take it up")
    await until_step(other, mission, 2)
    assert query_owner(second, mission) == {other.process.number}
    assert (await view_of(other, mission)).state is MissionState.RUNNING


def told_of(summary: MissionSummary) -> dict[str, Any]:
    """What a list tells of a mission that ended, but for what a last map may still add."""
    of_the_map = {"coverage_pct", "remaining_pct", "mean_sd_m"}
    return summary.model_dump(exclude={"progress": of_the_map})


async def test_missions_that_ended_are_listed_after_a_restart_without_being_taken_up(
    two: tuple[Harbour, Harbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many they are: each takes time, and other processes are not asked for them."""
    first, second = two
    one = await first.open()
    for name in "ab":
        mission = (await one.create(sim_spec(name, steps=500))).id
        await act(one, mission, "start")
        await until_step(one, mission, 2)
        await act(one, mission, "abort")
    listed = await one.missions()
    assert [summary.progress.step >= 2 for summary in listed] == [True, True]
    await first.close()
    opened = Mock(side_effect=AssertionError)
    monkeypatch.setattr(registry, "take_up", opened)
    other = await second.open()
    recalled = await other.missions()
    assert [told_of(summary) for summary in recalled] == [told_of(summary) for summary in listed]
    assert await other.missions() == recalled
    opened.assert_not_called()


async def test_a_mission_that_ended_is_listed_as_it_was_only_while_no_process_may_change_it(
    two: tuple[Harbour, Harbour],
) -> None:
    first, second = two

    async def kept() -> bool:
        async with second.database.reading() as session:
            return (await session.get_one(MissionRow, mission)).summary is not None

    one, _ = await first.open(), await second.open()
    mission = (await one.create(sim_spec("a"))).id
    await act(one, mission, "abort")
    assert not await kept()
    one = await first.reopen()
    assert await kept()
    await one.get(mission)
    assert not await kept(), "a process that was killed now would leave it as it was before"
    await first.close()
    assert await kept()


def query_owner(harbour: Harbour, mission: str) -> set[int]:
    statement = "select process_id from mission_owners where mission_id = :id"
    return {number for (number,) in query(harbour.database.url, statement, id=mission)}


async def test_a_vehicle_cannot_be_led_by_two_processes(two: tuple[Harbour, Harbour]) -> None:
    one, other = [await harbour.open() for harbour in two]
    first = await one.create(make_spec(vehicles=[{"name": "a", "kind": "rest"}]))
    second = await other.create(make_spec(vehicles=[{"name": "a", "kind": "rest"}]))
    await act(one, first.id, "start", actor="Ana")
    with pytest.raises(ConflictError, match=first.id):
        await act(other, second.id, "start", actor="Ben")
    assert (await view_of(other, second.id)).state is MissionState.READY
    await act(one, first.id, "abort", actor="Ana")
    await act(other, second.id, "start", actor="Ben")
    third = await one.create(make_spec(vehicles=[{"name": "b", "kind": "rest"}]))
    await act(one, third.id, "start", actor="Ana")
    with pytest.raises(ConflictError, match=second.id):
        await one.team_changes.join(await one.get(third.id), second.spec.vehicles[0], actor="operator")
    assert [vehicle.name for vehicle in (await view_of(one, third.id)).vehicles] == ["b"]


async def test_a_process_that_was_taken_for_dead_writes_nothing_and_lets_go(two: tuple[Harbour, Harbour]) -> None:
    one = await two[0].open()
    mission = await one.create(sim_spec(steps=500))
    await act(one, mission.id, "start", actor="Ana")
    await until_step(one, mission.id, 1)
    live = await one.get(mission.id)
    await asyncio.to_thread(query, two[0].database.url, "delete from processes")
    with pytest.raises(MissionElsewhereError):
        await live.journal.log(Level.INFO, "note", "never written")
    await until(lambda: live not in list(one._registry), "it let go of it")
    # It is a new member now, and as nobody else took the mission up, it does so itself.
    await until_state(one, mission.id, MissionState.RUNNING)
    assert "never written" not in [event.message for event in await events_after(await one.get(mission.id))]


async def test_a_database_that_goes_away_for_a_while_stops_the_vehicles_until_it_is_back(
    make_settings: Callable[..., ServiceSettings], databases: Databases
) -> None:
    url = databases.fresh("postgresql")
    harbour = Harbour(lambda **changes: make_settings(database_url=url, **changes))
    try:
        service = await harbour.open()
        mission = await service.create(sim_spec(steps=500))
        await act(service, mission.id, "start", actor="Ana")
        await until_step(service, mission.id, 2)
        query(url, "select pg_terminate_backend(pid) from pg_stat_activity where pid <> pg_backend_pid()")
        await until(lambda: mission.id not in service._runs, "its vehicles are stopped")
        await until(lambda: mission.id in service._runs, "they go on")
        step = (await view_of(service, mission.id)).progress.step
        await until_step(service, mission.id, step + 1)
        told = [event.message for event in await events_after(await service.get(mission.id)) if event.kind == "resumed"]
        assert any("out of reach" in words for words in told)
    finally:
        await harbour.close()


@pytest.mark.slow
async def test_a_server_that_is_cut_off_without_a_word_stops_the_vehicles_in_time(
    make_settings: Callable[..., ServiceSettings], databases: Databases
) -> None:
    async with AsyncExitStack() as stack:
        cable, url = await stack.enter_async_context(cable_to(databases.fresh("postgresql")))
        harbour = Harbour(lambda **changes: make_settings(database_url=url, **changes))
        stack.push_async_callback(harbour.close)
        service = await harbour.open()
        mission = await service.create(sim_spec(steps=500))
        await act(service, mission.id, "start")
        await until_step(service, mission.id, 1)
        stack.callback(cable.mend)
        cable.cut()
        await until(lambda: mission.id not in service._runs, "its vehicles are stopped", 20.0)
        cable.mend()
        await until(lambda: mission.id in service._runs, "they go on", 60.0)
        step = (await view_of(service, mission.id)).progress.step
        await until_step(service, mission.id, step + 1)
        assert (await view_of(service, mission.id)).state is MissionState.RUNNING


@pytest.mark.slow
async def test_a_server_that_changes_places_with_its_standby_leaves_no_mission_without_anybody_who_flies_it(
    make_settings: Callable[..., ServiceSettings],
) -> None:
    with postgres_server() as server:
        url = server.create("fleet")
        await migrate.upgrade(url)
        harbour = Harbour(lambda **changes: make_settings(database_url=url, **changes))
        service = await harbour.open()
        try:
            mission = await service.create(sim_spec(steps=500))
            await act(service, mission.id, "start", actor="Ana")
            await until_step(service, mission.id, 1)

            async def watch() -> tuple[bool, str]:
                well, components = await service.ready()
                return well, components["watch"]

            with server.as_standby():
                await until(lambda: mission.id not in service._runs, "its vehicles are stopped")

                async def refused() -> bool:
                    return "cannot execute LISTEN during recovery" in (await watch())[1]

                await until(refused, "it tried to enter")
            await until(lambda: mission.id in service._runs, "they go on")
            await until_step(service, mission.id, (await view_of(service, mission.id)).progress.step + 1)
            assert await watch() == (True, "ok")
        finally:
            await harbour.close()


async def looks(url: str, number: int, times: int) -> None:
    """Wait until a process asked the server so often, as each does that does not hang."""

    async def heard() -> object:
        return dict(await asyncio.to_thread(query, url, HEARD))[number]

    for _ in range(times):
        before = await heard()

        async def asked(before: object = before) -> bool:
            return await heard() != before

        await until(asked, "the process looks after the others", 15.0)


async def test_viewers_that_have_every_connection_do_not_hold_up_the_watch(
    make_settings: Callable[..., ServiceSettings], databases: Databases
) -> None:
    url = databases.fresh("postgresql")
    harbour = Harbour(lambda **changes: make_settings(database_url=url, **changes))
    service = await harbour.open()
    try:
        async with AsyncExitStack() as viewers:
            for _ in range(CONNECTIONS):
                session = await viewers.enter_async_context(harbour.database.reading())
                await session.execute(text("select 1"))
            await looks(url, service.process.number, 2)
            assert (await service.ready())[0]
    finally:
        await harbour.close()


@pytest.mark.slow
async def test_a_mission_that_cannot_be_read_for_a_while_does_not_hold_up_who_takes_it_up(
    make_settings: Callable[..., ServiceSettings], databases: Databases
) -> None:
    url = databases.fresh("postgresql")
    async with AsyncExitStack() as stack:
        services = []
        for _ in range(2):
            harbour = Harbour(lambda **changes: make_settings(database_url=url, **changes))
            services.append(await harbour.open())
            stack.push_async_callback(harbour.close)
        one = services[0]
        mission = (await one.create(make_spec())).id
        await act(one, mission, "start")
        await act(one, mission, "pause")
        beside = Database(url)
        stack.push_async_callback(beside.close)
        async with beside.writing() as session:
            await session.execute(text("lock table events, soundings"))
            await asyncio.to_thread(query, url, "delete from mission_owners")

            async def begun() -> bool:
                return bool(await asyncio.to_thread(query, url, "select 1 from mission_owners"))

            await until(begun, "one of them takes it up")
            for service in services:
                await looks(url, service.process.number, 2)
                assert (await service.ready())[1]["watch"] == "ok"


@pytest.mark.parametrize(
    "trouble",
    [asyncio.CancelledError, *(pytest.param(error, marks=pytest.mark.slow) for error in (OSError, ValueError))],
)
async def test_a_mission_that_could_not_be_loaded_is_taken_up_when_the_watch_looks_again(
    two: tuple[Harbour, Harbour], monkeypatch: pytest.MonkeyPatch, trouble: type[BaseException]
) -> None:
    """It is its process's by then: no other one would take it up."""
    times = 0

    async def once_in_trouble(*arguments: Any) -> Any:
        nonlocal times
        times += 1
        if times == 1:
            raise trouble
        return await take_up(*arguments)

    one, other = [await harbour.open() for harbour in two]
    mission = (await one.create(sim_spec(steps=500))).id
    await act(one, mission, "start")
    monkeypatch.setattr(registry, "take_up", once_in_trouble)
    monkeypatch.setattr(failover, "AGAIN_S", 0.0, raising=False)
    await two[0].close()
    await until(lambda: mission in other._runs, "the other process flies it", 20.0)
    assert times == 2


@pytest.mark.slow
async def test_a_process_whose_first_missions_are_cancelled_takes_them_up_later(
    open_service: Callable[[], Harbour], monkeypatch: pytest.MonkeyPatch
) -> None:
    harbour = open_service()
    service = await harbour.open()
    mission = (await service.create(sim_spec(steps=500))).id
    await act(service, mission, "start")
    await harbour.close()
    times = 0

    async def cancelled(*arguments: Any) -> Any:
        nonlocal times
        times += 1
        if times > 1:
            return await take_up(*arguments)
        service = harbour.service
        taking = service._failover._taking
        assert taking is not None
        await service._failover._stand_aside()
        # The watch comes back meanwhile, and finds it cancelled, not ended.
        return await asyncio.Event().wait()

    monkeypatch.setattr(registry, "take_up", cancelled)
    service = await harbour.open()
    await until(lambda: mission in service._runs, "it flies", 20.0)


@pytest.mark.parametrize("comes_back", [False, True])
async def test_what_a_request_takes_up_does_not_fly_where_others_may_have_it_meanwhile(
    open_service: Callable[[], Harbour], monkeypatch: pytest.MonkeyPatch, *, comes_back: bool
) -> None:
    harbour = open_service()
    service = await harbour.open()
    watch = service._failover
    mission = (await service.create(sim_spec(steps=500))).id
    await act(service, mission, "start")
    await watch.end()  # the test looks in its place
    live = await service.get(mission)
    await service._supervisor.halt(live)
    service._claims.release_team(live)
    service._registry.drop()
    begun, go_on = asyncio.Event(), asyncio.Event()

    async def slow(*arguments: Any) -> Any:
        begun.set()
        await go_on.wait()
        return await take_up(*arguments)

    monkeypatch.setattr(registry, "take_up", slow)
    asking = asyncio.create_task(service.get(mission))
    await begun.wait()
    await watch._stand_aside()
    if comes_back:
        await asyncio.to_thread(query, harbour.database.url, "delete from processes")
        await watch._come_back()
    go_on.set()
    with pytest.raises((NotAMemberError, MissionElsewhereError)):
        await asking
    assert mission not in service._runs
    assert list(service._registry) == []
    watch._begin_watch()
    await until(lambda: mission in service._runs, "it flies again", 20.0)


async def test_a_watch_that_ended_is_told_of_and_begun_again(harbour: Harbour) -> None:
    (watch,) = [task for task in asyncio.all_tasks() if task.get_name() == "watch"]
    watch.cancel()
    await until(watch.done, "it ended")
    well, components = await harbour.service.ready()
    assert (well, components["watch"]) == (False, "ended by a cancellation, begun again")

    async def is_well() -> bool:
        return (await harbour.service.ready())[0]

    await until(is_well, "it looks again")


async def test_who_is_no_process_of_the_database_stores_no_mission(open_service: Callable[[], Harbour]) -> None:
    harbour = open_service()
    service = await harbour.open()
    await service._failover.end()  # it would enter again
    stored = (await service.create(make_spec())).id
    await asyncio.to_thread(query, harbour.database.url, "delete from processes")
    with pytest.raises(NotAMemberError, match="none of those that share the database"):
        await service.create(make_spec())
    assert query(harbour.database.url, "select id from missions") == [(stored,)]
    service._registry.drop()
    with pytest.raises(NotAMemberError):
        await service.get(stored)


async def test_a_guest_that_only_looks_takes_nothing(
    two: tuple[Harbour, Harbour], make_settings: Callable[..., ServiceSettings]
) -> None:
    one = await two[0].open()
    mission = await one.create(make_spec())
    guest = MissionService(make_settings(database_url=two[0].database.url), two[0].database)
    assert (await guest.get(mission.id)).id == mission.id
    await guest.shutdown()
    assert query_owner(two[0], mission.id) == {one.process.number}
