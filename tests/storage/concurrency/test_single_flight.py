"""One answer for all who wait for it, and none that is older than its question."""

import asyncio

import pytest

from app.storage.concurrency.single_flight import Shared


async def test_all_who_ask_while_an_answer_is_made_share_the_next_one() -> None:
    stored, gate, begun, times = 0, asyncio.Event(), asyncio.Event(), 0

    async def read() -> int:
        nonlocal times
        times += 1
        begun.set()
        found = stored
        await gate.wait()
        return found

    shared = Shared(read)
    first = asyncio.create_task(shared())
    await begun.wait()
    stored = 1  # written after the first answer was begun: only who asks now must have it
    later = [asyncio.create_task(shared()) for _ in range(50)]
    await asyncio.sleep(0)
    gate.set()
    assert await first == 0
    assert set(await asyncio.gather(*later)) == {1}
    assert times == 2
    stored = 2
    assert await shared() == 2


async def test_one_who_leaves_or_a_failure_is_nothing_to_the_others() -> None:
    gate, fail = asyncio.Event(), True

    async def read() -> str:
        await gate.wait()
        if fail:
            raise OSError("the disk is away")
        return "here"

    shared = Shared(read)
    leaving, staying = asyncio.create_task(shared()), asyncio.create_task(shared())
    await asyncio.sleep(0)
    leaving.cancel()
    gate.set()
    with pytest.raises(OSError, match="away"):
        await staying
    fail = False
    assert await shared() == "here"


async def test_work_that_everybody_left_ends_where_it_is_to() -> None:
    begun, ended = asyncio.Event(), asyncio.Event()
    gate = asyncio.Event()

    async def work() -> str:
        begun.set()
        try:
            await gate.wait()
        finally:
            ended.set()
        return "here"

    shared = Shared(work, ends_unwanted=True)
    callers = [asyncio.create_task(shared()) for _ in range(2)]
    await begun.wait()
    callers[0].cancel()
    await asyncio.wait([callers[0]])
    assert not ended.is_set(), "one waits yet"
    waiting = asyncio.create_task(shared())  # for what is begun after this
    await asyncio.sleep(0)
    waiting.cancel()
    callers[1].cancel()
    await ended.wait()
    gate.set()
    assert await shared() == "here"
