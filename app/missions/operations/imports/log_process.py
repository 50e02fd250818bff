"""Vehicles' logs that a service takes in are read by a process of their own: reading takes minutes of computing.

As a program: the argument is the number of an open file, the log. What is asked comes pickled on standard input; what
was read goes pickled to standard output, each item behind its length.
"""

import asyncio
import os
import pickle
import signal
import struct
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import IO

import app
from app.mapping.readers.confinement import ResourceLimits, limit
from app.missions.errors import InvalidRequestError
from app.missions.operations.imports.log_batches import (
    LogBatch,
    LogFacts,
    LogItem,
    OpenedLog,
    RefusedLog,
    WantedLog,
    read_log,
)
from imc_bridge.logs import OpenLog

ROOT = str(Path(app.__file__).resolve().parents[1])
"""Where the process finds this program."""
LIMITS = ResourceLimits(memory_bytes=4 * 2**30, cpu_s=1800, file_bytes=0)
SIZE = struct.Struct("<Q")
MAX_ITEM_BYTES = 2**28
"""A batch of pings is some megabytes."""
SILENCE_S = 600.0
"""So long nothing may come of a file of which nothing can be used."""

_ENVIRONMENT = ("LD_LIBRARY_PATH", "PROJ_DATA", "GDAL_DATA", "TZDIR")
"""What the process gets of ours: where libraries and their tables lie, and nothing that is secret."""


class ReadingProcess:
    """What a process reads of a log, as it asks for it; see ``LogSource``."""

    def __init__(self, process: Process, opened: OpenedLog) -> None:
        self.opened = opened
        self._process = process
        self._facts: LogFacts | None = None

    async def next(self) -> LogBatch | None:
        """Return the next batch. Raises InvalidRequestError where the log is damaged or the process broke off."""
        if self._facts is not None:
            return None
        item = await _read(self._process)
        if isinstance(item, LogFacts):
            self._facts = item
            return None
        if not isinstance(item, LogBatch):
            raise _broken_off()
        return item

    def facts(self) -> LogFacts:
        """Return what the log turned out to be."""
        if self._facts is None:
            raise _broken_off()
        return self._facts


@asynccontextmanager
async def reading(file: IO[bytes], wanted: WantedLog) -> AsyncIterator[ReadingProcess]:
    """Have a process that reads a log; it ends with the block.

    Raises
    ------
    InvalidRequestError
        When the file is no log that can be used.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-P",
        "-m",
        __name__,
        str(file.fileno()),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        # What libraries write there may quote the file.
        stderr=asyncio.subprocess.DEVNULL,
        pass_fds=(file.fileno(),),
        env=_environment(),
        cwd="/",
        # Its own session: a signal from a terminal to the service is not for it.
        start_new_session=True,
    )
    try:
        assert process.stdin is not None  # noqa: S101 - it is a pipe
        with suppress(ConnectionError):  # it has ended before: that shows when it is read from
            process.stdin.write(pickle.dumps(wanted))
            process.stdin.write_eof()
            await process.stdin.drain()
        opened = await _read(process)
        if not isinstance(opened, OpenedLog):
            raise _broken_off()
        yield ReadingProcess(process, opened)
    finally:
        if process.returncode is None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await process.wait()


async def _read(process: Process) -> LogItem:
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    try:
        async with asyncio.timeout(SILENCE_S):
            (size,) = SIZE.unpack(await process.stdout.readexactly(SIZE.size))
            if size > MAX_ITEM_BYTES:
                raise _broken_off()
            content = await process.stdout.readexactly(size)
    except (asyncio.IncompleteReadError, TimeoutError):
        raise _broken_off() from None
    item: LogItem = await asyncio.to_thread(pickle.loads, content)  # this program wrote it
    if isinstance(item, RefusedLog):
        raise InvalidRequestError(item.field, item.message, item.remedy)
    return item


def _broken_off() -> InvalidRequestError:
    return InvalidRequestError(
        "log",
        "the process that reads it broke off: the file is damaged or too large, or memory is short",
        "check or divide it; sent again, what was stored of it is not stored twice",
    )


def _environment() -> dict[str, str]:
    search = os.pathsep.join(filter(None, [ROOT, os.environ.get("PYTHONPATH", "")]))
    kept = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    return kept | {
        "PYTHONPATH": search,
        "PYTHONDONTWRITEBYTECODE": "1",
        "LANG": "C.UTF-8",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        "PROJ_NETWORK": "OFF",
    }


def main() -> None:
    """Read the log that the argument names, and say what is in it."""
    limit(LIMITS)
    wanted = pickle.load(sys.stdin.buffer)  # noqa: S301 - this program wrote it
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as out:
        # Whatever else is printed is no item.
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        _write(out, read_log(OpenLog(int(sys.argv[1]), wanted.name), wanted))


def _write(out: IO[bytes], items: Iterable[LogItem]) -> None:
    for item in items:
        content = pickle.dumps(item, pickle.HIGHEST_PROTOCOL)
        out.write(SIZE.pack(len(content)))
        out.write(content)
        out.flush()


if __name__ == "__main__":
    main()
