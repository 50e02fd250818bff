"""Bodies that wait on the disk until somebody takes them."""

import asyncio
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path

from sqlalchemy import make_url
from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive

MEMORY_BYTES = 262_144
"""Up to here a body is kept in memory."""
PART_BYTES = 65_536


class Spool:
    """A body that can be read again and again; beyond :data:`MEMORY_BYTES` it is a file without a name.

    Parameters
    ----------
    folder
        Where the file is; None: the system's folder for such files.
    """

    def __init__(self, folder: Path | None) -> None:
        self._file = tempfile.SpooledTemporaryFile(MEMORY_BYTES, dir=None if folder is None else str(folder))  # noqa: SIM115 - closed by close()
        self.size = 0

    async def fill(self, receive: Receive) -> None:
        """Take a whole body. Raises ClientDisconnect, and what ``receive`` raises."""
        more = True
        while more:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            part = message.get("body", b"")
            if self.size + len(part) > MEMORY_BYTES:
                await asyncio.to_thread(self._file.write, part)
            else:
                self._file.write(part)
            self.size += len(part)
            more = message.get("more_body", False)

    async def parts(self) -> AsyncIterator[bytes]:
        """Yield the body from its beginning."""
        self._file.seek(0)
        while part := await self._part():
            yield part

    def replayed(self, receive: Receive) -> Receive:
        """Return what gives the body as it came, and then waits for the client to leave."""
        self._file.seek(0)
        left = self.size
        given = False

        async def replay() -> Message:
            nonlocal left, given
            if given:
                return await receive()
            part = await self._part()
            left -= len(part)
            given = left <= 0
            return {"type": "http.request", "body": part, "more_body": not given}

        return replay

    async def _part(self) -> bytes:
        if self.size <= MEMORY_BYTES:
            return self._file.read(PART_BYTES)
        return await asyncio.to_thread(self._file.read, PART_BYTES)

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def spool_folder(database_url: str) -> Path | None:
    """Return the folder of an SQLite database, whose disk has room; None for other databases."""
    url = make_url(database_url)
    in_file = url.get_backend_name() == "sqlite" and url.database not in (None, "", ":memory:")
    return Path(url.database or "").resolve().parent if in_file else None
