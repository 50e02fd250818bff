"""Answers that many wait for at the same time, made once for all of them."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Shared(Generic[T]):
    """Work whose result is the same for everyone who asks at the same time.

    No caller gets an answer that was begun before the request: earlier writes are in it. So this is no cache.
    """

    def __init__(self, work: Callable[[], Awaitable[T]]) -> None:
        self._work = work
        self._running: asyncio.Task[T] | None = None
        self._next: asyncio.Task[T] | None = None

    async def __call__(self) -> T:
        """Return the result, or raise what the work raised."""
        if self._next is None:
            self._next = asyncio.create_task(self._run(self._running))
        # A caller that stops waiting does not end it for the others.
        return await asyncio.shield(self._next)

    async def _run(self, before: asyncio.Task[T] | None) -> T:
        if before is not None:
            await asyncio.wait([before])
        self._running, self._next = self._next, None
        return await self._work()
