"""What missions compute with is compiled before they need it, or loaded from the cache of an earlier start."""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future

import structlog

from app.compiled.cache import FIRST, wait_for_compiling
from app.estimation import Sensor, SingleBeam
from app.estimation.adjustment import warm_up as warm_up_adjustment
from app.exploration.planners import warm_up_planner
from app.exploration.survey.local_search import warm_up as warm_up_search
from app.mapping.gaussian_process.gp import warm_up as warm_up_maps
from app.mapping.quality.crossovers import warm_up as warm_up_crossings
from app.missions.spec.mission import PlannerSpec

log = structlog.get_logger(__name__)


class Compilation:
    """Makes ready in the background: the default planner, what maps need, what improves plans, what checks soundings.

    In this order: a vehicle's first waypoint needs a planner and no map. Other processes compile these, and each is
    loaded when it is compiled; other planners are compiled here when they are named. A failure is logged: what is
    missing then is compiled when it is first used, and tells what is wrong with it.

    Parameters
    ----------
    executor
        In whose threads it is done; one of them may wait for long.
    """

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._planners: dict[tuple[str, Sensor], Future[None]] = {}
        self._maps: Future[None] = Future()
        self._search: Future[None] = Future()
        self._ending = threading.Event()

    def begin(self) -> None:
        """Begin to make ready what nearly every mission needs."""
        # One after the other: the compiler does one function at a time, and planners come first.
        self._planner(PlannerSpec().name, SingleBeam()).add_done_callback(self._begin_maps)

    def end(self) -> None:
        """Wait for no other process any more, and compile nothing that was not begun."""
        self._ending.set()

    async def planner(self, name: str, sensor: Sensor) -> None:
        """Return when a planner is ready for a sensor."""
        await asyncio.wait([asyncio.wrap_future(self._planner(name, sensor))])

    @property
    def done(self) -> bool:
        """Whether the default planner and what maps need are ready, or the service ends."""
        return self._maps.done()

    async def maps(self) -> None:
        """Return when the default planner and what maps need are ready."""
        await asyncio.wait([asyncio.wrap_future(self._maps)])

    async def search(self) -> None:
        """Return when what improves plans is ready, too: all that flying the default planner takes."""
        await asyncio.wait([asyncio.wrap_future(self._search)])

    def _planner(self, name: str, sensor: Sensor) -> Future[None]:
        if (name, sensor) not in self._planners:
            begun = self._executor.submit(self._warm_up, name, sensor)
            begun.add_done_callback(_log_failure)
            self._planners[name, sensor] = begun
        return self._planners[name, sensor]

    def _warm_up(self, name: str, sensor: Sensor) -> None:
        if wait_for_compiling(*FIRST, ending=self._ending):
            warm_up_planner(name, sensor)

    def _begin_maps(self, planner: Future[None]) -> None:
        self._submit_after(planner, self._warm_up_maps, self._maps, self._begin_search)

    def _warm_up_maps(self) -> None:
        if wait_for_compiling("maps", ending=self._ending):
            warm_up_maps()

    def _begin_search(self, maps: Future[None]) -> None:
        self._submit_after(maps, self._warm_up_search, self._search, self._begin_checks)

    def _warm_up_search(self) -> None:
        if wait_for_compiling("search", ending=self._ending):
            warm_up_search()

    def _begin_checks(self, search: Future[None]) -> None:
        self._submit_after(search, self._warm_up_checks, Future(), lambda _: None)

    def _warm_up_checks(self) -> None:
        if wait_for_compiling("checks", ending=self._ending):
            warm_up_crossings()
            warm_up_adjustment()

    def _submit_after(
        self,
        before: Future[None],
        work: Callable[[], None],
        ready: Future[None],
        then: Callable[[Future[None]], None],
    ) -> None:
        """Submit what comes after another; where the service ends, ``ready`` and all that follow are cancelled."""

        def follow(done: Future[None]) -> None:
            if done.cancelled():
                ready.cancel()
            else:
                ready.set_result(None)
            then(done)

        if before.cancelled():  # by the executor's shutdown, which holds the lock that submitting waits for
            follow(before)
            return
        try:
            begun = self._executor.submit(work)
        except RuntimeError:
            gone: Future[None] = Future()
            gone.cancel()
            follow(gone)
            return
        begun.add_done_callback(_log_failure)
        begun.add_done_callback(follow)


def _log_failure(done: Future[None]) -> None:
    error = None if done.cancelled() else done.exception()
    if error is not None:
        log.error("compiling ahead failed", exc_info=error)
