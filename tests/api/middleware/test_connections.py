"""Connections are shared out: whatever strangers and viewers hold, an operator gets through."""

import asyncio
import resource
from collections.abc import Callable
from contextlib import AsyncExitStack

import httpx
import pytest
import websockets

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.api.middleware.connections import Sockets
from app.descriptors import allow_descriptors
from app.main import Server
from app.settings import Settings
from app.storage.database import Database
from bathyfleet.client import AsyncClient, BusyError
from tests.support.api.rest import make_client, mission_spec, running
from tests.support.waiting import until

MOST = 40
Connection = tuple[asyncio.StreamReader, asyncio.StreamWriter]


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def port_of(server: Server) -> int:
    return int(server.url.rpartition(":")[2])


async def connect(server: Server, sent: bytes = b"", *, answered: bool = False) -> Connection:
    reader, writer = await asyncio.open_connection("127.0.0.1", port_of(server))
    writer.write(sent)
    if answered:
        await reader.readuntil(b"\r\n\r\n")
    return reader, writer


async def close(connections: list[Connection]) -> None:
    for _, writer in connections:
        writer.transport.abort()


class Fleet:
    """A mission, and who may do what."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.tokens: dict[str, str] = {}
        self.mission = ""

    async def prepare(self, *viewers: str) -> None:
        database = Database(self.settings.database_url)
        store = TokenStore(database)
        async with running(self.settings) as server, make_client(server) as client:
            for name in viewers:
                _, self.tokens[name] = await store.create(name, Role.VIEWER)
            _, self.tokens["operator"] = await store.create("operator", Role.OPERATOR)
            created = await client.post("/missions", json=mission_spec(), headers=bearer(self.tokens["operator"]))
            self.mission = created.json()["id"]
        await database.close()

    async def abort(self, server: Server) -> httpx.Response:
        """What an operator does who was not here before."""
        async with make_client(server) as client:
            return await client.post(f"/missions/{self.mission}/abort", headers=bearer(self.tokens["operator"]))

    def stream_of(self, name: str) -> bytes:
        path = f"/api/v1/missions/{self.mission}/events"
        head = f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {self.tokens[name]}\r\n"
        return (head + "Accept: text/event-stream\r\n\r\n").encode()


@pytest.fixture
def fleet(make_settings: Callable[..., Settings]) -> Fleet:
    return Fleet(make_settings(max_connections=MOST, max_streams=1000))


HALF_A_HEAD = b"GET /health/live HTTP/1.1\r\nHost: localhost\r\nX-Slow: "
WHOLE = b"GET /health/live HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.mark.parametrize(
    ("sent", "answered"),
    [(b"", False), (HALF_A_HEAD, False), (WHOLE, True)],
    ids=["never a byte", "slow head", "keep-alive"],
)
async def test_an_abort_gets_through_while_strangers_hold_every_connection(
    fleet: Fleet, sent: bytes, answered: bool
) -> None:
    await fleet.prepare()
    async with running(fleet.settings) as server:
        idle = [await connect(server, sent, answered=answered) for _ in range(5 * MOST)]
        answer = await fleet.abort(server)
        assert answer.status_code == 200, answer.text
        await close(idle)


async def test_the_longest_idle_stranger_makes_room(fleet: Fleet) -> None:
    await fleet.prepare()
    async with running(fleet.settings) as server:
        idle = [await connect(server) for _ in range(MOST)]
        async with make_client(server) as client:
            assert (await client.get("/health/live")).status_code == 200
            assert await asyncio.wait_for(idle[0][0].read(), 20) == b"", "the first has been closed"
            idle[-1][1].write(WHOLE.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n"))
            assert b" 200 " in await asyncio.wait_for(idle[-1][0].read(), 20), "the last has not"
        await close(idle)


async def test_an_operators_idle_connection_outlasts_strangers(fleet: Fleet) -> None:
    await fleet.prepare()
    async with running(fleet.settings) as server, make_client(server) as client:
        headers = bearer(fleet.tokens["operator"])
        assert (await client.get("/missions", headers=headers)).status_code == 200
        idle = [await connect(server) for _ in range(3 * MOST)]
        (kept,) = client._transport._pool.connections  # type: ignore[attr-defined]
        assert (await client.get("/missions", headers=headers)).status_code == 200
        assert client._transport._pool.connections == [kept]  # type: ignore[attr-defined]
        await close(idle)


async def test_an_abort_gets_through_while_viewers_hold_as_much_as_they_can(fleet: Fleet) -> None:
    viewers = [f"viewer-{n}" for n in range(6)]
    await fleet.prepare(*viewers)
    async with running(fleet.settings) as server:
        held: list[Connection] = []
        statuses: dict[str, list[bytes]] = {}
        for name in viewers:
            for _ in range(MOST // 2):
                reader, writer = await connect(server, fleet.stream_of(name))
                held.append((reader, writer))
                statuses.setdefault(name, []).append((await reader.readline()).split()[1])
        taken = {name: said.count(b"200") for name, said in statuses.items()}
        assert taken[viewers[0]] == MOST // 4, "nobody has more than a share"
        assert taken[viewers[1]] == MOST // 4, "the first has not taken the second one's"
        assert sum(taken.values()) < MOST, "some are left for operators"
        assert b"503" in statuses[viewers[-1]]
        answer = await fleet.abort(server)
        assert answer.status_code == 200, answer.text
        await close(held)


async def test_who_is_refused_is_told_why(fleet: Fleet) -> None:
    await fleet.prepare("viewer")
    async with running(fleet.settings) as server, make_client(server) as client:
        held = [await connect(server, fleet.stream_of("viewer"), answered=True) for _ in range(MOST // 4)]
        refused = await client.get("/missions", headers=bearer(fleet.tokens["viewer"]))
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "2")
        assert refused.json()["type"] == "urn:bathyfleet:problem:too-many-connections"
        url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/{fleet.mission}/live"
        async with websockets.connect(url, additional_headers=bearer(fleet.tokens["viewer"])) as socket:
            with pytest.raises(websockets.ConnectionClosedError):
                await socket.recv()
            assert socket.close_code == 4429
        async with AsyncClient(server.url, fleet.tokens["viewer"], patience_s=0) as viewer:
            with pytest.raises(BusyError, match="as many requests are open"):
                await anext(viewer.live(fleet.mission))
        await close(held)

        async def served() -> bool:
            return (await client.get("/missions", headers=bearer(fleet.tokens["viewer"]))).status_code == 200

        await until(served, "the operator is served")


async def test_an_abort_gets_through_while_strangers_wait_for_bodies(fleet: Fleet) -> None:
    await fleet.prepare()
    body = b"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    body += b"Authorization: Bearer bf_guess\r\nContent-Length: 100\r\n\r\n{"
    async with running(fleet.settings) as server:
        held = [await connect(server, body) for _ in range(3 * MOST)]
        answer = await fleet.abort(server)
        assert answer.status_code == 200, answer.text
        await close(held)


async def test_without_tokens_the_user_of_this_machine_gets_through(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings(max_connections=MOST)) as server, make_client(server) as client:
        idle = [await connect(server, HALF_A_HEAD) for _ in range(2 * MOST)]
        slow = b"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nX-Real-IP: 192.0.2.1\r\n"
        slow += b"Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{"
        idle += [await connect(server, slow) for _ in range(MOST)]
        assert (await client.post("/missions", json=mission_spec())).status_code == 201
        await close(idle)


async def test_every_connection_is_given_back(fleet: Fleet) -> None:
    await fleet.prepare("viewer")
    async with running(fleet.settings) as server, make_client(server) as client:
        for _ in range(3):
            held = [await connect(server, fleet.stream_of("viewer")) for _ in range(MOST)]
            url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/{fleet.mission}/live"
            async with AsyncExitStack() as stack:
                for _ in range(3):
                    headers = bearer(fleet.tokens["operator"])
                    await stack.enter_async_context(websockets.connect(url, additional_headers=headers))
            await close(held)
        assert (await client.get("/health/live")).status_code == 200
        await client.aclose()
        shares = server.shares

        async def all_given_back() -> bool:
            return shares.held == 0 and len(server.sockets) == 0

        await until(all_given_back, "every connection is given back")


def test_the_process_may_open_as_many_connections_as_are_set_up() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    low = min(1024, hard)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (low, hard))
        allow_descriptors(1000)
        allowed = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        assert allowed == 2512 if hard == resource.RLIM_INFINITY or hard >= 2512 else allowed == hard
        allow_descriptors(16)
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] == allowed, "never lowered"
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


class _Held:
    """A connection in name only."""

    def __init__(self, host: str) -> None:
        self.host = host


def test_of_other_machines_each_has_a_share_and_the_one_with_most_makes_room() -> None:
    sockets: Sockets[_Held] = Sockets(100, lambda host: host == "127.0.0.1")
    many = [_Held("192.0.2.1") for _ in range(200)]
    left = [sockets.opened(held, held.host) for held in many]
    assert len(sockets) == 25, "a quarter of them"
    assert left[24] is None
    assert left[25] is many[0]
    other = _Held("192.0.2.2")
    assert sockets.opened(other, other.host) is None
    near = [_Held("127.0.0.1") for _ in range(150)]
    gone = [sockets.opened(held, held.host) for held in near]
    assert len(sockets) == 100
    assert other not in gone
    sockets.busy(other)
    for held in near:
        sockets.busy(held)
    last = [sockets.opened(held, held.host) for held in (_Held("192.0.2.3"), _Held("192.0.2.3"))]
    assert all(leaver is not None and leaver.host == "192.0.2.1" for leaver in last)
