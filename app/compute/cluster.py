"""The way to a Dask cluster: connected while it is there, in words why not while it is not.

Dask's client lives in a thread with an event loop of its own. What it does to pickle and to send tens of megabytes
holds that loop and not the service's, and the package is loaded there: a start does not wait for it.
"""

import asyncio
import logging
import threading
import time
import uuid
from concurrent.futures import CancelledError
from concurrent.futures import Future as ThreadFuture
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import structlog

from app.compute.metrics import CLUSTER_WORKERS
from app.compute.packing import Packed
from app.compute.settings import ComputeSettings
from app.compute.worker import OtherVersions, differences, facts, work_there

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 10.0
ANSWER_S = 10.0
"""A scheduler that has not answered for so long is gone."""

CHECK_S = 2.0
"""So often it is asked which workers it has, and so long after it was gone it is looked for again."""

NO_WORKER_S = 20.0
"""A cluster is waited for so long when its last worker has gone: one that was killed is started again meanwhile."""

AHEAD = 2
"""So many pieces more than workers can do are with the cluster; the next ones wait here."""

LEAVE_S = 2.0

CONNECTING = "not connected yet"
ENDING = "the service is ending"

log = structlog.get_logger(__name__)


class NotDoneError(Exception):
    """The cluster did not do it; ``str()`` says why in words, ``kind`` in one word for counting."""

    def __init__(self, kind: str, why: str) -> None:
        super().__init__(why)
        self.kind = kind


class WorkersDiedError(NotDoneError):
    """One worker after the other ended while it did this."""


