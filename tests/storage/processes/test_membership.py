"""Processes that share a database know of each other who lives."""

import asyncio
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from app.storage.database import Database
from app.storage.processes import membership
from app.storage.processes.membership import Membership, MembershipLostError, Silence, alive_beside, make_membership
from tests.support.storage.databases import Databases, postgres_server

HOLDER = """
import asyncio, sys
from app.storage.processes.membership import make_membership

async def hold(url, number):
    membership = make_membership(url, lambda: None)
    await membership.enter(number)
    print("held", flush=True)
    await asyncio.sleep(3600)

asyncio.run(hold(sys.argv[1], int(sys.argv[2])))
"""


@asynccontextmanager
async def member(url: str, number: int, on_call: Callable[[], None] = lambda: None) -> AsyncIterator[Membership]:
    entered = make_membership(url, on_call)
    await entered.enter(number)
    try:
        yield entered
    finally:
        await entered.leave()


async def test_each_sees_who_lives(url: str) -> None:
    async with member(url, 1) as one, AsyncExitStack() as guests:
        two = await guests.enter_async_context(member(url, 2))
        assert await one.alive([1, 2, 3]) == {1, 2}
        assert await two.alive([1, 3]) == {1}
        await guests.aclose()
        assert await one.alive([1, 2, 3]) == {1}


async def test_who_is_none_of_them_sees_who_lives(url: str) -> None:
    database = Database(url)
    async with member(url, 2), database.reading() as session:
        assert await alive_beside(session, url, [1, 2]) == {2}
    await database.close()


async def test_who_left_does_not_live_from_then_on(url: str) -> None:
    async with member(url, 1) as one:
        for number in range(2, 42):
            async with member(url, number):
                pass
            assert await one.alive(range(1, 42)) == {1}


async def test_a_number_is_one_process_s(url: str) -> None:
    async with member(url, 1):
        with pytest.raises(MembershipLostError):
            await make_membership(url, lambda: None).enter(1)


async def test_a_number_is_free_again_once_its_process_left(url: str) -> None:
    async with member(url, 1):
        pass
    async with member(url, 1) as again:
        assert await again.alive([1]) == {1}


async def test_a_killed_process_does_not_live(url: str) -> None:
    async with member(url, 1) as one:
        other = await asyncio.create_subprocess_exec(
            sys.executable, "-c", HOLDER, url, "2", stdout=asyncio.subprocess.PIPE
        )
        try:
            assert other.stdout is not None
            assert await asyncio.wait_for(other.stdout.readline(), 60) == b"held\n"
            assert await one.alive([1, 2]) == {1, 2}
        finally:
            other.send_signal(signal.SIGKILL)
            await other.wait()
        async with asyncio.timeout(10):
            while await one.alive([1, 2]) != {1}:  # noqa: ASYNC110 - the server notices in its own time
                await asyncio.sleep(0.02)


async def test_others_are_called_and_hear_it(databases: Databases) -> None:
    url = databases.fresh("postgresql")
    called = asyncio.Event()
    async with member(url, 1, called.set), member(url, 2) as two:
        await two.call()
        assert await asyncio.wait_for(called.wait(), 10)


async def test_whose_connection_broke_is_told_so(databases: Databases) -> None:
    url = databases.fresh("postgresql")
    async with member(url, 1) as one, member(url, 2) as two:
        killed = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND objid = 1"
        await two._ask("execute", killed)  # type: ignore[attr-defined]
        with pytest.raises(MembershipLostError):
            await one.alive([1])
        await one.enter(1)
        assert await two.alive([1, 2]) == {1, 2}


async def test_a_server_that_is_a_standby_lets_nobody_in_until_it_is_promoted() -> None:
    with postgres_server() as server:
        url = server.create("fleet")
        waiting = make_membership(url, lambda: None)
        with server.as_standby(), pytest.raises(MembershipLostError, match="during recovery"):
            await waiting.enter(1)
        await waiting.enter(1)
        assert await waiting.alive([1]) == {1}
        await waiting.leave()


async def test_who_hangs_does_not_live_for_who_looks_on(databases: Databases, monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps its lock and its connection, and asks nothing."""
    monkeypatch.setattr(membership, "HUNG_LOOKS", 5)
    monkeypatch.setattr(membership, "LOOK_S", 0.0)
    url = databases.fresh("postgresql")
    async with member(url, 1) as one, member(url, 2), member(url, 3) as three:
        for _ in range(5):
            assert await one.alive([1, 2, 3]) == {1, 2, 3}
            await three.alive([3])
        assert await one.alive([1, 2, 3]) == {1, 3}


async def test_all_that_a_process_has_begun_is_ended_when_it_is_taken_for_dead(databases: Databases) -> None:
    url = databases.fresh("postgresql")
    hung, own = Database(url), Database(url)
    held = make_membership(url, lambda: None, hung.application_name)
    await held.enter(1)
    async with AsyncExitStack() as stack:
        stack.push_async_callback(held.leave)
        stack.push_async_callback(hung.close)
        stack.push_async_callback(own.close)
        async with hung.reading() as session:
            await session.execute(text("SELECT 1"))
            one = make_membership(url, lambda: None, own.application_name)
            await one.enter(2)
            stack.push_async_callback(one.leave)
            await one.end_sessions([1])
            with pytest.raises(DBAPIError):
                await session.execute(text("SELECT 1"))
        with pytest.raises(MembershipLostError):
            await held.alive([1])
        assert await one.alive([1, 2]) == {2}


@pytest.mark.parametrize("slept", [False, True])
def test_looks_are_counted_not_seconds(slept: bool) -> None:
    """Who was held up itself, with the whole machine, blames nobody; who looks on all the time does."""
    at, clock = datetime(2026, 1, 1, tzinfo=UTC), [0.0]
    silence = Silence(lambda: clock[0])
    found: list[set[int]] = []
    for _ in range(10 if slept else membership.HUNG_LOOKS + 1):
        found.append(silence.hung({7: at, 8: None}))
        clock[0] += 3600.0 if slept else 1.0
    assert found[-1] == (set() if slept else {7})
    assert not any(found[:-1])
    assert silence.hung({7: at + timedelta(seconds=1)}) == set()


def test_looks_in_quick_succession_count_once() -> None:
    silence = Silence(lambda: 0.0)
    at = datetime(2026, 1, 1, tzinfo=UTC)
    assert not any(silence.hung({7: at}) for _ in range(10 * membership.HUNG_LOOKS))
