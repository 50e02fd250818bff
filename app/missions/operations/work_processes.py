"""What computes long is made by a process of its own, one at a time: threads of this one would hold the event loop.

Libraries in C, and loops of numpy, keep the interpreter's lock for as long as they take.

As a program: the first two arguments are the numbers of open files, which are this service's own and have no name.
What is to be done is in the first, pickled, as soon as there is something on standard input; what came of it goes to
the second. Further arguments are modules to be loaded meanwhile.
"""

import asyncio
import os
import pickle
import signal
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from importlib import import_module
from typing import IO, Any, ParamSpec, TypeVar

from app.compute.packing import Raised, outcome
from app.mapping.readers.confinement import ResourceLimits, limit
from app.missions.errors import ProductUnavailableError
from app.missions.operations import child_process
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.unnamed_file import unnamed_file

AT_ONCE = 1
"""Each takes a core and memory, which vehicles' decisions need."""

MAKING_TIMEOUT_S = 600.0
LIMITS = ResourceLimits(memory_bytes=32 * 2**30, cpu_s=600, file_bytes=4 * 2**30)

P = ParamSpec("P")
Made = TypeVar("Made")


class WorkProcesses:
    """Has functions computed by processes, each of which does one thing, yields to others and ends."""

    def __init__(self) -> None:
        self._turn = asyncio.Semaphore(AT_ONCE)
        self._processes: set[Process] = set()
        self._closing = asyncio.Event()

    async def make(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what a function of a module returns; the process ends with whoever waits for it.

        Parameters
        ----------
        work
            A function that a module has by its name. It, what it is given and what it returns are pickled.

        Raises
        ------
        ProductUnavailableError
            When the process ended before it was done, or the service ends.
        Exception
            What the function raises.
        """
        async with self.process(work.__module__) as process:
            return await process.make(work, *arguments, **named)

    @asynccontextmanager
    async def process(self, *modules: str) -> AsyncIterator["WorkProcess"]:
        """Have a process, for one thing, that loads modules while what it will be given is gathered.

        Raises
        ------
        ProductUnavailableError
            When the service ends.
        """
        async with self._turn:
            if self._closing.is_set():
                raise _ending()
            with await asyncio.to_thread(unnamed_file) as task, await asyncio.to_thread(unnamed_file) as result:
                process = await _start(task, result, modules)
                self._processes.add(process)
                try:
                    if self._closing.is_set():
                        child_process.kill(process)
                    yield WorkProcess(process, task, result, self._closing.is_set)
                finally:
                    child_process.kill(process)
                    await process.wait()
                    self._processes.discard(process)

    async def close(self) -> None:
        """End what is being made; nothing more is made."""
        self._closing.set()
        processes = list(self._processes)
        for process in processes:
            child_process.kill(process)
        await asyncio.gather(*(process.wait() for process in processes))


class WorkProcess:
    """A process that makes one thing."""

    def __init__(self, process: Process, task: IO[bytes], result: IO[bytes], closed: Callable[[], bool]) -> None:
        self._process = process
        self._task, self._result = task, result
        self._closed = closed

    async def make(self, work: Callable[P, Made], *arguments: P.args, **named: P.kwargs) -> Made:
        """Return what a function returns; see :meth:`WorkProcesses.make`."""
        await to_the_end(asyncio.to_thread(_write, self._task, (work, arguments, named)))
        code = await self._ended()
        if code:
            raise _ending() if self._closed() else _broken_off(code)
        made, raised = await to_the_end(asyncio.to_thread(_read, self._result))
        if isinstance(raised, Raised):
            raise raised.error()
        return made  # type: ignore[no-any-return]

    async def _ended(self) -> int:
        """Say that the task is written; return the exit code of the process, negative where a signal ended it."""
        assert self._process.stdin is not None  # noqa: S101 - it is a pipe
        try:
            async with asyncio.timeout(MAKING_TIMEOUT_S):
                with suppress(ConnectionError):  # it has ended before
                    self._process.stdin.write(b"\n")
                    await self._process.stdin.drain()
                return await self._process.wait()
        except TimeoutError:
            return -signal.SIGXCPU


async def _start(task: IO[bytes], result: IO[bytes], modules: Sequence[str]) -> Process:
    files = task.fileno(), result.fileno()
    return await child_process.start(
        __name__,
        [*map(str, files), *modules],
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.DEVNULL,
        files=files,
        environment=os.environ | {"PYTHONPATH": child_process.search_path()},
    )


def _ending() -> ProductUnavailableError:
    return ProductUnavailableError("the service is ending", "ask again when it has started")


def _broken_off(code: int) -> ProductUnavailableError:
    if code == -signal.SIGXCPU:
        return ProductUnavailableError(
            f"it takes more than {MAKING_TIMEOUT_S:g} s", "choose larger cells or a smaller area"
        )
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    return ProductUnavailableError(
        f"the process that makes the file was ended before it was done ({how}): memory may be short",
        "ask again; where that does not help give the service more memory, or choose larger cells",
    )


def _write(file: IO[bytes], content: Any) -> None:
    pickle.dump(content, file, pickle.HIGHEST_PROTOCOL)
    file.flush()
    os.lseek(file.fileno(), 0, os.SEEK_SET)


def _read(file: IO[bytes]) -> Any:
    file.seek(0)
    return pickle.load(file)  # noqa: S301 - this program wrote it


def main() -> None:
    """Do what standard input asks, and write down what came of it."""
    limit(LIMITS)
    task, result = (int(number) for number in sys.argv[1:3])
    for module in sys.argv[3:]:
        import_module(module)
    if not sys.stdin.buffer.read(1):
        return  # it is not needed after all
    with open(task, "rb", closefd=False) as file:
        work, arguments, named = _read(file)
    with open(result, "wb", closefd=False) as out:
        _write(out, outcome(work, arguments, named))


if __name__ == "__main__":
    main()
