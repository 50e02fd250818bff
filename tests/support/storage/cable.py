"""A way to a database server that can be cut without a word, as where a network drops packets."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from sqlalchemy import make_url


class Cable:
    """Passes bytes on to a port of this machine while it is whole; no connection is closed while it is not."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._whole = asyncio.Event()
        self._whole.set()
        self._under_way: set[asyncio.Task[None]] = set()

    def cut(self) -> None:
        """Let nothing through from now on."""
        self._whole.clear()

    def mend(self, *, lost: bool = False) -> None:
        """Let everything through again, also what was held up; ``lost``: only on connections made from now on."""
        if lost:
            self._whole = asyncio.Event()
        self._whole.set()

    async def carry(self, near: asyncio.StreamReader, to_near: asyncio.StreamWriter) -> None:
        """Pass on what one connection says in both directions."""
        far, to_far = await asyncio.open_connection("127.0.0.1", self._to)
        for source, sink in ((near, to_far), (far, to_near)):
            task = asyncio.create_task(self._pump(source, sink, self._whole))
            self._under_way.add(task)
            task.add_done_callback(self._under_way.discard)

    async def _pump(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter, whole: asyncio.Event) -> None:
        try:
            while data := await source.read(65536):
                await whole.wait()
                sink.write(data)
                await sink.drain()
        except OSError:
            pass
        finally:
            sink.close()

    async def end(self) -> None:
        """End every connection."""
        tasks = list(self._under_way)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@asynccontextmanager
async def cable_to(url: str) -> AsyncIterator[tuple[Cable, str]]:
    """A cable to a PostgreSQL database, and the database's URL by it."""
    parsed = make_url(url)
    assert parsed.port is not None
    cable = Cable(parsed.port)
    server = await asyncio.start_server(cable.carry, "127.0.0.1", 0)
    try:
        port = server.sockets[0].getsockname()[1]
        yield cable, parsed.set(port=port).render_as_string(hide_password=False)
    finally:
        server.close()
        await cable.end()
