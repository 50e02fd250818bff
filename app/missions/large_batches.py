"""Work that grows with what somebody sent: from some size on it is done beside the event loop."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

T = TypeVar("T")
Made = TypeVar("Made")

LARGE = 200
"""Of more items than these the loop is not held up."""


async def made_of(items: Sequence[Any], work: Callable[..., Made], *arguments: Any) -> Made:
    """Return what ``work`` makes of its arguments; in a thread where there are many items."""
    if len(items) <= LARGE:
        return work(*arguments)
    return await asyncio.to_thread(work, *arguments)


async def each_of(items: Sequence[T], work: Callable[[T], None]) -> None:
    """Do ``work`` with each item on the loop; after every :data:`LARGE` of them others get their turn."""
    for index, item in enumerate(items, 1):
        work(item)
        if index % LARGE == 0:
            await asyncio.sleep(0)
