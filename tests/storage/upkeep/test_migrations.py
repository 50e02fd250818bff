"""Models and migrations agree, and every migration goes both ways."""

import asyncio
import sqlite3
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, MetaData, column, inspect, null, select, text

from app.missions.team import Withdrawal, WithdrawalCause
from app.storage.database import Database, make_engine
from app.storage.models import Base, MissionRow, MissionVehicleRow, WaypointRow
from app.storage.upkeep import migrate
from app.storage.upkeep.prepare import check_that_empty, prepare_database
from tests.support.storage.databases import Databases, query
from tests.support.storage.rows import one_of_each
from tests.support.waiting import until

EARLIER = sorted(path.name.partition("_")[0] for path in Path(migrate.MIGRATIONS, "versions").glob("0*.py"))[:-1]
QUICK = (0, len(EARLIER) // 2, len(EARLIER) - 1)
"""Those of the revisions that are tried in every run; the others are in the slow ones."""


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


@pytest.mark.parametrize(
    "revision",
    [
        pytest.param(revision, marks=[] if place in QUICK else [pytest.mark.slow])
        for place, revision in enumerate(EARLIER)
    ],
)
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


PREPARE = "import asyncio, sys; from app.storage.upkeep.prepare import prepare_database as prepare; "
PREPARE += "asyncio.run(prepare(sys.argv[1], may_upgrade=True))"


async def test_processes_that_bring_an_empty_database_up_to_date_at_the_same_time_wait_for_each_other(
    databases: Databases,
) -> None:
    url = databases.empty("postgresql")
    database = Database(url)
    async with database.writing() as session:
        # Whoever comes waits for this, here or in the line.
        await session.execute(text("create table alembic_version (version_num varchar(32) primary key)"))
        begun = [await asyncio.create_subprocess_exec(sys.executable, "-c", PREPARE, url) for _ in range(2)]

        async def waiting() -> bool:
            asked = "select count(*) from pg_stat_activity where wait_event_type = 'Lock' and datname = :name"
            return await asyncio.to_thread(query, url, asked, name=url.rpartition("/")[2]) == [(2,)]

        await until(waiting, "both of them wait")
        await session.rollback()
    assert [await process.wait() for process in begun] == [0, 0]
    await database.close()
    assert await _on(url, _differences) == []


async def test_tables_that_another_process_has_just_made_are_not_taken_for_a_stranger_s(empty_url: str) -> None:
    await migrate.upgrade(empty_url)
    await check_that_empty(empty_url)


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


@pytest.mark.slow
async def test_what_only_words_told_is_kept_as_values(empty_url: str) -> None:
    """Databases that know neither which legs were not begun nor why exactly vehicles were called home."""
    asked = {"response": "return", "why": "called home by Ana", "over": True, "asked": True, "done": False}
    ended = asked | {"why": "every step is done", "asked": False, "done": True}
    older = {"response": "return", "why": "it has flown its way", "over": False}
    stored: dict[str, Any] = {"asked": asked, "ended": ended, "older": older, "surveys": None}
    reasons = ["given up: called home", "it did not get there", ""]

    def fill(connection: Connection) -> None:
        _fill_as_it_is(connection)
        tables = MetaData()
        tables.reflect(connection)
        vehicles, waypoints = tables.tables["mission_vehicles"], tables.tables["waypoints"]
        sample = dict(connection.execute(vehicles.select()).mappings().one())
        for slot, (name, withdrawal) in enumerate(stored.items(), start=1):
            changes = {"name": name, "slot": slot, "withdrawal": null() if withdrawal is None else withdrawal}
            connection.execute(vehicles.insert().values(sample | changes))
        sample = dict(connection.execute(waypoints.select()).mappings().one())
        for number, reason in enumerate(reasons):
            connection.execute(waypoints.insert().values(sample | {"vehicle": f"v{number}", "reason": reason}))
        connection.commit()

    def withdrawals(connection: Connection) -> dict[str, Any]:
        tables = MetaData()
        tables.reflect(connection)
        vehicles = tables.tables["mission_vehicles"].c
        query = select(vehicles.name, vehicles.withdrawal).where(vehicles.name.in_(stored))
        return dict(map(tuple, connection.execute(query)))

    await migrate.upgrade(empty_url, "0020")
    await _on(empty_url, fill)
    await migrate.upgrade(empty_url)
    database = Database(empty_url)
    async with database.reading() as session:
        rows = await session.scalars(select(MissionVehicleRow).where(MissionVehicleRow.name.in_(stored)))
        found = {row.name: Withdrawal.recall(row.withdrawal) for row in rows}
        query = select(WaypointRow.reason, WaypointRow.begun).where(WaypointRow.vehicle.startswith("v"))
        begun = [(reason, one) for reason, one in await session.execute(query.order_by(WaypointRow.vehicle))]
    await database.close()
    assert found.pop("surveys") is None
    assert {name: one and (one.cause, one.asked) for name, one in found.items()} == {
        "asked": (WithdrawalCause.CALLED, True),
        "ended": (WithdrawalCause.MISSION_END, False),
        "older": (WithdrawalCause.PART_DONE, False),
    }
    assert begun == list(zip(reasons, [False, True, True], strict=True))
    await migrate.downgrade(empty_url, "0020")
    assert await _on(empty_url, withdrawals) == stored | {"older": older | {"asked": False, "done": True}}