class Cluster:
    """Workers behind a scheduler's address.

    Attributes
    ----------
    trouble
        Why nothing is given to it, in words; empty while it can be used.
    workers
        How many workers it has.
    """

    def __init__(self, settings: ComputeSettings) -> None:
        self._settings = settings
        self.trouble = CONNECTING
        self.workers = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._client: Client | None = None
        self._staying: asyncio.Task[None] | None = None
        self._ended = False
        self._lost = asyncio.Event()
        self._room = asyncio.Condition()
        self._threads = self._under_way = 0
        # What is wrong with each worker's versions, empty where nothing is; since when there is no worker.
        self._known: dict[str, str] = {}
        self._empty_s: float | None = None

    @property
    def address(self) -> str:
        """Where its scheduler is."""
        return self._settings.scheduler

    def start(self) -> None:
        """Look for it from now on. Does not wait."""
        if self._thread is None:
            self._loop = asyncio.new_event_loop()
            self._thread = threading.Thread(target=self._live, args=[self._loop], name="cluster", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Give up what is under way, and leave; the cluster goes on. Does not wait."""
        if self._ended:
            return
        self._ended = True
        self.trouble = ENDING
        if self._loop is not None:
            with suppress(RuntimeError):  # it has ended by itself
                self._loop.call_soon_threadsafe(self._cancel)

    def join(self) -> None:
        """Wait until it was left: seconds at most."""
        if self._thread is not None:
            self._thread.join()

    def submit(self, name: str, work: Packed) -> "ThreadFuture[Packed]":
        """Have a piece of work done, from any thread; what came of it is packed.

        The future ends with NotDoneError where the cluster did not do it. ``name`` is shown on its pages.
        """
        if self.trouble or self._loop is None:
            given_up: ThreadFuture[Packed] = ThreadFuture()
            given_up.set_exception(NotDoneError("lost", self.trouble))
            return given_up
        return asyncio.run_coroutine_threadsafe(self._do(name, work), self._loop)

    # In the thread

    def _live(self, loop: asyncio.AbstractEventLoop) -> None:
        with suppress(asyncio.CancelledError), asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(self._stay())

    def _cancel(self) -> None:
        if self._staying is not None:
            self._staying.cancel()

    async def _stay(self) -> None:
        """Connect, and again whenever it was gone, until the end."""
        self._staying = asyncio.current_task()
        try:
            while not self._ended:
                await self._use()
                await asyncio.sleep(CHECK_S)
        finally:
            self.trouble = ENDING
            CLUSTER_WORKERS.set(0)

    async def _use(self) -> None:
        """Be connected for as long as it is there."""
        try:
            await self._connect()
            while True:
                await self._check()
                await asyncio.sleep(CHECK_S)
        except NotDoneError as error:
            self._tell(str(error))
        except Exception as error:
            log.error("the cluster cannot be used", scheduler=self.address, exc_info=error)
            self._tell(f"{type(error).__name__}: {error}")
        finally:
            await self._leave()

    async def _connect(self) -> None:
        # The only place that loads it: half a second, which those without a cluster need not spend.
        try:
            from distributed import Client, Security
        except ImportError:
            raise NotDoneError(
                "lost", "the package distributed is missing: pip install 'bathyfleet[cluster]'"
            ) from None
        for name in ("distributed", "distributed.client"):  # what they would tell is told here, once
            logging.getLogger(name).setLevel(logging.CRITICAL)
        settings = self._settings
        for file in (settings.tls_ca_file, settings.tls_certificate, settings.tls_key):
            if file is not None and not file.is_file():
                raise NotDoneError("lost", f"{file} is no file that can be read")
        try:
            security = None
            if settings.encrypted:
                security = Security(
                    tls_ca_file=str(settings.tls_ca_file),
                    tls_client_cert=str(settings.tls_certificate),
                    tls_client_key=str(settings.tls_key),
                    require_encryption=True,
                )
            # Before it is connected: one that never was has to be closed, too.
            self._client = Client(
                self.address,
                security=security,
                timeout=CONNECT_S,
                asynchronous=True,
                set_as_default=False,
                name="bathyfleet",
            )
            await self._client
        except (OSError, TimeoutError, ValueError, ImportError, RuntimeError) as error:
            raise NotDoneError("lost", f"no Dask scheduler answers at {self.address} ({_words(error)})") from None

    async def _check(self) -> None:
        """See which workers there are and whether they compute as this machine does. Raises NotDoneError."""
        client = self._client
        if client is None or client.status != "running":
            raise NotDoneError("lost", f"the scheduler at {self.address} is gone")
        try:
            async with asyncio.timeout(ANSWER_S):
                threads: dict[str, int] = await client.nthreads()
                trouble = await self._trouble(client, threads)
        except (OSError, TimeoutError) as error:
            raise NotDoneError("lost", f"the scheduler at {self.address} does not answer ({_words(error)})") from None
        self.workers, self._threads = len(threads), sum(threads.values())
        if threads:
            self._empty_s = None
        self._tell(trouble)
        async with self._room:
            self._room.notify_all()

    async def _trouble(self, client: "Client", threads: dict[str, int]) -> str:
        """Return in words why these workers cannot be used; empty where they can."""
        if not threads:
            now_s = time.monotonic()
            self._empty_s = now_s if self._empty_s is None else self._empty_s
            if self.trouble or now_s - self._empty_s > NO_WORKER_S:
                return f"the scheduler at {self.address} has no worker"
            return ""
        new = [worker for worker in threads if worker not in self._known]
        if new:
            answers = await client.run(facts, workers=new, on_error="return")
            for worker, answer in answers.items():
                self._known[worker] = _fault(answer)
        self._known = {worker: fault for worker, fault in self._known.items() if worker in threads}
        faults = [f"worker {worker} has {fault}" for worker, fault in self._known.items() if fault]
        return faults[0] + ": install the same everywhere" if faults else ""

    def _tell(self, trouble: str) -> None:
        """Note whether it can be used; say so where that has changed, and give up what is under way where it cannot."""
        CLUSTER_WORKERS.set(0 if trouble else self.workers)
        if trouble == self.trouble or self._ended:
            return
        before, self.trouble = self.trouble, trouble
        if trouble:
            self._lost.set()
            self._lost = asyncio.Event()
            log.warning("heavy work is done on this machine", scheduler=self.address, reason=trouble)
        elif before:
            log.info("the cluster does heavy work", scheduler=self.address, workers=self.workers)

    async def _leave(self) -> None:
        client, self._client = self._client, None
        self._known, self._empty_s, self.workers = {}, None, 0
        self._lost.set()
        self._lost = asyncio.Event()
        if client is not None:
            with suppress(Exception):
                async with asyncio.timeout(LEAVE_S):
                    await client._close(fast=True)
            client.status = "closed"  # whatever failed: nothing is done with it any more

    # Pieces of work

    async def _do(self, name: str, work: Packed) -> Packed:
        lost = self._lost
        async with self._room:
            await self._room.wait_for(lambda: self.trouble or self._under_way < self._threads + AHEAD)
            if self.trouble or self._client is None or lost.is_set():
                raise NotDoneError("lost", self.trouble or f"the scheduler at {self.address} is gone")
            self._under_way += 1
            client = self._client
        try:
            return await self._done(client, lost, name, work)
        finally:
            self._under_way -= 1
            async with self._room:
                self._room.notify_all()

    async def _done(self, client: "Client", lost: asyncio.Event, name: str, work: Packed) -> Packed:
        from dask import config

        with config.set({"distributed.admin.large-graph-warning-threshold": "1TiB"}):
            # What is sent stays with the scheduler until it is done: a worker that ends is replaced by another.
            future = client.submit(
                work_there, facts(), work.head, work.buffers, key=f"{name}-{uuid.uuid4().hex}", pure=False
            )
        result: asyncio.Task[Packed] = asyncio.ensure_future(_awaited(future))
        gone = asyncio.ensure_future(lost.wait())
        try:
            await asyncio.wait([result, gone], timeout=self._settings.timeout_s, return_when=asyncio.FIRST_COMPLETED)
            if not result.done():
                if gone.done():
                    raise NotDoneError("lost", self.trouble or f"the scheduler at {self.address} is gone")
                raise NotDoneError("late", f"the cluster has not done it in {self._settings.timeout_s:g} s")
            return _result(result)
        finally:
            gone.cancel()
            if not result.done():
                result.cancel()
                with suppress(Exception):
                    async with asyncio.timeout(ANSWER_S):
                        await future.cancel(force=True)
            future.release()


async def _awaited(future: Any) -> Packed:
    packed: Packed = await future.result()
    return packed


def _result(done: "asyncio.Future[Packed]") -> Packed:
    """Return what came back. Raises NotDoneError: what the work itself raised is packed."""
    from distributed import KilledWorker

    try:
        return done.result()
    except OtherVersions as error:
        raise NotDoneError("versions", f"a worker has {differences(facts(), error.facts)}") from None
    except KilledWorker as error:
        raise WorkersDiedError("died", _words(error)) from None
    except (CancelledError, asyncio.CancelledError):
        raise NotDoneError("lost", "the scheduler has lost it") from None
    except Exception as error:
        raise NotDoneError("failed", f"the cluster cannot do it ({type(error).__name__}: {error})") from error


def _fault(answer: Any) -> str:
    if isinstance(answer, dict):
        return differences(facts(), answer)
    if isinstance(answer, ImportError):
        return f"no bathyfleet ({answer})"
    return f"not told its versions ({_words(answer)})"


def _words(error: BaseException) -> str:
    text = str(error).strip()
    return text.splitlines()[0] if text else type(error).__name__
