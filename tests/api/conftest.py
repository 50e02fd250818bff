from collections.abc import AsyncIterator, Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import (
    Guarded,
    make_client,
    make_tokens,
    mission_spec,
    new_mission,
    running,
    running_in_thread,
)
from tests.support.storage.databases import Databases


@pytest.fixture(scope="session")
def shared_server(databases: Databases) -> Iterator[Server]:
    """One server for every test that only asks."""
    settings = Settings(port=0, database_url=databases.fresh(), imc=ImcSettings(enabled=False))
    with running_in_thread(settings) as server:
        yield server


@pytest.fixture
def make_settings(tmp_path: Path, database_url: str) -> Callable[..., Settings]:
    def make(**changes: Any) -> Settings:
        values: dict[str, Any] = {
            "port": 0,
            "database_url": database_url,
            "imc": ImcSettings(enabled=False),
            "output_dir": tmp_path / "output",
        }
        return Settings(**(values | changes))

    return make


@pytest.fixture
async def server(make_settings: Callable[..., Settings]) -> AsyncIterator[Server]:
    async with running(make_settings()) as server:
        yield server


@pytest.fixture
async def client(server: Server) -> AsyncIterator[httpx.AsyncClient]:
    async with make_client(server) as client:
        yield client


@pytest.fixture
async def mission(client: httpx.AsyncClient) -> dict[str, Any]:
    """A mission of one vehicle that polls, ready to start."""
    answer = await client.post("/missions", json=mission_spec())
    assert answer.status_code == 201, answer.text
    created: dict[str, Any] = answer.json()
    return created


@pytest.fixture
async def guarded(make_settings: Callable[..., Settings]) -> AsyncIterator[Guarded]:
    settings = make_settings()
    database = Database(settings.database_url)
    store = TokenStore(database)
    tokens = await make_tokens(store)
    tokens["expired"] = (await store.create("old", Role.ADMIN, expires_at=datetime.now(UTC) - timedelta(seconds=1)))[1]
    async with (
        running(settings) as server,
        make_client(server) as client,
    ):
        yield Guarded(server=server, client=client, tokens=tokens, store=store)
    await database.close()


@pytest.fixture
async def path(guarded: Guarded) -> str:
    return await new_mission(guarded)
