"""An event loop whose time is simulated: it goes on as soon as nobody has anything left to do.

A service that runs on it lives as fast as the machine allows: while a thread works for it (a planner, the database)
time stands still, and while everybody waits it goes straight on to the next moment that somebody waits for. What
several threads finish at the same moment comes in either order.
"""

from __future__ import annotations

import asyncio
import selectors
import sys
import time
from typing import Any

BEGIN_S = 1000.0
"""Where its time begins."""

RESOLUTION_S = time.get_clock_info("monotonic").resolution

THREADS = frozenset({"asyncio.futures", "aiosqlite.core"})
"""Modules that make futures which a thread settles: whatever runs in an executor, and connections to SQLite."""


class SimulatedTimeLoop(asyncio.SelectorEventLoop):
    """Jumps to the next timer once nothing is left to do. Sockets work; time does not wait for what comes over them."""

    def __init__(self) -> None:
        self.now_s = BEGIN_S
        self.in_threads = 0
        """How much threads still have to do."""
        super().__init__(_Selector(self))

    def time(self) -> float:
        """Return the simulated time, seconds."""
        return self.now_s

    def create_future(self) -> asyncio.Future[Any]:
        """Return a future, and wait with the time where a thread will settle it."""
        future: asyncio.Future[Any] = super().create_future()
        if sys._getframe(1).f_globals.get("__name__") in THREADS:
            self.in_threads += 1
            future.add_done_callback(self._done)
        return future

    def _done(self, _future: asyncio.Future[Any]) -> None:
        self.in_threads -= 1


class _Selector(selectors.DefaultSelector):
    """Lets the time go on where the loop would wait for it."""

    def __init__(self, loop: SimulatedTimeLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready; instead of waiting for so long let the time pass."""
        if timeout is None or (timeout > 0.0 and self._loop.in_threads):
            ready: list[tuple[selectors.SelectorKey, int]] = super().select(None)
            return ready
        ready = super().select(0.0)
        if not ready and timeout > 0.0:
            # Never by less than the loop tells moments apart: rounding would have it wait for the same one again.
            self._loop.now_s += max(timeout, RESOLUTION_S)
        return ready
