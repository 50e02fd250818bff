"""Writes that many wait for at the same time, made in one transaction."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

MOST = 64
"""Orders that are done together."""


class Grouped(Generic[T, R]):
    """Does what came while the last orders were done, in the order it came, all of it at once.

    ``work`` returns a result or an exception for each order, and raises only where nothing was done. When it raises
    with several, each is done alone: one that cannot be done is not the others' trouble. ``alone`` says which orders
    are never done with others.
    """

    def __init__(
        self, work: Callable[[Sequence[T]], Awaitable[Sequence[R | Exception]]], alone: Callable[[T], bool]
    ) -> None:
        self._work = work
        self._alone = alone
        self._waiting: deque[tuple[T, asyncio.Future[R]]] = deque()
        self._worker: asyncio.Task[None] | None = None

    async def __call__(self, order: T) -> R:
        """Return the order's result, or raise what it came to. A caller that stops waiting does not end it."""
        done: asyncio.Future[R] = asyncio.get_running_loop().create_future()
        self._waiting.append((order, done))
        if self._worker is None:
            self._worker = asyncio.create_task(self._run())
        return await done

    async def _run(self) -> None:
        try:
            while self._waiting:
                group = [self._waiting.popleft()]
                while self._waiting and len(group) < MOST and not self._alone(group[0][0]):
                    if self._alone(self._waiting[0][0]):
                        break
                    group.append(self._waiting.popleft())
                await self._do(group)
        finally:
            self._worker = None
            for _, done in self._waiting:
                done.cancel()
            self._waiting.clear()

    async def _do(self, group: list[tuple[T, asyncio.Future[R]]]) -> None:
        found: Sequence[R | Exception]
        try:
            found = await self._work([order for order, _ in group])
        except Exception as error:
            if len(group) > 1:
                for one in group:
                    await self._do([one])
                return
            found = [error]
        except BaseException:
            for _, done in group:
                done.cancel()
            raise
        for (_, done), result in zip(group, found, strict=True):
            if done.done():
                continue  # no caller waits any more
            if isinstance(result, Exception):
                done.set_exception(result)
            else:
                done.set_result(result)
