"""Health and metrics."""

import asyncio
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import text

from app import __version__
from app.main import Server, create_app
from app.settings import Settings
from app.storage import database as database_module
from app.storage.database import CONNECTIONS
from app.storage.upkeep import migrate
from app.storage.upkeep.prepare import DatabaseNotReadyError
from tests.support.api.rest import make_client, mission_spec, running, soundings
from tests.support.storage.databases import query
from tests.support.waiting import until


@pytest.mark.parametrize("prefix", ["", "/api/v1"])
async def test_health_is_in_the_api_and_at_the_root(server: Server, prefix: str) -> None:
    async with httpx.AsyncClient(base_url=server.url + prefix) as client:
        assert (await client.get("/health/live")).json() == {"status": "ok"}
        ready = await client.get("/health/ready")
        assert ready.status_code == 200
        both = [ready.json(), (await client.get("/health")).json()]
        for answer in both:
            del answer["compiling"]  # it may have ended in between
        assert both[0] == both[1]
        assert ready.json()["version"] == __version__
        assert ready.json()["components"]["database"] == "ok"


async def test_it_is_said_as_long_as_functions_are_compiled(server: Server, client: httpx.AsyncClient) -> None:
    async def compiled() -> bool:
        return not (await client.get("/health")).json()["compiling"]

    await until(compiled, "all is compiled, or loaded from an earlier start")
    assert server.config.app.state.edge.service._compilation.done


async def test_a_lost_database_is_not_ready_but_alive(server: Server, client: httpx.AsyncClient) -> None:
    server.config.app.state.edge.service._database.ping = _fail
    ready = await client.get("/health/ready")
    assert (ready.status_code, ready.json()["status"]) == (503, "failing")
    assert "disk is gone" in ready.json()["components"]["database"]
    assert (await client.get("/health")).status_code == 200
    assert (await client.get("/health/live")).status_code == 200


async def test_requests_that_find_every_connection_in_use_are_asked_to_come_again(
    make_settings: Callable[..., Settings], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "TURN_S", 0.1)
    async with running(make_settings()) as server, make_client(server) as client, AsyncExitStack() as viewers:
        mission = (await client.post("/missions", json=mission_spec())).json()["id"]
        for _ in range(CONNECTIONS):
            session = await viewers.enter_async_context(server.config.app.state.edge.service.database.reading())
            await session.execute(text("select 1"))
        for path in (f"/missions/{mission}/events", "/sites"):
            refused = await client.get(path, headers={"Accept": "application/json"})
            assert (refused.status_code, refused.json()["type"]) == (503, "urn:bathyfleet:problem:database-unavailable")
            assert "every connection of this process to the database is in use" in refused.json()["detail"]
            assert refused.headers["Retry-After"] == "5"
        stream = await client.get(f"/missions/{mission}/events", headers={"Accept": "text/event-stream"})
        assert (stream.status_code, stream.text) == (200, ""), "it is over, and its reader connects anew"
        assert (await client.get("/health/ready")).status_code == 200


async def test_a_process_that_others_took_for_dead_is_asked_again_later(
    server: Server, client: httpx.AsyncClient
) -> None:
    service = server.config.app.state.edge.service
    await service._failover.end()  # it would enter again
    await asyncio.to_thread(query, service._database.url, "delete from processes")
    refused = await client.post("/missions", json=mission_spec())
    assert (refused.status_code, refused.json()["type"]) == (503, "urn:bathyfleet:problem:not-ready")
    assert refused.headers["Retry-After"] == "5"
    assert (await client.get("/missions")).json() == []


async def _fail() -> None:
    raise OSError("disk is gone")


def values(text: str) -> dict[str, float]:
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return {line.rpartition(" ")[0]: float(line.rpartition(" ")[2]) for line in lines}


async def test_metrics_count_what_happens(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    before = values((await client.get("/metrics")).text)
    await client.get(f"/missions/{mission['id']}")
    await client.post("/missions", json=mission_spec(vehicles=[]))
    await client.post(f"/missions/{mission['id']}/measurements", json={"items": soundings(4)})
    await client.get("/no/such/path")
    after = values((await client.get("/metrics")).text)

    def grown(name: str) -> float:
        return after[name] - before.get(name, 0)

    route = 'route="/api/v1/missions/{mission_id}"'
    assert grown(f'bathyfleet_http_requests_total{{method="GET",{route},status="200"}}') == 1
    assert grown(f'bathyfleet_http_request_seconds_count{{method="GET",{route}}}') == 1
    assert grown('bathyfleet_http_requests_total{method="GET",route="unmatched",status="404"}') == 1
    assert grown('bathyfleet_soundings_total{verdict="accepted"}') == 4
    assert after['bathyfleet_missions{state="ready"}'] == 1
    assert after['bathyfleet_missions{state="draft"}'] == 1
    assert after["bathyfleet_vehicles_connected"] == 1
    assert {"bathyfleet_steps_total", "bathyfleet_planning_seconds_count"} <= set(after)


async def test_an_old_database_is_refused_unless_the_service_migrates_it(
    make_settings: Callable[..., Settings], tmp_path: Path
) -> None:
    settings = make_settings(auto_migrate=False, database_url=f"sqlite+aiosqlite:///{tmp_path}/new.db")
    app = create_app(settings)
    with pytest.raises(DatabaseNotReadyError, match=r"the database is empty.*run 'bathyfleet migrate'"):
        async with app.router.lifespan_context(app):
            pass
    assert await migrate.current(settings.database_url) is None
    await migrate.upgrade(settings.database_url)
    async with app.router.lifespan_context(app):
        pass


async def test_a_database_that_cannot_be_opened_is_named(make_settings: Callable[..., Settings]) -> None:
    app = create_app(make_settings(database_url="sqlite+aiosqlite:////no/such/folder/fleet.db"))
    with pytest.raises(DatabaseNotReadyError, match="there is no folder /no/such/folder; check database_url"):
        async with app.router.lifespan_context(app):
            pass
