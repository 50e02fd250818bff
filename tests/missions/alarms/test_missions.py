"""Alarms of missions: stored with their line, seen by all who watch, also when nothing can be stored."""

import asyncio
import sqlite3
from collections.abc import AsyncIterator, Callable

import pytest
from sqlalchemy import func, make_url, select

from app.missions.alarm_kinds import AlarmKind
from app.missions.alarms import dispatcher
from app.missions.fleet.links.sim import SimFleetLink
from app.missions.live.journals import db_retry
from app.missions.operations.history import events_after
from app.missions.running.mission_views import watched
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleKind
from app.missions.views.alarms import AlarmState
from app.missions.views.messages import AlarmMessage, SnapshotMessage
from app.storage import database as storage
from app.storage.models import AlarmRow
from tests.support.missions.alarms import hook, told_by
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, until_step
from tests.support.missions.specs import make_spec
from tests.support.waiting import until


@pytest.mark.slow
async def test_a_stop_that_is_not_acknowledged_is_taken_by_somebody_and_stays_so(harbour: Harbour) -> None:
    service = harbour.service
    mission = await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(service, mission.id, "a")
    await rover.post()
    await act(service, mission.id, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    await act(service, mission.id, "abort", actor="Ana")
    [alarm] = await service.alarms.alarms(mission_id=mission.id)
    assert (alarm.kind, alarm.severity, alarm.vehicle) == ("stop_not_acknowledged", "critical", "a")
    [line] = [one for one in await events_after(await service.get(mission.id)) if one.level == "alarm"]
    assert line.message == alarm.message
    await service.alarms.acknowledge(alarm.id, "Ben")
    again = await harbour.reopen()
    [kept] = await again.alarms.alarms(mission_id=mission.id)
    assert (kept.id, kept.state, kept.acknowledged_by) == (alarm.id, AlarmState.ACKNOWLEDGED, "Ben")


async def test_everyone_who_watches_sees_an_alarm_and_who_took_it(harbour: Harbour) -> None:
    service = harbour.service
    live = await service.get((await service.create(make_spec())).id)
    await live.journal.alarm(AlarmKind.VEHICLE_LOST, "a is lost: silent", vehicle="a")
    async with watched(live) as one, watched(live) as other:
        first, second = await anext(one), await anext(other)
        assert isinstance(first, SnapshotMessage)
        assert isinstance(second, SnapshotMessage)
        assert [alarm.message for alarm in first.alarms] == ["a is lost: silent"]
        assert first.alarms == second.alarms
        await service.alarms.acknowledge(first.alarms[0].id, "Ana")
        for page in (one, other):
            said = await _alarm_of(page)
            assert (said.alarm.state, said.alarm.acknowledged_by) == (AlarmState.ACKNOWLEDGED, "Ana")
    assert live.journal.alarms.open == []


async def test_an_alarm_whose_cause_is_over_says_so_and_stays_until_somebody_takes_it(harbour: Harbour) -> None:
    service = harbour.service
    live = await service.get((await service.create(make_spec())).id)
    await live.journal.alarm(AlarmKind.VEHICLE_LOST, "a is lost: silent", vehicle="a")
    await live.journal.alarm(AlarmKind.VEHICLE_LOST, "b is lost: silent", vehicle="b")
    async with watched(live) as page:
        await anext(page)
        # Lines that wait to be written end alarms as those do that are written at once.
        live.journal.note_line(live.journal.end_line([AlarmKind.VEHICLE_LOST], "a is heard again", vehicle="a"))
        said = await _alarm_of(page)
        assert (said.alarm.vehicle, said.alarm.state) == ("a", AlarmState.OPEN)
        assert said.alarm.ended_at is not None
    ended = {alarm.vehicle: alarm.ended_at for alarm in await service.alarms.alarms(AlarmState.OPEN)}
    assert ended == {"a": said.alarm.ended_at, "b": None}
    again = await harbour.reopen()
    board = (await again.get(live.id)).journal.alarms
    await until(lambda: board.open, "they are shown")
    assert [(alarm.vehicle, alarm.ended_at) for alarm in board.open] == sorted(ended.items())


async def test_what_keeps_a_mission_from_going_on_is_over_with_it(harbour: Harbour) -> None:
    service = harbour.service
    mission = await service.create(make_spec(vehicles=[{"name": "a", "kind": "rest"}]))
    await act(service, mission.id, "start", actor="Ana")
    live = await service.get(mission.id)
    await until(lambda: live.journal.alarms.open, "nobody can be sent anywhere")
    await live.journal.alarm(AlarmKind.NOT_COME_HOME, "a did not come home", vehicle="a")
    await act(service, mission.id, "abort", actor="Ana")
    over = {alarm.kind: alarm.ended_at is not None for alarm in await service.alarms.alarms(mission_id=mission.id)}
    assert over[AlarmKind.NO_VEHICLE]
    assert not over[AlarmKind.NOT_COME_HOME]


async def test_what_another_process_acknowledges_the_owners_pages_see(
    make_settings: Callable[..., ServiceSettings],
) -> None:
    one, other = Harbour(make_settings), Harbour(make_settings)
    try:
        owner, second = await one.open(), await other.open()
        live = await owner.get((await owner.create(make_spec())).id)
        await live.journal.alarm(AlarmKind.VEHICLE_LOST, "a is lost: silent", vehicle="a")
        [alarm] = await second.alarms.alarms(AlarmState.OPEN)
        await second.alarms.acknowledge(alarm.id, "Ben")
        await until(lambda: live.journal.alarms.open == [], "the owner's pages do not show it any more")
        [seen] = await owner.alarms.alarms()
        assert (seen.state, seen.acknowledged_by) == (AlarmState.ACKNOWLEDGED, "Ben")
    finally:
        await one.close()
        await other.close()


async def test_a_mission_that_is_taken_up_shows_what_is_open(harbour: Harbour) -> None:
    mission = await harbour.service.create(make_spec())
    live = await harbour.service.get(mission.id)
    await live.journal.alarm(AlarmKind.LEAK, "a: it reports: water", vehicle="a")
    again = await harbour.reopen()
    live = await again.get(mission.id)
    await until(lambda: live.journal.alarms.open, "it is shown")
    assert [(one.kind, one.vehicle, one.message) for one in live.journal.alarms.open] == [
        (AlarmKind.LEAK, "a", "a: it reports: water")
    ]


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits long for the database."""
    monkeypatch.setattr(storage, "BUSY_TIMEOUT_MS", 20)
    monkeypatch.setattr(db_retry, "RETRY_S", 0.05)
    monkeypatch.setattr(dispatcher, "UNSTORED_S", 0.0)


async def test_a_locked_database_keeps_no_alarm_from_the_page_or_from_going_out(
    impatient: None, harbour_closed: Harbour, databases: object
) -> None:
    with hook() as program:
        service = await harbour_closed.open(alarms=told_by(program).model_copy())
        file = make_url(service.database.url)
        if file.get_backend_name() != "sqlite":
            pytest.skip("another program's lock on the whole database is SQLite's")
        live = await service.get((await service.create(make_spec())).id)
        other_program = sqlite3.connect(str(file.database), isolation_level=None)
        other_program.execute("BEGIN IMMEDIATE")
        try:
            await live.journal.alarm(AlarmKind.LEAK, "a: it reports: water", vehicle="a")
            kinds = {one.kind for one in live.journal.alarms.open}
            assert kinds == {AlarmKind.LEAK, AlarmKind.DATABASE_UNWRITABLE}
            await until(lambda: len(program.requests) == 2, "both went out while nothing can be written")
            [leak] = [one for one in live.journal.alarms.open if one.kind == AlarmKind.LEAK]
            await service.alarms.acknowledge(leak.id, "Ana")
            assert [one.kind for one in live.journal.alarms.open] == [AlarmKind.DATABASE_UNWRITABLE]
        finally:
            other_program.execute("ROLLBACK")
            other_program.close()

        async def settled() -> bool:
            found = {alarm.kind: alarm for alarm in await service.alarms.alarms()}
            kept = await _stored(service)
            return (
                kept == 2
                and len(program.requests) == 3
                and all([d.state == "delivered" for d in alarm.deliveries] for alarm in found.values())
            )

        await until(settled, "both are stored, and it is told who has the leak")
        found = {alarm.kind: alarm for alarm in await service.alarms.alarms()}
    assert found[AlarmKind.LEAK].acknowledged_by == "Ana"
    assert "nothing could be written down" in found[AlarmKind.DATABASE_UNWRITABLE].message
    assert sorted(said["type"] for said in program.said) == ["alarm.acknowledged", "alarm.raised", "alarm.raised"]
    assert len(set(program.ids)) == 3


async def _stored(service: MissionService) -> int:
    async with service.database.reading() as session:
        return int(await session.scalar(select(func.count()).select_from(AlarmRow)) or 0)


async def _alarm_of(page: AsyncIterator[object]) -> AlarmMessage:
    async with asyncio.timeout(60):
        while not isinstance(message := await anext(page), AlarmMessage):
            pass
    return message


async def _ended(harbour: Harbour, mission_id: str) -> dict[str, bool]:
    """Return of each kind of alarm that was raised whether it is over, all of them."""
    alarms = await harbour.service.alarms.alarms(mission_id=mission_id)
    return {kind: all(a.ended_at is not None for a in alarms if a.kind == kind) for kind in {a.kind for a in alarms}}


async def _silent(harbour: Harbour, spec: MissionSpec, alarm: str) -> str:
    """Start a mission whose vehicle ``a`` is silent after the first step until an alarm is raised; its id."""
    mission = (await harbour.service.create(spec)).id
    await act(harbour.service, mission, "start")
    await until_step(harbour.service, mission, 1)
    _link(harbour).silence("a")

    async def raised() -> bool:
        return alarm in await _ended(harbour, mission)

    await until(raised, f"{alarm} is raised")
    return mission


@pytest.mark.slow
@pytest.mark.parametrize("restarts", [False, True])
async def test_a_vehicle_that_comes_back_while_nobody_flies_is_lost_no_longer(harbour: Harbour, restarts: bool) -> None:
    mission = await _silent(harbour, sim_spec("a", "b", steps=1000, side_m=80.0), "link_lost")
    raised = await _ended(harbour, mission)
    assert {kind: raised[kind] for kind in ("vehicle_lost", "link_lost")} == {"vehicle_lost": False, "link_lost": False}
    if restarts:
        await harbour.reopen()
    else:
        await act(harbour.service, mission, "pause")
        _link(harbour).reach("a")
        await act(harbour.service, mission, "resume")

    async def over() -> bool:
        ended = await _ended(harbour, mission)
        return ended["vehicle_lost"] and ended["link_lost"]

    await until(over, "it is heard")
    alarms = [alarm.kind for alarm in await harbour.service.alarms.alarms(mission_id=mission)]
    assert (alarms.count(AlarmKind.LINK_LOST), alarms.count(AlarmKind.VEHICLE_LOST)) == (1, 1), "each was raised once"


@pytest.mark.slow
async def test_a_vehicle_that_is_not_heard_after_a_restart_is_still_lost(harbour: Harbour) -> None:
    vehicles = [{"name": "a", "kind": "rest"}, {"name": "b", "kind": "sim"}]
    mission = (await harbour.service.create(sim_spec(steps=1000, side_m=80.0, vehicles=vehicles))).id
    live = await harbour.service.get(mission)
    await Rover(harbour.service, mission, "a").post()
    await act(harbour.service, mission, "start")
    await until_step(harbour.service, mission, 1)
    await live.journal.alarm(AlarmKind.VEHICLE_LOST, "a is lost: silent", vehicle="a")
    await live.journal.alarm(AlarmKind.LINK_LOST, "a: its link is lost: silent", vehicle="a")
    service = await harbour.reopen()
    step = (await service.get(mission)).header.step
    await until_step(service, mission, step + 5)
    still = await _ended(harbour, mission)
    assert {kind: still[kind] for kind in ("vehicle_lost", "link_lost")} == {"vehicle_lost": False, "link_lost": False}
    rover = Rover(service, mission, "a")

    async def over() -> bool:
        await rover.post()
        return all((await _ended(harbour, mission)).values())

    await until(over, "it is heard")


async def test_that_nobody_can_be_sent_is_over_when_somebody_can_after_a_pause(harbour: Harbour) -> None:
    spec = sim_spec("a", steps=1000, side_m=80.0, step_deadline_s=5.0)
    mission = await _silent(harbour, spec, "no_vehicle")
    await act(harbour.service, mission, "pause")
    _link(harbour).reach("a")
    step = (await harbour.service.get(mission)).header.step
    await act(harbour.service, mission, "resume")
    await until_step(harbour.service, mission, step + 2)
    assert (await _ended(harbour, mission))["no_vehicle"]


def _link(harbour: Harbour) -> SimFleetLink:
    link = harbour.service.hub._links[VehicleKind.SIM]
    assert isinstance(link, SimFleetLink)
    return link
