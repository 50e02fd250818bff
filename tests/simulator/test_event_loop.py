"""Simulated time goes on while everybody waits, and stands still while somebody works."""

import asyncio
import threading
import time
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import aiosqlite

from simulator.event_loop import BEGIN_S, SimulatedTimeLoop


def run(main: Coroutine[Any, Any, list[float]]) -> list[float]:
    with asyncio.Runner(loop_factory=SimulatedTimeLoop) as runner:
        return runner.run(main)


def test_hours_pass_at_once_and_in_their_order() -> None:
    async def main() -> list[float]:
        loop, woke = asyncio.get_running_loop(), list[float]()

        async def sleeper(after_s: float) -> None:
            await asyncio.sleep(after_s)
            woke.append(loop.time() - BEGIN_S)

        await asyncio.gather(*(sleeper(after_s) for after_s in (7200.0, 1e6, 0.1, 3600.0)))
        return woke

    begun_s = time.monotonic()
    woke = run(main())
    assert [round(woke_s, 6) for woke_s in woke] == [0.1, 3600.0, 7200.0, 1e6]
    assert time.monotonic() - begun_s < 3600.0


def test_time_stands_still_while_a_thread_works() -> None:
    async def main() -> list[float]:
        loop, go_on = asyncio.get_running_loop(), threading.Event()
        ticks = list[float]()

        async def ticking() -> None:
            while True:
                await asyncio.sleep(1.0)
                ticks.append(loop.time())

        beside = asyncio.create_task(ticking())
        await asyncio.sleep(2.5)
        before_s = loop.time()
        threading.Timer(0.05, go_on.set).start()
        await asyncio.to_thread(go_on.wait)
        after_s = loop.time()
        beside.cancel()
        return [before_s, after_s, float(len(ticks))]

    before_s, after_s, ticks = run(main())
    assert before_s == after_s
    assert ticks == 2


def test_time_stands_still_for_the_database(tmp_path: Path) -> None:
    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        beside = asyncio.create_task(asyncio.sleep(1e9))
        begun_s = loop.time()
        async with aiosqlite.connect(tmp_path / "a.db") as database:
            await database.execute("CREATE TABLE t (x INTEGER)")
            for x in range(50):
                await database.execute("INSERT INTO t VALUES (?)", (x,))
            await database.commit()
            async with database.execute("SELECT count(*) FROM t") as rows:
                found = await rows.fetchone()
        beside.cancel()
        assert found == (50,)
        return [loop.time() - begun_s]

    assert run(main()) == [0.0]


def test_who_gives_up_a_thread_does_not_stop_time_for_ever() -> None:
    async def main() -> list[float]:
        loop, never = asyncio.get_running_loop(), threading.Event()
        work = asyncio.ensure_future(asyncio.to_thread(never.wait))
        await asyncio.sleep(0)
        work.cancel()
        await asyncio.gather(work, return_exceptions=True)
        begun_s = loop.time()
        await asyncio.sleep(100.0)
        never.set()
        return [loop.time() - begun_s]

    assert run(main()) == [100.0]
