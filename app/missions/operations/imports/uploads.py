"""Files that are sent to the service: on disk without a name while they are read, never in memory."""

import asyncio
import errno
import hashlib
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from app.missions.errors import FileTooLargeError, ImportUnavailableError
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.unnamed_file import unnamed_file

MAX_AT_ONCE = 8
"""Of each the disk holds at most ``max_import_bytes``."""
BLOCK_BYTES = 1 << 20

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True)
class Upload:
    """A file that was sent, open for reading from its beginning.

    Attributes
    ----------
    sha256
        Of its content, in hexadecimal digits.
    """

    file: IO[bytes]
    size_bytes: int
    sha256: str


class Uploads:
    """Takes files in, a few at a time."""

    def __init__(self) -> None:
        self._open = 0

    @asynccontextmanager
    async def receive(self, parts: AsyncIterator[bytes], max_bytes: int) -> AsyncIterator[Upload]:
        """Write what arrives to disk and hash it meanwhile.

        The file never has a name: however this process ends, nothing of it is left.

        Raises
        ------
        FileTooLargeError
            As soon as more than ``max_bytes`` came.
        ImportUnavailableError
            When as many others are under way as are taken, or the disk has no room.
        """
        if self._open >= MAX_AT_ONCE:
            raise ImportUnavailableError(
                f"{self._open} files are being taken in, as many as can be at once", "send it again in a while"
            )
        self._open += 1
        try:
            file = await asyncio.to_thread(unnamed_file)
            try:
                size, digest = await _spool(parts, file, max_bytes)
                with await asyncio.to_thread(_reopened, file) as reading:
                    yield Upload(reading, size, digest)
            except OSError as error:
                if error.errno not in _NO_ROOM:
                    raise
                raise ImportUnavailableError(
                    "the disk has no room for the file", "make room where TMPDIR points to, then send it again"
                ) from None
            finally:
                file.close()
        finally:
            self._open -= 1


def open_upload(path: Path) -> Upload:
    """Open a file of this machine. Raises OSError."""
    file = path.open("rb")
    try:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
    except BaseException:
        file.close()
        raise
    return Upload(file, size, digest)


async def _spool(parts: AsyncIterator[bytes], file: IO[bytes], max_bytes: int) -> tuple[int, str]:
    """Return size and digest. Pieces are collected, so that few of them go to another thread."""
    digest = hashlib.sha256()
    size, waiting = 0, bytearray()

    def write(block: bytes) -> None:
        digest.update(block)
        file.write(block)

    async for part in parts:
        size += len(part)
        if size > max_bytes:
            raise FileTooLargeError(
                f"the file has more than {max_bytes} bytes",
                "Cut it to the mission's area, thin it, or raise max_import_bytes in the settings",
            )
        waiting += part
        if len(waiting) >= BLOCK_BYTES:
            await _in_thread(write, bytes(waiting))
            waiting.clear()
    await _in_thread(write, bytes(waiting))
    await _in_thread(lambda _: file.flush(), b"")
    return size, digest.hexdigest()


async def _in_thread(work: Callable[[bytes], Any], block: bytes) -> None:
    # To its end: the file must not be closed while another thread writes to it.
    await to_the_end(asyncio.to_thread(work, block))


def _reopened(file: IO[bytes]) -> IO[bytes]:
    """Return the same file for reading only, from its beginning."""
    return Path(f"/proc/self/fd/{file.fileno()}").open("rb")
