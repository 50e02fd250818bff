"""Has heavy work done: by a cluster where there is one, else by a thread or a process of this machine."""

import asyncio
import pickle
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from contextvars import copy_context
from functools import partial
from typing import Any, ParamSpec, Protocol, TypeVar, cast

import structlog

from app.compute.cluster import Cluster, NotDoneError, WorkersDiedError
from app.compute.metrics import REPEATED, WORK
from app.compute.packing import Packed, Raised, pack, unpack
from app.compute.settings import ComputeSettings

AT_ONCE_HERE = 1
"""So many pieces of work that the cluster did not do are repeated by threads at the same time: each takes cores that
vehicles' decisions need."""

WAITING = 32
"""Threads that wait for the cluster: maps of so many missions at the same time."""

P = ParamSpec("P")
Made = TypeVar("Made")

log = structlog.get_logger(__name__)


class Process(Protocol):
    """Does one thing, beside this process."""

    async def make(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what a function of a module returns."""
        ...


class Processes(Process, Protocol):
    """Has things done by processes of this machine."""

    def process(self, *modules: str) -> AbstractAsyncContextManager[Process]:
        """Have a process, for one thing, that loads modules meanwhile."""
        ...


class Compute:
    """Has functions of modules computed with inputs that can be pickled.

    What is given to a cluster and not done there, for whatever reason, is done once more on this machine: inputs are
    never lost, and functions have no effect but what they return.

    Parameters
    ----------
    processes
        How this machine has things done by processes of its own.
    """

    def __init__(self, settings: ComputeSettings, processes: Processes) -> None:
        self._cluster = Cluster(settings) if settings.scheduler else None
        self._processes = processes
        self._turn = threading.BoundedSemaphore(AT_ONCE_HERE)
        self._waiting = ThreadPoolExecutor(WAITING, thread_name_prefix="compute") if settings.scheduler else None
        self._repeating = ThreadPoolExecutor(AT_ONCE_HERE, "repeating") if settings.scheduler else None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ending = False

    def start(self) -> None:
        """Look for the cluster, if one is named. Does not wait."""
        self._loop = asyncio.get_running_loop()
        if self._cluster is not None:
            self._cluster.start()

    def end(self) -> None:
        """Give nothing to the cluster any more; what it has is given up and not done here. Does not wait."""
        self._ending = True
        if self._cluster is not None:
            self._cluster.end()

    async def close(self) -> None:
        """End, and wait for what is being done."""
        self.end()
        if self._cluster is not None:
            await asyncio.to_thread(self._cluster.join)
        for threads in (self._waiting, self._repeating):
            if threads is not None:
                await asyncio.to_thread(threads.shutdown, wait=True, cancel_futures=True)

    @property
    def elsewhere(self) -> bool:
        """Whether a cluster does heavy work now."""
        return self._cluster is not None and not self._cluster.trouble

    @property
    def workers(self) -> int:
        """How many workers do heavy work now."""
        return self._cluster.workers if self._cluster is not None and self.elsewhere else 0

    @property
    def waiting(self) -> Executor | None:
        """Threads in which may be waited for the cluster; None where there is none."""
        return self._waiting if self.elsewhere else None

    @property
    def state(self) -> str | None:
        """How the cluster is: ``ok``, or why this machine does everything; None where no cluster is named."""
        if self._cluster is None:
            return None
        return f"this machine does everything: {self._cluster.trouble}" if self._cluster.trouble else "ok"

    async def run(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what a function of a module returns: by the cluster, else by a thread."""
        try:
            return await self.away(work, *arguments, **named)
        except NotDoneError:
            # Whoever waits for a turn must not hold a thread that all of the service shares.
            here = partial(copy_context().run, self._here, work, arguments, named)
            return await asyncio.get_running_loop().run_in_executor(self._repeating, here)

    async def away(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what :meth:`run` does, never by a thread of this process. Raises NotDoneError where it would be."""
        try:
            return await self._there(work, arguments, named)
        except NotDoneError as error:
            if self._apart(error):
                return await self._processes.make(work, *arguments, **named)
            raise

    async def make(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what a function of a module returns: by the cluster, else by a process of its own.

        For libraries in C and loops of numpy, which would hold the interpreter's lock.
        """
        try:
            return await self._there(work, arguments, named)
        except NotDoneError:
            WORK.labels("process").inc()
            return await self._processes.make(work, *arguments, **named)

    @asynccontextmanager
    async def process(self, *modules: str) -> AsyncIterator[Process]:
        """Have something to make one thing with, which loads modules while its input is gathered."""
        if self.elsewhere:
            yield self
            return
        async with self._processes.process(*modules) as process:
            WORK.labels("process").inc()
            yield process

    def in_thread(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what :meth:`run` does; for threads, which wait."""
        if not self.elsewhere:
            return self._here(work, arguments, named)
        try:
            assert self._cluster is not None  # noqa: S101 - it is elsewhere
            return cast("Made", self._made(self._cluster.submit(_name(work), _packed(work, arguments, named)).result()))
        except NotDoneError as error:
            _repeat(work, error)
            if not self._apart(error):
                return self._here(work, arguments, named)
            assert self._loop is not None  # noqa: S101 - it was started
            making = self._processes.make(work, *arguments, **named)
            return asyncio.run_coroutine_threadsafe(_coroutine(making), self._loop).result()

    async def _there(self, work: Callable[..., Made], arguments: tuple[Any, ...], named: dict[str, Any]) -> Made:
        """Return what the cluster makes. Raises NotDoneError, and whatever the work raises."""
        if self._cluster is None or self._cluster.trouble:
            raise NotDoneError("absent", "no cluster")
        try:
            packed = await asyncio.to_thread(_packed, work, arguments, named)
            made = await asyncio.wrap_future(self._cluster.submit(_name(work), packed))
        except NotDoneError as error:
            _repeat(work, error)
            raise
        return cast("Made", await asyncio.to_thread(self._made, made))

    def _apart(self, error: NotDoneError) -> bool:
        """Whether what was not done must not be done by this process: a process refuses it where the service ends."""
        return isinstance(error, WorkersDiedError) or (self._cluster is not None and self._ending)

    def _made(self, packed: Packed) -> Any:
        made, raised = unpack(packed)
        WORK.labels("cluster").inc()
        if isinstance(raised, Raised):
            raise raised.error()
        return made

    def _here(self, work: Callable[..., Made], arguments: tuple[Any, ...], named: dict[str, Any]) -> Made:
        WORK.labels("thread").inc()
        if self._cluster is None:
            return work(*arguments, **named)
        with self._turn:
            return work(*arguments, **named)


def _name(work: Callable[..., Any]) -> str:
    return getattr(work, "__name__", type(work).__name__)


def _packed(work: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Packed:
    try:
        return pack((work, arguments, named))
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise NotDoneError("failed", f"its input cannot be sent ({error})") from None


def _repeat(work: Callable[..., Any], error: NotDoneError) -> None:
    REPEATED.labels(error.kind).inc()
    log.warning("done once more on this machine", work=_name(work), reason=str(error))


async def _coroutine(making: Awaitable[Made]) -> Made:
    return await making
