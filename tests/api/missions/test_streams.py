"""What happens, as it happens: server-sent events and the WebSocket."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from typing import Any
from unittest.mock import AsyncMock

import httpx
import pytest
import websockets
from httpx_sse import ServerSentEvent, aconnect_sse
from pydantic import TypeAdapter
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as NoFreeConnectionError

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.main import Server
from app.missions.errors import MissionElsewhereError, NotAMemberError
from app.missions.views.messages import LiveMessage
from app.missions.views.mission import Level
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import make_client, mission_spec, running, soundings

LIST = {"Accept": "application/json"}


async def take(stream: AsyncIterator[ServerSentEvent], count: int) -> list[dict[str, Any]]:
    entries = []
    async for event in stream:
        entry = json.loads(event.data)
        assert (event.id, event.event) == (str(entry["id"]), entry["kind"])
        entries.append(entry)
        if len(entries) == count:
            break
    return entries


async def test_the_log_is_a_list_for_who_wants_json(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}/events"
    for accept in (
        "application/json",
        "application/json, text/plain, */*",
        "text/event-stream;q=0.5, application/json",
    ):
        answer = await client.get(path, headers={"Accept": accept})
        assert answer.headers["content-type"] == "application/json"
        assert "created" in answer.json()[0]["message"]
    last = answer.json()[-1]["id"]
    assert (await client.get(path, headers=LIST, params={"after": last})).json() == []
    assert len((await client.get(path, headers=LIST, params={"limit": 1})).json()) == 1
    refused = await client.get(path, headers={"Accept": "text/html"})
    assert (refused.status_code, refused.json()["type"]) == (406, "urn:bathyfleet:problem:not-acceptable")


async def test_the_stream_replays_and_goes_on(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}"
    async with aconnect_sse(client, "GET", f"{path}/events") as source:
        assert source.response.headers["content-type"].startswith("text/event-stream")
        replayed = await take(source.aiter_sse(), 1)
        assert "created" in replayed[0]["message"]
    async with aconnect_sse(client, "GET", f"{path}/events", params={"after": replayed[0]["id"]}) as source:
        taking = asyncio.create_task(take(source.aiter_sse(), 1))
        await client.post(f"{path}/start", json={"note": "all clear"})
        happened = await taking
    assert happened[0]["id"] > replayed[0]["id"]


async def test_a_stream_resumes_without_gap_or_repetition(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}"
    for action in ("start", "pause", "resume", "pause", "abort"):
        assert (await client.post(f"{path}/{action}")).status_code == 200
    stored = (await client.get(f"{path}/events", headers=LIST)).json()
    assert len(stored) >= 6
    for done in (0, 1, len(stored) - 1):
        headers = {"Last-Event-ID": str(stored[done - 1]["id"])} if done else {}
        async with aconnect_sse(client, "GET", f"{path}/events", headers=headers) as source:
            assert await take(source.aiter_sse(), len(stored) - done) == stored[done:]


async def test_lines_that_are_told_in_another_order_than_written_all_reach_the_stream(
    server: Server, client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    live = await server.config.app.state.edge.service.get(mission["id"])
    async with aconnect_sse(client, "GET", f"/missions/{mission['id']}/events") as source:
        stream = source.aiter_sse()
        await take(stream, 1)
        one, other = (live.journal.line(Level.INFO, "note", words) for words in ("written first", "written later"))
        async with live.database.writing() as session:
            session.add(one)
            await session.flush()
            session.add(other)
        live.journal.tell(other)
        live.journal.tell(one)
        told = await take(stream, 2)
    assert [entry["message"] for entry in told] == ["written later", "written first"]


async def test_a_wrong_last_event_id_is_named(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    answer = await client.get(f"/missions/{mission['id']}/events", headers={"Last-Event-ID": "yesterday"})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["location"] == "header"


def live_url(server: Server, mission_id: str, query: str = "") -> str:
    return f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/{mission_id}/live{query}"


@pytest.mark.slow
async def test_the_socket_sends_a_snapshot_then_what_changes(
    server: Server, client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    adapter: TypeAdapter[Any] = TypeAdapter(LiveMessage)
    async with websockets.connect(live_url(server, mission["id"])) as socket:
        first = adapter.validate_json(await socket.recv())
        assert (first.type, first.mission.id) == ("snapshot", mission["id"])
        await socket.send("whatever a viewer sends is ignored")
        await client.post(f"/missions/{mission['id']}/measurements", json={"items": soundings(12)})
        await client.post(f"/missions/{mission['id']}/start")
        seen: dict[str, Any] = {}
        while not {"event", "mission", "vehicles"} <= set(seen):
            message = adapter.validate_json(await socket.recv())
            seen[message.type] = message
        assert seen["mission"].mission.state == "running"
        assert seen["vehicles"].vehicles[0].name == "rover"


async def test_an_unknown_mission_closes_the_socket_with_a_reason(server: Server) -> None:
    async with websockets.connect(live_url(server, "nowhere")) as socket:
        with pytest.raises(websockets.ConnectionClosedError) as closed:
            await socket.recv()
    assert closed.value.rcvd is not None
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (4404, "there is no mission 'nowhere'")


@pytest.mark.parametrize(
    "error",
    [
        NotAMemberError("apart"),
        MissionElsewhereError("elsewhere"),
        NoFreeConnectionError("none is free"),
        OperationalError("select", None, ConnectionError("gone")),
    ],
    ids=lambda error: type(error).__name__,
)
async def test_a_mission_that_cannot_be_had_at_the_moment_is_asked_for_again(
    server: Server, mission: dict[str, Any], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    monkeypatch.setattr(server.config.app.state.edge.service, "get", AsyncMock(side_effect=error))
    async with websockets.connect(live_url(server, mission["id"])) as socket:
        await socket.wait_closed()
        assert socket.close_code == 1013


async def test_viewers_are_counted_and_limited(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings(max_streams=2)) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()
        events = f"/missions/{mission['id']}/events"
        async with (
            websockets.connect(live_url(server, mission["id"])) as one,
            aconnect_sse(client, "GET", events) as source,
        ):
            await one.recv()
            stream = source.aiter_sse()
            await take(stream, 1)
            text = (await client.get("/metrics")).text
            assert 'bathyfleet_live_viewers{kind="websocket"} 1.0' in text
            assert 'bathyfleet_live_viewers{kind="sse"} 1.0' in text
            refused = await client.get(events)
            assert (refused.status_code, refused.headers["retry-after"]) == (429, "10")
            async with websockets.connect(live_url(server, mission["id"])) as third:
                with pytest.raises(websockets.ConnectionClosedError) as closed:
                    await third.recv()
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4429
        while 'kind="websocket"} 0.0' not in (await client.get("/metrics")).text:
            pass


async def test_no_viewer_takes_all_views_and_some_are_for_operators(
    make_settings: Callable[..., Settings],
) -> None:
    settings = make_settings(max_streams=16)
    database = Database(settings.database_url)
    store = TokenStore(database)
    async with running(settings) as server, make_client(server) as client, contextlib.AsyncExitStack() as open_views:
        mission = (await client.post("/missions", json=mission_spec())).json()
        tokens = [(await store.create(f"viewer-{n}", Role.VIEWER))[1] for n in range(5)]
        tokens += [(await store.create(f"operator-{n}", Role.OPERATOR))[1] for n in range(2)]

        async def views_of(token: str) -> int:
            """As many live views as the holder of a token gets."""
            headers = {"Authorization": f"Bearer {token}"}
            for number in range(20):
                view = await open_views.enter_async_context(
                    websockets.connect(live_url(server, mission["id"]), additional_headers=headers)
                )
                with contextlib.suppress(websockets.ConnectionClosedError):
                    await view.recv()
                    continue
                assert view.close_code == 4429
                return number
            return 20

        taken = [await views_of(token) for token in tokens]
        assert taken == [4, 4, 4, 2, 0, 2, 0]
        refused = await client.get(
            f"/missions/{mission['id']}/events", headers={"Authorization": f"Bearer {tokens[0]}"}
        )
        assert (refused.status_code, refused.json()["type"]) == (429, "urn:bathyfleet:problem:too-many-streams")
    await database.close()


async def test_streams_that_open_at_once_are_refused_before_their_answer_begins(
    make_settings: Callable[..., Settings],
) -> None:
    most = 16
    async with running(make_settings(max_streams=most)) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()
        port = client.base_url.port
        lines = [await asyncio.open_connection("127.0.0.1", port) for _ in range(4 * most)]
        path = f"/api/v1/missions/{mission['id']}/events"
        head = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAccept: text/event-stream\r\n\r\n"
        for _, writer in lines:
            writer.write(head.encode())
        begun = [(await reader.readuntil(b"\r\n\r\n")).decode() for reader, _ in lines]
        statuses = sorted(int(text.split()[1]) for text in begun)
        for _, writer in lines:
            writer.close()
            await writer.wait_closed()
    assert statuses == most * [200] + 3 * most * [429]


async def test_a_stopping_service_ends_streams_and_sockets(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings()) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()
        async with (
            websockets.connect(live_url(server, mission["id"])) as socket,
            aconnect_sse(client, "GET", f"/missions/{mission['id']}/events") as source,
        ):
            await socket.recv()
            stream = source.aiter_sse()
            await take(stream, 1)
            server.stop()
            with contextlib.suppress(websockets.ConnectionClosedError):  # what 1012 is to this client
                async for _ in socket:
                    pass
            assert socket.close_code in (1001, 1012), "it goes away, or starts again: whoever was faster to say so"
            assert [event async for event in stream] == []
