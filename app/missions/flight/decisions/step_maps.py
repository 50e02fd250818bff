"""The maps that a running mission decides by: made and refined while the vehicles travel."""

import asyncio
import math
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import Executor, Future

import structlog

from app.missions.live.mission import LiveMission
from app.missions.maps.builder import MapBuilder

PATIENCE_S = 2.0
"""How much of the vehicles' time a decision may wait for a newer map."""

REST = 1.0
"""For how long no map is made after one, at least, in times of what it took."""

_LEARNING = threading.Lock()

log = structlog.get_logger(__name__)


class StepMaps:
    """Keeps the map of one running mission new enough to decide by.

    Parameters
    ----------
    executor
        Whose threads make and refine maps.
    time_scale
        How much faster than the wall clock the vehicles live.
    pause_s
        For how long no map is made after one, at least, on the wall clock.
    ready
        Returns when what maps are made with is compiled: it takes longer where two threads or processes do it.
    """

    def __init__(
        self,
        live: LiveMission,
        executor: Executor,
        time_scale: float,
        pause_s: float,
        ready: Callable[[], Awaitable[None]],
    ) -> None:
        self._live = live
        self._executor = executor
        self._time_scale = time_scale
        self._pause_s = pause_s
        self._ready = ready
        self._took_s = 0.0
        self._made_at_s = -math.inf
        self._making: asyncio.Task[None] | None = None

    def begin(self) -> None:
        """Make a map of what has been sounded so far, unless one is being made or just was, and refine its model."""
        if not self._due:
            return
        if self._making is None or (self._making.done() and self._making.exception() is None):
            self._making = asyncio.create_task(self._make())
        self._executor.submit(_learn, self._live.builder).add_done_callback(_log_failure)

    @property
    def _due(self) -> bool:
        """Whether the newest map is so old that the next one may take a core again."""
        age_s = asyncio.get_running_loop().time() - self._made_at_s
        return age_s >= max(self._pause_s, REST * self._took_s)

    async def renew(self) -> None:
        """Bring the map up to date, unless vehicles would circle for long meanwhile: then the newest has to do.

        That is so where many soundings are mapped, or time runs fast. A failure to make the map comes out here.
        """
        live = self._live
        patient = live.builder.newest is None or self._took_s * self._time_scale <= PATIENCE_S
        if self._making is not None and (patient or self._making.done()):
            making, self._making = self._making, None
            await making
        await live.journal.flush()
        await live.notice_imports()
        await live.stored_soundings.complete()
        await live.swath.complete()
        if patient and live.builder.stale and (self._due or live.builder.newest is None):
            await self._make()

    async def end(self) -> None:
        """Give up the map that is being made."""
        if self._making is not None:
            self._making.cancel()
            await asyncio.gather(self._making, return_exceptions=True)

    async def _make(self) -> None:
        live, loop = self._live, asyncio.get_running_loop()
        started_s = loop.time()
        await live.journal.flush()
        await live.stored_soundings.complete()
        await live.swath.complete()
        if live.builder.newest is None:
            await self._ready()
        before = live.builder.newest
        built = await loop.run_in_executor(self._executor, live.builder.build)
        if built is not None and built is not before:
            live.map.publish(built)
        self._made_at_s = loop.time()
        self._took_s = self._made_at_s - started_s
        await live.stored_soundings.keep_when_grown(live.header.step)


def _learn(builder: MapBuilder) -> None:
    """Learn the map's model, unless another mission does: decisions must not wait until all threads have learned."""
    if _LEARNING.acquire(blocking=False):
        try:
            builder.learn()
        finally:
            _LEARNING.release()


def _log_failure(done: Future[None]) -> None:
    error = None if done.cancelled() else done.exception()
    if error is not None:
        log.error("learning the map's model failed; the last one stays in use", exc_info=error)
