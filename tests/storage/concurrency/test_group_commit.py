"""Orders that came together are done together."""

import asyncio
from collections.abc import Sequence

import pytest

from app.storage.concurrency.group_commit import Grouped


class Work:
    """Doubles numbers once it is let; 13 spoils all that it is done with, 7 is refused alone."""

    def __init__(self) -> None:
        self.may = asyncio.Event()
        self.groups: list[list[int]] = []

    async def __call__(self, orders: Sequence[int]) -> list[int | Exception]:
        self.groups.append(list(orders))
        await self.may.wait()
        if 13 in orders:
            raise RuntimeError("bad luck")
        return [ValueError("seven") if order == 7 else 2 * order for order in orders]


async def asked(grouped: Grouped[int, int], orders: Sequence[int]) -> list[asyncio.Task[int]]:
    async def ask(order: int) -> int:
        return await grouped(order)

    tasks = [asyncio.create_task(ask(order)) for order in orders]
    await asyncio.sleep(0)
    return tasks


async def test_what_comes_while_work_is_done_is_done_next_in_its_order() -> None:
    work = Work()
    grouped = Grouped(work, lambda order: order == 5)
    first = await asked(grouped, [1])
    await asyncio.sleep(0)
    rest = await asked(grouped, [2, 7, 3, 5, 4])
    work.may.set()
    found = await asyncio.gather(*first, *rest, return_exceptions=True)
    assert [str(value) for value in found] == ["2", "4", "seven", "6", "10", "8"]
    assert work.groups == [[1], [2, 7, 3], [5], [4]]


async def test_an_order_that_cannot_be_done_is_not_the_others_trouble() -> None:
    work = Work()
    work.may.set()
    grouped = Grouped(work, lambda order: False)
    found = await asyncio.gather(*await asked(grouped, [1, 13, 2]), return_exceptions=True)
    assert [str(value) for value in found] == ["2", "bad luck", "4"]
    assert work.groups == [[1, 13, 2], [1], [13], [2]]


async def test_who_stops_waiting_does_not_end_it_and_everyone_is_told_when_it_ends() -> None:
    work = Work()
    grouped = Grouped(work, lambda order: False)
    gone, stays = await asked(grouped, [1, 2])
    await asyncio.sleep(0)
    gone.cancel()
    work.may.set()
    assert await stays == 4
    work.may.clear()
    (cut_off,) = await asked(grouped, [3])
    await asyncio.sleep(0)
    assert grouped._worker is not None
    grouped._worker.cancel()
    with pytest.raises(asyncio.CancelledError):
        await cut_off
