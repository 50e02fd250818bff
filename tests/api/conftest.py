import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.main import Server, serve
from app.missions.settings import ImcSettings
from app.settings import Settings
from tests.databases import Databases

# About 55 m by 55 m.
AREA = {
    "type": "Polygon",
    "coordinates": [[[-8.705, 41.185], [-8.7043, 41.185], [-8.7043, 41.1855], [-8.705, 41.1855], [-8.705, 41.185]]],
}


def mission_spec(**changes: Any) -> dict[str, Any]:
    return {
        "name": "Harbour basin",
        "area": AREA,
        "steps": 3,
        "cell_m": 2,
        "vehicles": [{"name": "rover", "kind": "rest"}],
        "planner": {"name": "random"},
    } | changes


def soundings(count: int = 12, vehicle: str = "rover", start_s: float = 1_795_225_140.0) -> list[dict[str, Any]]:
    """Soundings along the area's diagonal, one a second, 2 m apart."""
    return [
        {
            "vehicle": vehicle,
            "time_s": start_s + i,
            "lat_deg": 41.1851 + 0.00001 * i,
            "lon_deg": -8.7049 + 0.00002 * i,
            "depth_m": 2.0,
            "range_m": 8.0 + 0.1 * i,
        }
        for i in range(count)
    ]


@asynccontextmanager
async def running(settings: Settings) -> AsyncIterator[Server]:
    """The real server on a free port, in this process."""
    started: asyncio.Future[Server] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(settings, started=started.set_result))
    await asyncio.wait({task, started}, return_when=asyncio.FIRST_COMPLETED)
    if not started.done():
        started.cancel()
        await task
    server = started.result()
    try:
        yield server
    finally:
        server.stop()
        await task


def make_client(server: Server) -> httpx.AsyncClient:
    # Loading the certificates that plain HTTP does not need would take longer than most tests.
    return httpx.AsyncClient(base_url=server.url + "/api/v1", timeout=20, verify=False)  # noqa: S501


@contextmanager
def running_in_thread(settings: Settings) -> Iterator[Server]:
    """The real server in a thread of its own, for fixtures that outlive one event loop."""
    started: dict[str, Server] = {}
    answers = threading.Event()

    def note(server: Server) -> None:
        started["server"] = server
        answers.set()

    thread = threading.Thread(target=lambda: asyncio.run(serve(settings, started=note)))
    thread.start()
    assert answers.wait(120)
    try:
        yield started["server"]
    finally:
        started["server"].stop()
        thread.join(30)


@pytest.fixture(scope="session")
def shared_server(databases: Databases) -> Iterator[Server]:
    """One server for every test that only asks."""
    settings = Settings(port=0, database_url=databases.fresh(), imc=ImcSettings(enabled=False))
    with running_in_thread(settings) as server:
        yield server


@pytest.fixture
def no_settings_around(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the environment nor a file sets anything."""
    for name in list(os.environ):
        if name.startswith("BATHYFLEET_"):
            monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)


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
