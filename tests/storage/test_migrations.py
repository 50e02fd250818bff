"""Models and migrations agree, and every migration goes both ways."""

import sqlite3
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, inspect, select

from app.storage import migrate
from app.storage.database import Database, make_engine
from app.storage.models import Base, MissionRow
from tests.storage.rows import one_of_each


def _differences(connection: Connection) -> list[object]:
    options = {"compare_type": True, "render_as_batch": connection.dialect.name == "sqlite"}
    return list(compare_metadata(MigrationContext.configure(connection, opts=options), Base.metadata))


def _tables(connection: Connection) -> set[str]:
    return set(inspect(connection).get_table_names())


async def _on(url: str, question):  # type: ignore[no-untyped-def]
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            return await connection.run_sync(question)
    finally:
        await engine.dispose()


async def _fill(url: str) -> None:
    database = Database(url)
    async with database.writing() as session:
        for rows in one_of_each():
            session.add_all(rows)
            await session.flush()
    await database.close()


async def test_the_migrated_tables_are_those_of_the_models(url: str) -> None:
    assert await _on(url, _differences) == []


async def test_the_comparison_would_notice_a_missing_column(sqlite: Database) -> None:
    path = sqlite.url.removeprefix("sqlite+aiosqlite:///")
    with sqlite3.connect(path) as connection:
        connection.execute("ALTER TABLE soundings DROP COLUMN position_sd_m")
    connection.close()
    assert await _on(sqlite.url, _differences) != []


async def test_up_with_data_down_to_nothing_and_up_again(empty_url: str) -> None:
    assert await migrate.current(empty_url) is None
    await migrate.upgrade(empty_url)
    assert await migrate.current(empty_url) == migrate.head()
    await _fill(empty_url)
    await migrate.downgrade(empty_url, "base")
    assert await migrate.current(empty_url) is None
    assert await _on(empty_url, _tables) <= {"alembic_version"}
    await migrate.upgrade(empty_url)
    assert await _on(empty_url, _differences) == []
    await _fill(empty_url)


async def test_upgrading_twice_keeps_the_data(url: str) -> None:
    await _fill(url)
    await migrate.upgrade(url)
    database = Database(url)
    async with database.reading() as session:
        assert [row.id for row in await session.scalars(select(MissionRow))] == ["m1"]
    await database.close()


async def test_every_table_of_the_models_is_filled_by_the_sample(url: str) -> None:
    await _fill(url)
    database = Database(url)
    async with database.reading() as session:
        for table in Base.metadata.sorted_tables:
            assert (await session.execute(select(table))).first() is not None, table.name
    await database.close()


@pytest.mark.parametrize("bad", ["mysql://u@h/d", "sqlite:///x.db", "postgresql+psycopg://h/d"])
def test_another_driver_is_refused_by_name(bad: str) -> None:
    with pytest.raises(ValueError, match=r"use sqlite\+aiosqlite:///FILE or postgresql\+asyncpg://"):
        Database(bad)


def test_migrations_lie_beside_the_package() -> None:
    assert (migrate.MIGRATIONS / "env.py").is_file()
    assert list(Path(migrate.MIGRATIONS, "versions").glob("0001_*.py"))
