"""What computes long is made by a process of its own, one at a time: threads of this one would hold the event loop.

Libraries in C, and loops of numpy, keep the interpreter's lock for as long as they take.

As a program: what is to be done is on standard input, pickled; the argument is the number of the open file for what
came of it. Both files are this service's own, and have no name.
"""

import asyncio
import os
import pickle
import signal
import sys
from asyncio.subprocess import Process
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, ParamSpec, TypeVar

import app
from app.mapping.readers.confinement import ResourceLimits, limit
from app.missions.errors import ProductUnavailableError
from app.missions.operations.uploads import unnamed_file
from app.storage.uncancellable import to_the_end

ROOT = str(Path(app.__file__).resolve().parents[1])
"""Where the process finds this program."""

AT_ONCE = 1
"""Each takes a core and memory, which vehicles' decisions need."""

MAKING_TIMEOUT_S = 600.0
LIMITS = ResourceLimits(memory_bytes=32 * 2**30, cpu_s=600, file_bytes=4 * 2**30)

P = ParamSpec("P")
Made = TypeVar("Made")


class Workshop:
    """Has functions computed by processes, each of which does one thing, yields to others and ends."""

    def __init__(self) -> None:
        self._turn = asyncio.Semaphore(AT_ONCE)
        self._processes: set[Process] = set()
        self._closed = False

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
        async with self._turn:
            with await asyncio.to_thread(unnamed_file) as task, await asyncio.to_thread(unnamed_file) as result:
                await to_the_end(asyncio.to_thread(_write, task, (work, arguments, named)))
                code = await self._run(task, result)
                if code:
                    raise self._broken_off(code)
                made, error = await to_the_end(asyncio.to_thread(_read, result))
        if error is not None:
            raise _raised(*error)
        return made  # type: ignore[no-any-return]

    async def close(self) -> None:
        """End what is being made; nothing more is made."""
        self._closed = True
        processes = list(self._processes)
        for process in processes:
            _kill(process)
        await asyncio.gather(*(process.wait() for process in processes))

    async def _run(self, task: IO[bytes], result: IO[bytes]) -> int:
        """Return the exit code of the process, negative where a signal ended it."""
        if self._closed:
            return -signal.SIGKILL
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",
            "-m",
            __name__,
            str(result.fileno()),
            stdin=task,
            stdout=asyncio.subprocess.DEVNULL,
            pass_fds=(result.fileno(),),
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [ROOT, os.environ.get("PYTHONPATH", "")]))},
            # Its own session: a signal from a terminal is not for it, and what it starts ends with it.
            start_new_session=True,
        )
        self._processes.add(process)
        try:
            if self._closed:
                _kill(process)
            async with asyncio.timeout(MAKING_TIMEOUT_S):
                return await process.wait()
        except TimeoutError:
            return -signal.SIGXCPU
        finally:
            _kill(process)
            await process.wait()
            self._processes.discard(process)

    def _broken_off(self, code: int) -> ProductUnavailableError:
        if self._closed:
            return ProductUnavailableError("the service is ending", "ask again when it has started")
        if code == -signal.SIGXCPU:
            return ProductUnavailableError(
                f"it takes more than {MAKING_TIMEOUT_S:g} s", "choose larger cells or a smaller area"
            )
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return ProductUnavailableError(
            f"the process that makes the file was ended before it was done ({how}): memory may be short",
            "ask again; where that does not help give the service more memory, or choose larger cells",
        )


def _kill(process: Process) -> None:
    """End a process that runs yet, and what it has started."""
    if process.returncode is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _write(file: IO[bytes], content: Any) -> None:
    pickle.dump(content, file, pickle.HIGHEST_PROTOCOL)
    file.flush()
    os.lseek(file.fileno(), 0, os.SEEK_SET)


def _read(file: IO[bytes]) -> Any:
    file.seek(0)
    return pickle.load(file)  # noqa: S301 - this program wrote it


def _raised(kind: type[Exception], arguments: tuple[Any, ...], state: dict[str, Any]) -> Exception:
    """Return an exception as it was; its class may be made of other arguments than it keeps."""
    error = kind.__new__(kind)
    error.args = arguments
    error.__dict__.update(state)
    return error


def main() -> None:
    """Do what standard input asks, and write down what came of it."""
    limit(LIMITS)
    made, told = None, None
    work, arguments, named = pickle.load(sys.stdin.buffer)  # noqa: S301 - this program wrote it
    try:
        made = work(*arguments, **named)
    except Exception as error:
        told = type(error), error.args, error.__dict__
    with open(int(sys.argv[1]), "wb", closefd=False) as out:
        _write(out, (made, told))


if __name__ == "__main__":
    main()
