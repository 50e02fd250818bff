"""Models and migrations agree, and every migration goes both ways."""

import sqlite3
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, MetaData, column, inspect, select, text

from app.storage.database import Database, make_engine
from app.storage.models import Base, MissionRow
from app.storage.upkeep import migrate
from app.storage.upkeep.prepare import prepare_database
from tests.support.storage.rows import one_of_each

EARLIER = sorted(path.name.partition("_")[0] for path in Path(migrate.MIGRATIONS, "versions").glob("0*.py"))[:-1]


def _differences(connection: Connection) -> list[object]:
    options = {"compare_type": True, "render_as_batch": connection.dialect.name == "sqlite"}
    return list(compare_metadata(MigrationContext.configure(connection, opts=options), Base.metadata))


def _tables(connection: Connection) -> set[str]:
    return set(inspect(connection).get_table_names())


async def _on(url: str, question: Any) -> Any:
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


def _kept(connection: Connection, columns: dict[str, list[str]]) -> dict[str, list[Any]]:
    """What stands in these columns, by table."""
    return {
        table: list(map(tuple, connection.execute(select(*map(column, names)).select_from(text(table)))))
        for table, names in columns.items()
    }


def _fill_as_it_is(connection: Connection) -> dict[str, list[str]]:
    """Put the sample's rows into every table of whatever revision this is; returns the columns of each."""
    sample = {row.__table__.name: row for rows in one_of_each() for row in rows}
    tables = MetaData()
    tables.reflect(connection)
    for table in tables.sorted_tables:
        if table.name == "alembic_version":
            continue
        row = sample[table.name]
        given = {name: getattr(row, name) for name in table.columns.keys() if getattr(row, name) is not None}  # noqa: SIM118
        if connection.dialect.name == "sqlite":
            given = {k: v.replace(tzinfo=None) if isinstance(v, datetime) else v for k, v in given.items()}
        defaults = {"elapsed_s": 0.0, "reason": ""}
        missing = {name: value for name, value in defaults.items() if name in table.columns and name not in given}
        connection.execute(table.insert().values(**given, **missing))
    connection.commit()
    return {table.name: [c.name for c in table.columns] for table in tables.sorted_tables if table.name in sample}


@pytest.mark.parametrize("revision", EARLIER)
async def test_database_of_every_earlier_revision_keeps_its_rows(empty_url: str, revision: str) -> None:
    """As the release of that time left it: up to this one, in use, and down again."""
    if empty_url.startswith("postgresql") and revision not in (EARLIER[0], EARLIER[-1]):
        pytest.skip("on PostgreSQL the oldest and the newest are enough: no table is replaced there")
    await migrate.upgrade(empty_url, revision)
    columns = await _on(empty_url, _fill_as_it_is)
    before = await _on(empty_url, lambda connection: _kept(connection, columns))
    assert all(len(rows) == 1 for rows in before.values())
    await prepare_database(empty_url, may_upgrade=True)
    assert await _on(empty_url, _differences) == []
    assert await _on(empty_url, lambda connection: _kept(connection, columns)) == before
    database = Database(empty_url)
    async with database.reading() as session:
        for mapper in Base.registry.mappers:
            if mapper.local_table.name in columns:  # type: ignore[attr-defined]
                assert (await session.scalars(select(mapper))).one() is not None, mapper
    await database.close()
    await migrate.downgrade(empty_url, revision)
    assert await _on(empty_url, lambda connection: _kept(connection, columns)) == before


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
