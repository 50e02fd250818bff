"""How often somebody may ask, and how long the service waits for him."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

import httpx
import pytest
import websockets
from hypothesis import given
from hypothesis import strategies as st

from app.api.accounts import rates as limits
from app.api.accounts.rates import Buckets, RequestLimits, network_of
from app.api.accounts.roles import Role
from app.api.accounts.tokens import DIGESTS_READ_AGAIN_S, Principal, TokenStore
from app.main import Server
from app.settings import Settings
from app.storage.database import Database
from app.storage.upkeep.prepare import prepare_database
from tests.support.api.rest import make_client, mission_spec, running


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


@given(st.lists(st.floats(0.0, 3.0), max_size=60), st.floats(0.5, 20.0), st.floats(1.0, 10.0))
def test_nobody_gets_more_than_the_rate_and_one_bucket(pauses: list[float], per_s: float, size: float) -> None:
    now, taken = 0.0, 0
    bucket = Buckets(per_s, size, lambda: now)
    for pause in pauses:
        now += pause
        wait_s = bucket.take("somebody")
        taken += wait_s == 0.0
        assert taken <= size + per_s * now + 1e-6
        if wait_s:
            now += wait_s + 1e-6
            assert bucket.take("somebody") == 0.0
            taken += 1


def test_any_number_of_clients_is_remembered_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_CLIENTS", 50)
    held = RequestLimits(1.0, 3)
    for number in range(400):
        held.wait_s(None, f"10.0.{number // 256}.{number % 256}")
        held.log_in(f"bf_{number}", f"10.0.{number // 256}.{number % 256}", good=number % 2 == 0)
    kept = (held._requests._filled, held._failures._filled, held._known)
    assert all(len(what) <= 50 for what in kept)


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2::5", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "2001:db8:1:2::/64"),
        ("", ""),
    ],
)
def test_whoever_has_an_address_has_its_network(address: str, network: str) -> None:
    assert network_of(address) == network


async def test_who_asks_too_often_is_told_when_to_come_back(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings(max_requests_per_s=0.01)) as server, make_client(server) as client:
        assert (await client.get("/health/live")).status_code == 200
        refused = await client.get("/missions")
        assert (refused.status_code, refused.json()["type"]) == (429, "urn:bathyfleet:problem:too-many-requests")
        assert 1 <= int(refused.headers["retry-after"]) <= 100
        url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/none/live"
        with pytest.raises(websockets.InvalidStatus):
            await websockets.connect(url)


async def test_guessing_tokens_ends_soon_and_disturbs_nobody_who_has_one(
    make_settings: Callable[..., Settings],
) -> None:
    settings = make_settings(max_failed_logins=3)
    database = Database(settings.database_url)
    _, good = await TokenStore(database).create("screen", Role.VIEWER)
    _, other = await TokenStore(database).create("other", Role.VIEWER)
    await database.close()

    async def ask(client: httpx.AsyncClient, token: str | None) -> int:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        return (await client.get("/missions", headers=headers)).status_code

    async with running(settings) as server, make_client(server) as client:
        assert await ask(client, good) == 200
        assert [await ask(client, f"bf_{guess}") for guess in range(5)] == [401, 401, 401, 429, 429]
        assert await ask(client, good) == 200
        assert await ask(client, None) == 401
        assert await ask(client, other) == 200, "a right token is let through, though new to this process"
        assert await ask(client, "bf_guess") == 429
        url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/none/live"
        with pytest.raises(websockets.InvalidStatus):
            await websockets.connect(url, additional_headers={"Authorization": "Bearer bf_guess"})


@pytest.mark.slow
async def test_a_right_token_is_never_refused_for_wrong_ones_from_its_address(
    make_settings: Callable[..., Settings],
) -> None:
    """An abort, made by a token that this process sees for the first time, right after many guesses."""
    settings = make_settings(max_failed_logins=1)
    database = Database(settings.database_url)
    store = TokenStore(database)
    _, operator = await store.create("operator", Role.OPERATOR)
    async with running(settings) as server, make_client(server) as client:
        created = await client.post("/missions", json=mission_spec(), headers=bearer(operator))
        path = f"/missions/{created.json()['id']}/abort"
    async with running(settings) as server, make_client(server) as client:
        guesses = [(await client.get("/missions", headers=bearer(f"bf_{n}"))).status_code for n in range(20)]
        assert guesses[0] == 401
        assert set(guesses[1:]) == {429}
        answer = await client.post(path, headers=bearer(operator))
        assert answer.status_code == 200, answer.text
        token_id, later = await store.create("made meanwhile", Role.OPERATOR)
        assert (await client.get("/missions", headers=bearer(later))).status_code == 200
        await store.revoke(token_id)
        after = [(await client.get("/missions", headers=bearer(later))).status_code for _ in range(3)]
        assert after == [401, 429, 429], "a revoked token is a wrong one"
    await database.close()


async def test_a_right_token_is_served_while_its_address_asks_too_often(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings(max_requests_per_s=1.0)
    database = Database(settings.database_url)
    _, operator = await TokenStore(database).create("operator", Role.OPERATOR)
    await database.close()
    async with running(settings) as server, make_client(server) as client:
        answers = [(await client.get("/health/live")).status_code for _ in range(20)]
        assert answers[-1] == 429
        assert (await client.get("/missions", headers=bearer(operator))).status_code == 200
        assert (await client.get("/missions", headers=bearer("bf_guess"))).status_code == 429


async def test_however_many_guesses_wait_the_tokens_are_read_seldom(make_settings: Callable[..., Settings]) -> None:
    database = Database(make_settings().database_url)
    await prepare_database(database.url, may_upgrade=True)
    store = TokenStore(database)
    _, right = await store.create("right", Role.VIEWER)
    read = 0
    fetch = store._read_digests

    async def counted() -> dict[str, Principal]:
        nonlocal read
        read += 1
        return await fetch()

    store._read_digests = counted
    begun = asyncio.get_running_loop().time()
    found = await asyncio.gather(*(store.exists(f"bf_{n}") for n in range(500)), store.exists(right))
    assert found == [False] * 500 + [True]
    for n in range(20):
        assert not await store.exists(f"bf_again_{n}")
    took_s = asyncio.get_running_loop().time() - begun
    assert read <= 2 + took_s / DIGESTS_READ_AGAIN_S
    assert await store.exists(right)
    store.close()
    await database.close()


async def _answer(server: Server, sent: bytes) -> bytes:
    """What the service says to somebody who sends this and no more, until it closes the connection."""
    reader, writer = await asyncio.open_connection("127.0.0.1", int(server.url.rpartition(":")[2]))
    try:
        writer.write(sent)
        return await reader.read()
    finally:
        writer.close()


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (b"", b"408"),
        (b"GET /health/live HTTP/1.1\r\nHost: localhost\r\nX-Slow: ", b"408"),
        (
            b"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
            b"Content-Length: 100\r\n\r\n{",
            b"408",
        ),
    ],
    ids=["nothing", "half a head", "half a body"],
)
async def test_a_client_that_stops_half_way_is_not_waited_for(
    make_settings: Callable[..., Settings], sent: bytes, status: bytes
) -> None:
    async with running(make_settings(slow_client_s=1)) as server:
        answer = await asyncio.wait_for(_answer(server, sent), 20)
        assert answer.startswith(b"HTTP/1.1 " + status)


@pytest.mark.parametrize("begin", [b"GET /", b"GET / HTTP/1.1\r\nX-Long: "], ids=["address", "header"])
async def test_a_head_without_end_is_not_gathered(make_settings: Callable[..., Settings], begin: bytes) -> None:
    async with running(make_settings()) as server:
        reader, writer = await asyncio.open_connection("127.0.0.1", int(server.url.rpartition(":")[2]))
        writer.write(begin)
        with suppress(ConnectionError):
            while not reader.at_eof():
                writer.write(b"x" * 10_000)
                await writer.drain()
                await asyncio.sleep(0)
        with suppress(ConnectionError):
            assert (await reader.read()).startswith((b"HTTP/1.1 431", b"HTTP/1.1 400"))
        writer.close()
