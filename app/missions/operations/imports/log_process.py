"""Vehicles' logs that a service takes in are read by a process of their own, locked in: it takes minutes of computing.

As a program: the argument is the number of an open file, the log. What is asked comes pickled on standard input; what
was read goes to standard output, each item behind its length: see ``log_items``.
"""

import asyncio
import os
import pickle
import struct
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Collection, Iterable
from contextlib import asynccontextmanager, suppress
from typing import IO

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.confinement import ResourceLimits, confine, limit
from app.mapping.readers.warm_up import data_folders
from app.missions.errors import InvalidRequestError
from app.missions.operations import child_process
from app.missions.operations.imports.log_batches import (
    LogBatch,
    LogFacts,
    LogItem,
    OpenedLog,
    RefusedLog,
    UnreadLog,
    WantedLog,
    read_log,
)
from app.missions.operations.imports.log_items import item_bytes, item_of
from app.missions.operations.imports.reader_process import not_confined, reader_environment
from imc_bridge.logs import OpenLog

LIMITS = ResourceLimits(memory_bytes=4 * 2**30, cpu_s=1800, file_bytes=2**20)
SIZE = struct.Struct("<Q")
MAX_ITEM_BYTES = 2**26
"""A batch of pings is some megabytes."""
SILENCE_S = 600.0
"""So long nothing may come of a file of which nothing can be used."""


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
        if not isinstance(item, LogBatch) or any(one.vehicle != self.opened.vehicle for one in item.reports):
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
    InvalidRequestError, ImportUnavailableError
        When the file is no log that can be used; when nothing here keeps the process from other files.
    """
    process = await child_process.start(
        __name__,
        [str(file.fileno())],
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        # What libraries write there may quote the file.
        stderr=asyncio.subprocess.DEVNULL,
        files=[file.fileno()],
        environment=reader_environment(),
        folder="/",
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
        child_process.kill(process)
        if process.stdout is not None:
            # What nobody read any more would keep the pipe open.
            await process.stdout.read()
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
    item = await asyncio.to_thread(_item, content)
    if isinstance(item, UnreadLog):
        raise not_confined(item.confined)
    if isinstance(item, RefusedLog):
        raise InvalidRequestError(item.field, item.message, item.remedy)
    return item


def _broken_off() -> InvalidRequestError:
    return InvalidRequestError(
        "log",
        "the process that reads it broke off: the file is damaged or too large, or memory is short",
        "check or divide it; sent again, what was stored of it is not stored twice",
    )


def _item(content: bytes) -> LogItem:
    try:
        return item_of(content)
    except ValueError:
        # It was told something that makes no sense.
        raise _broken_off() from None


def _confined(descriptors: Collection[int], wanted: WantedLog) -> dict[str, str]:
    """Lock this process in for good; returns why not, by layer, where it stays free and may not."""
    # What loads files when it is first used is used before.
    frame = LocalFrame(wanted.near.origin_lat_deg, wanted.near.origin_lon_deg)
    frame.to_local(wanted.near.origin_lat_deg, wanted.near.origin_lon_deg)
    held = confine(descriptors, data_folders())
    return held if held["landlock"] and held["seccomp"] and not wanted.unconfined else {}


def main() -> None:
    """Read the log that the argument names, locked in, and say what is in it."""
    limit(LIMITS)
    wanted = pickle.load(sys.stdin.buffer)  # noqa: S301 - this program wrote it
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as out:
        # Whatever else is printed is no item.
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        log = int(sys.argv[1])
        free = _confined([log, out.fileno()], wanted)
        _write(out, [UnreadLog(free)] if free else read_log(OpenLog(log, wanted.name), wanted))


def _write(out: IO[bytes], items: Iterable[LogItem]) -> None:
    for item in items:
        content = item_bytes(item)
        out.write(SIZE.pack(len(content)))
        out.write(content)
        out.flush()


if __name__ == "__main__":
    main()
