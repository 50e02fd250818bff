"""What keeps a database from being used is told from what is wrong with a request."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from app.storage import database as database_module
from app.storage.database import Database
from app.storage.db_errors import trouble_of
from tests.support.storage.databases import Databases, query
from tests.support.storage.rows import mission


def _file(database: Database) -> Path:
    return Path(database.url.removeprefix("sqlite+aiosqlite:///"))


async def _failing(database: Database, *, pages: int | None = None) -> DBAPIError:
    async def write() -> None:
        async with database.writing() as session:
            if pages is not None:
                await session.execute(text(f"PRAGMA max_page_count={pages}"))
            session.add(mission(reason="x" * 100_000))

    with pytest.raises(DBAPIError) as caught:
        await write()
    return caught.value


async def _patience_ms(database: Database) -> int:
    async with database.writing() as session:
        return int(await session.scalar(text("PRAGMA busy_timeout")) or 0)


async def test_a_full_disk_is_told_of_until_something_could_be_written(sqlite: Database) -> None:
    error = await _failing(sqlite, pages=1)
    assert trouble_of(error) == "the disk with the database is full: free some space on it"
    assert sqlite.trouble == trouble_of(error)
    async with sqlite.writing() as session:
        await session.execute(text("PRAGMA max_page_count=1000000"))
        session.add(mission())
    assert sqlite.trouble == ""


async def test_a_lock_of_another_program_is_told_of(sqlite: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database_module, "BUSY_TIMEOUT_MS", 10)
    monkeypatch.setattr(database_module, "TROUBLED_TIMEOUT_MS", 5)
    other = Database(sqlite.url)
    try:
        with closing(sqlite3.connect(_file(sqlite), isolation_level=None)) as holder:
            holder.execute("BEGIN IMMEDIATE")
            error = await _failing(other)
        assert trouble_of(error) == "another program holds the database locked: end it"
        # The next one in line does not wait as long; once one could write all have time again.
        assert [await _patience_ms(other) for _ in range(2)] == [5, 10]
    finally:
        await other.close()


async def test_what_is_wrong_with_a_request_is_no_trouble(sqlite: Database) -> None:
    async with sqlite.writing() as session:
        session.add(mission())
    error = await _failing(sqlite)  # the same mission again
    assert trouble_of(error) == ""
    assert sqlite.trouble == ""
    assert trouble_of(ValueError("x")) == ""


@pytest.mark.parametrize("either_url", ["postgresql"], indirect=True)
async def test_a_server_that_ends_the_connection_is_told_of(database: Database) -> None:
    async def cut_off() -> None:
        async with database.writing() as session:
            own = await session.scalar(text("SELECT pg_backend_pid()"))
            async with database.writing() as other:
                await other.execute(text("SELECT pg_terminate_backend(:pid)"), {"pid": own})
            await session.execute(text("SELECT 1"))

    with pytest.raises(DBAPIError) as caught:
        await cut_off()
    assert "database's server" in trouble_of(caught.value)


@pytest.mark.parametrize("either_url", ["postgresql"], indirect=True)
@pytest.mark.parametrize(
    ("state", "words"),
    [
        ("40P01", "is tried again"),
        ("40001", "is tried again"),
        ("55P03", "holds the database locked"),
        ("25006", "takes no writes"),
        ("57P01", "stopping or starting"),
        ("53300", "raise its max_connections"),
        ("53100", "free some space"),
        ("23505", ""),
    ],
)
async def test_troubles_of_a_server_that_pass_are_waited_for(database: Database, state: str, words: str) -> None:
    raised = f"DO $$ BEGIN RAISE EXCEPTION 'as told' USING ERRCODE = '{state}'; END $$"
    with pytest.raises(DBAPIError) as caught:
        async with database.writing() as session:
            await session.execute(text(raised))
    told = trouble_of(caught.value)
    assert words in told
    assert bool(told) is bool(words)


async def test_a_server_that_takes_no_more_connections_is_told_of(databases: Databases) -> None:
    url = databases.fresh("postgresql")
    role = f"few_{url.rpartition('/')[2]}"
    query(url, f"create role {role} login connection limit 0")
    database = Database(url.replace("//fleet@", f"//{role}@"))
    with pytest.raises(DBAPIError) as caught:
        await database.ping()
    assert trouble_of(caught.value).startswith("the database's server takes no more connections: raise its max_conn")
    await database.close()
