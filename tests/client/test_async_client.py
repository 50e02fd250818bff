"""The client with asyncio, beside a real service with access tokens."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing
from pathlib import Path

import numpy as np
import pytest

from app.api.accounts.tokens import TokenStore
from app.main import Server
from app.missions.settings import ImcSettings
from app.settings import Settings
from app.storage.database import Database
from bathyfleet.client import AsyncClient, NotAllowedError, NotFoundError, UnreachableError, models
from tests.support.api.relay import relay_to
from tests.support.api.rest import Tokens, make_tokens, mission_spec, running, soundings


@pytest.fixture
async def tokens(database_url: str) -> AsyncIterator[Tokens]:
    database = Database(database_url)
    store = TokenStore(database)
    yield Tokens(store=store, tokens=await make_tokens(store))
    await database.close()


@pytest.fixture
async def server(database_url: str, tokens: Tokens) -> AsyncIterator[Server]:
    settings = Settings(port=0, database_url=database_url, imc=ImcSettings(enabled=False), time_scale=100.0)
    async with running(settings) as server:
        yield server


@pytest.fixture
async def client(server: Server, tokens: Tokens) -> AsyncIterator[AsyncClient]:
    async with AsyncClient(server.url, tokens.tokens["operator"]) as client:
        yield client


async def test_a_survey_from_description_to_map(client: AsyncClient, tmp_path: Path) -> None:
    described = mission_spec(vehicles=[{"name": "a", "kind": "sim"}], steps=2)
    mission = await client.create_mission(described)
    preflight = await client.check_mission(mission.id)
    assert preflight.ready, preflight
    kinds: set[str] = set()

    async def watch() -> None:
        async with aclosing(client.live(mission.id)) as messages:
            async for message in messages:
                kinds.add(message.type)
                if isinstance(message, models.StateMessage) and message.mission.state == "finished":
                    return

    watching = asyncio.create_task(watch())
    await client.start_mission(mission.id)
    entries = [entry async for entry in client.events(mission.id, until_ended=True)]
    assert [entry.id for entry in entries] == sorted({entry.id for entry in entries})
    assert entries[-1].data["state"] == "finished"
    steps = [step.number async for page in client.pages(client.list_steps, mission.id, limit=1) for step in page]
    assert steps == [step.number for step in await client.list_steps(mission.id)] != []
    assert (await client.wait_for(mission.id, "finished")).progress.step == 2
    await asyncio.wait_for(watching, 240)
    assert kinds >= {"vehicles", "mission", "event"}
    found = await client.map(mission.id)
    depth = np.array((await client.get_map(mission.id)).depth_m, dtype=float)
    np.testing.assert_allclose(found["depth"].values, depth, atol=0.01)
    path = await client.download(mission.id, "map.nc", tmp_path / "map.nc")
    assert path.stat().st_size > 1000


async def test_measurements_go_over_a_line_that_loses_answers(
    client: AsyncClient, tokens: Tokens, server: Server
) -> None:
    mission = await client.create_mission(mission_spec())
    with relay_to(server.url) as relay:
        relay.answers_to_lose = 1
        async with AsyncClient(relay.url, tokens.tokens["rover"]) as vehicle:
            verdict = await vehicle.send_measurements(mission.id, soundings(6), batch=4)
            relay.answers_to_lose = 1
            with pytest.raises(UnreachableError, match="has to be looked up"):
                await vehicle.post_scans(mission.id, {"items": []})
    assert (verdict.accepted, verdict.replayed, len(verdict.items)) == (6, True, 6)


async def test_who_may_not_is_told_so(client: AsyncClient, tokens: Tokens, server: Server) -> None:
    mission = await client.create_mission(mission_spec())
    async with AsyncClient(server.url) as stranger:
        with pytest.raises(NotAllowedError) as refused:
            await stranger.list_missions()
        assert refused.value.kind == "unauthenticated"
        with pytest.raises(NotAllowedError):
            await anext(aiter(stranger.events(mission.id)))
        with pytest.raises(NotAllowedError):
            await anext(aiter(stranger.live(mission.id)))
    async with AsyncClient(server.url, tokens.tokens["viewer"]) as viewer:
        assert (await viewer.get_session()).role == "viewer"
        with pytest.raises(NotAllowedError) as refused:
            await viewer.start_mission(mission.id)
        assert refused.value.status == 403
        with pytest.raises(NotFoundError):
            await anext(aiter(viewer.live("nowhere")))
