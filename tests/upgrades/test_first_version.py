"""A database that version 0.1.0 left when it was killed during a mission: taken up by this one, and taken back.

``first_version.sql`` holds what that version's own service wrote of four missions: one finished with simulated
vehicles, one not begun, one aborted, one under way with a vehicle that posts.
"""

import json
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import JSON, Connection, DateTime, MetaData, Table, insert, select

from app.missions.settings import ImcSettings
from app.settings import Settings
from app.storage.database import make_engine
from app.storage.upkeep import migrate
from app.storage.upkeep.prepare import prepare_database
from tests.support.api.rest import running
from tests.support.storage.databases import KINDS, Databases, path_of
from tests.support.waiting import until

FIRST = Path(__file__).with_name("first_version.sql")
REVISION = "0001"
TOKEN = "bf_C_awMRUPpAyYn1Ap32RN3xJNDkY-VCNEehLk4f6-Pxc"  # noqa: S105 - of that database alone
LAST_HEARD_S = 1_795_600_595.5
"""When the vehicle that posts was last heard of."""
Rows = dict[str, list[dict[str, Any]]]


def left_by_the_first_version(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(FIRST.read_text())


@pytest.fixture
def left(databases: Databases) -> str:
    """The database, as it was found on the disk."""
    url = databases.empty("sqlite")
    left_by_the_first_version(path_of(url))
    return url


def _read(connection: Connection, tables: MetaData) -> Rows:
    return {
        table.name: [dict(row) for row in connection.execute(select(table).order_by(*table.primary_key)).mappings()]
        for table in tables.sorted_tables
        if table.name != "alembic_version"
    }


async def contents(url: str, tables: MetaData) -> Rows:
    """The rows of some tables, with the columns that are named."""
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            return await connection.run_sync(_read, tables)
    finally:
        await engine.dispose()


async def tables_of(url: str) -> MetaData:
    engine, tables = make_engine(url), MetaData()
    try:
        async with engine.connect() as connection:
            await connection.run_sync(tables.reflect)
    finally:
        await engine.dispose()
    return tables


def described(tables: MetaData) -> set[tuple[str, ...]]:
    """What tables are made of, in words that can be compared."""

    def parts(table: Table) -> Iterable[tuple[str, ...]]:
        for column in table.columns:
            yield table.name, column.name, str(column.type), str(column.nullable), str(column.primary_key)
        for index in table.indexes:
            yield table.name, str(index.name), str(index.unique), *(column.name for column in index.columns)
        for key in table.foreign_key_constraints:
            yield table.name, str(key.name), key.referred_table.name, str(key.ondelete), *key.column_keys

    return {part for table in tables.sorted_tables for part in parts(table)}


async def copied(url: str, source: str) -> None:
    """Fill a database at the first revision with another one's rows."""

    def fill(connection: Connection, tables: MetaData, rows: Rows) -> None:
        for table in tables.sorted_tables:
            if rows.get(table.name):
                connection.execute(insert(table), [_typed(table, row) for row in rows[table.name]])
        connection.commit()

    rows = await contents(source, await tables_of(source))
    tables = await tables_of(url)
    engine = make_engine(url)
    try:
        async with engine.connect() as connection:
            await connection.run_sync(fill, tables, rows)
    finally:
        await engine.dispose()


def _typed(table: Table, row: dict[str, Any]) -> dict[str, Any]:
    def value(name: str, given: Any) -> Any:
        kind = table.columns[name].type
        if isinstance(kind, DateTime) and isinstance(given, datetime):
            return given.replace(tzinfo=UTC)
        return json.loads(given) if isinstance(kind, JSON) and isinstance(given, str) else given

    return {name: value(name, given) for name, given in row.items()}


@pytest.mark.parametrize("kind", KINDS)
async def test_every_row_is_there_after_the_upgrade_and_after_the_way_back(
    databases: Databases, left: str, kind: str
) -> None:
    url = left
    if kind == "postgresql":
        url = databases.empty(kind)
        await migrate.upgrade(url, REVISION)
        await copied(url, left)
    tables = await tables_of(url)
    before = await contents(url, tables)
    assert {name: len(rows) for name, rows in before.items()} == {
        "missions": 4,
        "tokens": 1,
        "batches": 11,
        "events": 18,
        "mission_vehicles": 5,
        "positions": 50,
        "soundings": 206,
        "steps": 4,
        "waypoints": 5,
    }
    await prepare_database(url, may_upgrade=True)
    assert await migrate.current(url) == migrate.head()
    assert await contents(url, tables) == before
    await migrate.downgrade(url, REVISION)
    assert described(await tables_of(url)) == described(tables)
    assert await contents(url, tables) == before


@pytest.mark.slow
async def test_this_version_knows_its_missions_and_flies_on(left: str) -> None:
    tables = await tables_of(left)
    before = await contents(left, tables)
    settings = Settings(port=0, database_url=left, imc=ImcSettings(enabled=False))
    headers = {"Authorization": f"Bearer {TOKEN}"}
    async with (
        running(settings) as server,
        httpx.AsyncClient(base_url=server.url + "/api/v1", headers=headers, timeout=60) as client,
    ):
        missions = {mission["name"]: mission for mission in (await client.get("/missions")).json()}
        assert {name: mission["state"] for name, mission in missions.items()} == {
            "First survey": "finished",
            "Not begun": "ready",
            "Given up": "aborted",
            "Under way": "running",
        }
        ids = {name: mission["id"] for name, mission in missions.items()}
        await check_its_map(client, ids["First survey"], before["soundings"])
        await check_that_it_ends(client, ids["Under way"])
        assert (await client.post(f"/missions/{ids['Not begun']}/start")).status_code == 200
        assert (await client.post(f"/missions/{ids['Not begun']}/abort")).status_code == 200
    planned_anew = "written by another version: it plans anew on the same map (planner memory of 'cao'"
    lines = (await contents(left, tables))["events"]
    assert [row["mission_id"] for row in lines if planned_anew in row["message"]] == [ids["Under way"]]
    # The way back, after it was in use.
    await migrate.downgrade(left, REVISION)
    assert described(await tables_of(left)) == described(tables)
    after = await contents(left, tables)
    for name in ("soundings", "positions", "events", "mission_vehicles"):
        assert [row for row in before[name] if row not in after[name]] == [], name
    # Answers to batches are forgotten a day after they were given; of these those are as they were that are left.
    keys = {row["key"] for row in before["batches"]}
    assert [row for row in after["batches"] if row["key"] in keys and row not in before["batches"]] == []
    assert [row["number"] for row in after["steps"] if row["mission_id"] == ids["Under way"]] == [1, 2, 3, 4]
    assert {row["name"]: row["state"] for row in after["missions"]} == {
        "First survey": "finished",
        "Not begun": "aborted",
        "Given up": "aborted",
        "Under way": "finished",
    }


async def check_its_map(client: httpx.AsyncClient, mission: str, soundings: list[dict[str, Any]]) -> None:
    """The map is made of the soundings that the first version took."""
    stored = [row["depth_m"] for row in soundings if row["mission_id"] == mission]
    told = (await client.get(f"/missions/{mission}")).json()
    assert told["progress"]["soundings"] == len(stored) == 195
    lines = (await client.get(f"/missions/{mission}/map.xyz")).text.splitlines()
    sounded = [float(fields[2]) for line in lines if not line.startswith("#") and int((fields := line.split())[4])]
    assert len(sounded) > 20
    assert min(stored) - 0.5 < min(sounded) <= max(sounded) < max(stored) + 0.5


async def check_that_it_ends(client: httpx.AsyncClient, mission: str) -> None:
    """The vehicle that posts goes on where it was, to the last step."""
    time_s = LAST_HEARD_S

    async def state() -> str:
        return str((await client.get(f"/missions/{mission}")).json()["state"])

    async def ended() -> bool:
        nonlocal time_s
        ordered = await client.get(f"/missions/{mission}/vehicles/buoy/waypoint")
        if ordered.status_code != 200:
            return await state() == "finished"
        goal, time_s = ordered.json(), time_s + 60.0
        item = {name: goal[name] for name in ("lat_deg", "lon_deg", "depth_m")}
        posted = {"items": [item | {"vehicle": "buoy", "time_s": time_s, "range_m": 6.0}]}
        answer = await client.post(f"/missions/{mission}/measurements", json=posted)
        assert answer.status_code in (200, 409), answer.text
        return await state() == "finished"

    await until(ended, "the mission under way is finished")
    told = (await client.get(f"/missions/{mission}")).json()
    assert told["progress"]["step"] == told["progress"]["steps"] == 4
