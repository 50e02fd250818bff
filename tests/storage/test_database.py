"""Transactions are whole, durable, and wait for each other."""

import asyncio
import gc
import socket
import sqlite3
import subprocess
import sys
import threading
from contextlib import AsyncExitStack
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest
from sqlalchemy import delete, func, select, text
from sqlalchemy.exc import IntegrityError, OperationalError, SQLAlchemyError, StatementError

from app.storage import database as database_module
from app.storage.database import CONNECTIONS, Database
from app.storage.db_errors import trouble_of
from app.storage.models import MissionRow, SoundingRow, StepRow, WaypointRow
from tests.support.storage.cable import cable_to
from tests.support.storage.databases import Databases
from tests.support.storage.rows import TIME, mission, one_of_each, step, waypoint
from tests.support.waiting import until


async def _pragma(database: Database, name: str) -> object:
    async with database.reading() as session:
        return await session.scalar(text(f"PRAGMA {name}"))


async def _count(database: Database, model: type) -> int:
    async with database.reading() as session:
        return await session.scalar(select(func.count()).select_from(model)) or 0


async def test_sqlite_writes_ahead_durably_with_foreign_keys(sqlite: Database) -> None:
    assert await _pragma(sqlite, "journal_mode") == "wal"
    assert await _pragma(sqlite, "synchronous") == 2  # FULL
    assert await _pragma(sqlite, "foreign_keys") == 1
    assert int(str(await _pragma(sqlite, "busy_timeout"))) >= 5000


async def test_the_file_itself_says_that_it_is_in_wal_mode(sqlite: Database) -> None:
    connection = sqlite3.connect(sqlite.url.removeprefix("sqlite+aiosqlite:///"))
    try:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    finally:
        connection.close()


async def test_a_block_that_raises_leaves_nothing(database: Database) -> None:
    class OnPurposeError(Exception):
        pass

    async def write() -> None:
        async with database.writing() as session:
            session.add(mission())
            await session.flush()
            session.add_all([step(), mission("m2")])
            await session.flush()
            raise OnPurposeError

    with pytest.raises(OnPurposeError):
        await write()
    assert await _count(database, MissionRow) == 0
    assert await _count(database, StepRow) == 0


async def test_a_block_that_breaks_a_constraint_leaves_nothing(database: Database) -> None:
    async def write() -> None:
        async with database.writing() as session:
            session.add(step())
            await session.flush()
            session.add(waypoint())
            await session.flush()
            session.add(waypoint(number=2))  # of a step that does not exist

    async with database.writing() as session:
        session.add(mission())
    with pytest.raises(IntegrityError):
        await write()
    assert await _count(database, StepRow) == 0
    assert await _count(database, WaypointRow) == 0


async def test_a_cancelled_block_leaves_nothing_and_frees_the_database(database: Database) -> None:
    inside = asyncio.Event()

    async def write() -> None:
        async with database.writing() as session:
            session.add(mission())
            await session.flush()
            inside.set()
            await asyncio.Event().wait()

    task = asyncio.create_task(write())
    await inside.wait()
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert await _count(database, MissionRow) == 0
    async with database.writing() as session:
        session.add(mission())
    assert await _count(database, MissionRow) == 1


async def test_a_reader_sees_only_what_was_committed(database: Database) -> None:
    async with database.writing() as session:
        session.add(mission())
        await session.flush()
        assert await _count(database, MissionRow) == 0
    assert await _count(database, MissionRow) == 1


async def test_a_mission_takes_everything_of_its_own_with_it(database: Database) -> None:
    async with database.writing() as session:
        for rows in one_of_each():
            session.add_all(rows)
            await session.flush()
    async with database.writing() as session:
        await session.execute(delete(MissionRow))
    for model in (StepRow, WaypointRow, SoundingRow):
        assert await _count(database, model) == 0


async def test_writers_of_one_process_stand_in_line_however_long_each_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.storage.database.BUSY_TIMEOUT_MS", 0)  # nobody who finds it locked would wait
    database = Database(f"sqlite+aiosqlite:///{tmp_path / 'line.db'}")
    entered: list[str] = []
    inside, leave = asyncio.Event(), asyncio.Event()

    async def write(name: str) -> None:
        async with database.writing() as session:
            await session.execute(text("CREATE TABLE IF NOT EXISTS names (name TEXT)"))
            entered.append(name)
            inside.set()
            await leave.wait()

    try:
        tasks = [asyncio.create_task(write(name)) for name in "abc"]
        await inside.wait()
        assert entered == ["a"]
        leave.set()
        await asyncio.gather(*tasks)
        assert entered == ["a", "b", "c"]
    finally:
        await database.close()


async def test_many_writers_at_once_all_succeed(database: Database) -> None:
    async with database.writing() as session:
        session.add(mission())

    async def add(number: int) -> None:
        async with database.writing() as session:
            # Read first: this is what makes SQLite writers collide when they do not take the lock at once.
            await session.scalar(select(func.count()).select_from(StepRow))
            session.add(step(number=number))

    await asyncio.gather(*(add(number) for number in range(1, 41)))
    assert await _count(database, StepRow) == 40


WRITER = """
import asyncio, sys
from sqlalchemy import func, select
from app.storage.database import Database
from app.storage.models import StepRow
from tests.support.storage.rows import step

async def main(url, first):
    database = Database(url)
    for number in range(first, first + 15):
        async with database.writing() as session:
            await session.scalar(select(func.count()).select_from(StepRow))
            session.add(step(number=number))
    await database.close()

asyncio.run(main(sys.argv[1], int(sys.argv[2])))
"""


