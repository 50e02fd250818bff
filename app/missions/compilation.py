"""What missions compute with is compiled before they need it, or loaded from the cache of an earlier start."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor, Future

import structlog

from app.compiled import wait_for_compiling
from app.estimation import Sensor, SingleBeam
from app.estimation.adjustment import warm_up as warm_up_adjustment
from app.exploration.planners import warm_up_planner
from app.exploration.survey.local_search import warm_up as warm_up_search
from app.mapping.gp import warm_up as warm_up_maps
from app.mapping.quality.crossovers import warm_up as warm_up_crossings
from app.missions.spec.mission import PlannerSpec

log = structlog.get_logger(__name__)


class Compilation:
    """Compiles in the background: first the default planner, then what maps need, then what looks for crossings.

    Other planners are compiled when they are named.

    A vehicle's first waypoint needs a planner and no map. A failure is logged: what is missing is then compiled when
    it is first used, and tells what is wrong with it.

    Parameters
    ----------
    executor
        In whose threads it is done.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._planners: dict[tuple[str, Sensor], Future[None]] = {}
        self._maps: Future[None] = Future()

    def begin(self) -> None:
        """Begin to compile what nearly every mission needs."""
        # One after the other: the compiler does one function at a time, and planners come first.
        self._planner(PlannerSpec().name, SingleBeam()).add_done_callback(self._begin_maps)

    async def planner(self, name: str, sensor: Sensor) -> None:
        """Return when a planner is compiled for a sensor."""
        await asyncio.wait([asyncio.wrap_future(self._planner(name, sensor))])

    @property
    def done(self) -> bool:
        """Whether the default planner and what maps need are compiled, or the service ends."""
        return self._maps.done()

    async def maps(self) -> None:
        """Return when the default planner and what maps need are compiled."""
        await asyncio.wait([asyncio.wrap_future(self._maps)])

    def _planner(self, name: str, sensor: Sensor) -> Future[None]:
        if (name, sensor) not in self._planners:
            begun = self._executor.submit(_warm_up, name, sensor)
            begun.add_done_callback(_log_failure)
            self._planners[name, sensor] = begun
        return self._planners[name, sensor]

    def _begin_maps(self, planner: Future[None]) -> None:
        begun = self._submit_after(planner, _warm_up_later)
        if begun is None:
            self._maps.cancel()
        else:
            begun.add_done_callback(self._begin_checks)

    def _begin_checks(self, maps: Future[None]) -> None:
        if maps.cancelled():
            self._maps.cancel()
        else:
            self._maps.set_result(None)
        for work in (warm_up_crossings, warm_up_adjustment):
            self._submit_after(maps, work)

    def _submit_after(self, before: Future[None], work: Callable[[], None]) -> Future[None] | None:
        """Submit what comes after another; None where the service ends."""
        if before.cancelled():  # by the executor's shutdown, which holds the lock that submitting waits for
            return None
        try:
            begun = self._executor.submit(work)
        except RuntimeError:
            return None
        begun.add_done_callback(_log_failure)
        return begun


def _warm_up_later() -> None:
    """Compile what maps need, and what a survey's plan is improved with when the first pass is over."""
    warm_up_maps()
    warm_up_search()


def _warm_up(name: str, sensor: Sensor) -> None:
    wait_for_compiling()
    warm_up_planner(name, sensor)


def _log_failure(done: Future[None]) -> None:
    error = None if done.cancelled() else done.exception()
    if error is not None:
        log.error("compiling ahead failed", exc_info=error)
