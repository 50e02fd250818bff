"""Answers that many wait for at the same time, made once for all of them."""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Shared(Generic[T]):
    """Work whose result is the same for everyone who asks at the same time.

    No caller gets an answer that was begun before the request: earlier writes are in it. So this is no cache.

    Parameters
    ----------
    ends_unwanted
        Cancel the work when nobody waits for it any more.
    """

    def __init__(self, work: Callable[[], Awaitable[T]], *, ends_unwanted: bool = False) -> None:
        self._work = work
        self._ends_unwanted = ends_unwanted
        self._callers: Counter[asyncio.Task[T]] = Counter()
        self._running: asyncio.Task[T] | None = None
        self._next: asyncio.Task[T] | None = None

    async def __call__(self) -> T:
        """Return the result, or raise what the work raised."""
        if self._next is None:
            self._next = asyncio.create_task(self._run(self._running))
        task = self._next
        self._callers[task] += 1
        try:
            # A caller that stops waiting does not end it for the others.
            return await asyncio.shield(task)
        finally:
            self._callers[task] -= 1
            if not self._callers[task]:
                del self._callers[task]
                if self._ends_unwanted and not task.done():
                    task.cancel()
                    self._next = None if self._next is task else self._next

    async def _run(self, before: asyncio.Task[T] | None) -> T:
        if before is not None:
            await asyncio.wait([before])
        self._running, self._next = self._next, None
        return await self._work()