async def test_writers_in_other_processes_wait_for_each_other(sqlite: Database) -> None:
    async with sqlite.writing() as session:
        session.add(mission())
    writers = [
        await asyncio.create_subprocess_exec(
            sys.executable, "-c", WRITER, sqlite.url, str(first), stderr=subprocess.PIPE
        )
        for first in (1, 101)
    ]
    for writer in writers:
        _, errors = await writer.communicate()
        assert writer.returncode == 0, errors.decode()
    assert await _count(sqlite, StepRow) == 30


async def test_times_come_back_as_the_same_moment_in_utc(database: Database) -> None:
    lisbon = timezone(timedelta(hours=1))
    async with database.writing() as session:
        session.add(mission(created_at=TIME.astimezone(lisbon)))
    async with database.reading() as session:
        row = await session.get(MissionRow, "m1")
    assert row is not None
    assert row.created_at == TIME
    assert row.created_at.utcoffset() == timedelta(0)


async def test_a_time_without_zone_is_refused(database: Database) -> None:
    with pytest.raises(StatementError, match="give it a time zone"):
        async with database.writing() as session:
            session.add(mission(created_at=datetime(2026, 6, 1)))  # noqa: DTZ001
    assert await _count(database, MissionRow) == 0


async def test_ping_raises_when_the_database_cannot_be_reached(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    database = Database(f"sqlite+aiosqlite:///{tmp_path / 'no' / 'such' / 'folder' / 'x.db'}")
    with pytest.raises(OperationalError, match="unable to open database file"):
        await database.ping()
    await database.close()
    # The driver's thread says goodbye to this event loop, which must not be gone before.
    for worker in set(threading.enumerate()) - before:
        await asyncio.to_thread(worker.join)


@pytest.mark.slow
async def test_a_transaction_cancelled_at_any_moment_leaves_no_connection_open(database: Database) -> None:
    async def work() -> None:
        async with database.reading() as session:
            await session.scalar(select(func.count()).select_from(MissionRow))
        async with database.writing() as session:
            session.add(mission())
            await session.flush()
            await session.execute(delete(MissionRow))

    finished = False
    moment = 0
    while not finished:
        moment += 1
        if moment % 3 == 0:
            await database.close()  # the next one has to connect first
        task = asyncio.create_task(work())
        for _ in range(moment):
            if not task.done():
                await asyncio.sleep(0)
        # Twice, as when a mission is aborted while the service shuts down.
        task.cancel()
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        finished = not task.cancelled()
        assert database._engine.sync_engine.pool.checkedout() == 0, moment  # type: ignore[attr-defined]
    gc.collect()  # a forgotten connection warns here
    assert moment > 5
    await work()
    assert await _count(database, MissionRow) == 0


async def test_reserved_connections_are_there_however_many_are_in_use(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "TURN_S", 0.05)
    database = Database(url)
    async with AsyncExitStack() as stack:
        stack.push_async_callback(database.close)
        for _ in range(CONNECTIONS):
            session = await stack.enter_async_context(database.reading())
            await session.execute(select(MissionRow.id))
        with pytest.raises(SQLAlchemyError) as caught:
            await stack.enter_async_context(database.reading())
        assert trouble_of(caught.value).startswith("every connection of this process to the database is in use: ask")
        await database.ping()
        async with database.reserved().writing() as session:
            session.add(mission())
        async with database.reserved().reading() as session:
            assert (await session.scalars(select(MissionRow.id))).all() == ["m1"]


async def test_a_server_that_does_not_answer_is_told_of_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database_module, "PING_S", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        database = Database(f"postgresql+asyncpg://fleet@127.0.0.1:{silent.getsockname()[1]}/fleet")
        for _ in range(2):
            with pytest.raises(TimeoutError, match="does not answer"):
                await database.ping()
    await until(lambda: database._pinging is not None and database._pinging.done(), "it gave up")
    await database.close()


async def test_pings_that_overlap_are_answered(database: Database) -> None:
    async def failures() -> list[TimeoutError]:
        found = []
        for _ in range(50):
            try:
                await database.ping()
            except TimeoutError as error:
                found.append(error)
        return found

    assert await asyncio.gather(*(failures() for _ in range(8))) == [[]] * 8


@pytest.mark.slow
async def test_a_server_that_was_cut_off_is_reached_again_by_new_connections(
    databases: Databases, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that were open would not end for many minutes."""
    monkeypatch.setattr(database_module, "PING_S", 0.5)
    async with cable_to(databases.fresh("postgresql")) as (cable, url):
        database = Database(url)
        try:
            await database.ping()
            cable.cut()
            for _ in range(2):
                with pytest.raises(TimeoutError, match="does not answer within"):
                    await database.ping()
            cable.mend(lost=True)

            async def answers() -> bool:
                try:
                    await database.ping()
                except TimeoutError:
                    return False
                return True

            await until(answers, "it is reached", 15.0)
        finally:
            await database.close()


@pytest.mark.slow
async def test_closing_ends_a_ping_under_way(databases: Databases) -> None:
    async with cable_to(databases.fresh("postgresql")) as (cable, url):
        database = Database(url)
        await database.ping()
        cable.cut()
        ping = asyncio.create_task(database.ping())
        await until(lambda: database._pinging is not None and not database._pinging.done(), "it asks")
        async with asyncio.timeout(15):
            await database.close()
            assert database._pinging is not None
            assert database._pinging.done()
            with pytest.raises((SQLAlchemyError, OSError)):
                await ping
