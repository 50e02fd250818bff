"""The real service as a process of its own, which tests start, kill and keep from its disk."""

import asyncio
import sqlite3
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx

from tests.support.commands import COMMAND, environment
from tests.support.ports import free_ports

PATIENCE_S = 300.0
LAUNCHER = Path(__file__).with_name("launch.py")


class Service:
    """``bathyfleet serve`` on a database of its own.

    Parameters
    ----------
    folder
        Where it runs and writes its log.
    database
        Its SQLite file; without one a file in ``folder``.
    database_url
        Any database, in place of a file.
    settings
        Environment variables without their prefix, for example ``IMC__ENABLED``.
    world
        What is wrong with its world, see ``launch.py``; changes of the clock can be made later by :meth:`set_clock`.
    prefix
        Words before the command, for example ``ip netns exec NAME``.
    host, port
        Address it serves on; without a port any free one.
    """

    def __init__(
        self,
        folder: Path,
        *,
        database: Path | None = None,
        database_url: str | None = None,
        settings: dict[str, str] | None = None,
        world: dict[str, str] | None = None,
        prefix: Sequence[str] = (),
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        self.folder = folder
        self.database = database or folder / "fleet.db"
        self.database_url = database_url or f"sqlite+aiosqlite:///{self.database}"
        self.host, self.port = host, port or free_ports(1)[0]
        self.process: asyncio.subprocess.Process | None = None
        self._settings = {"IMC__ENABLED": "false"} | (settings or {})
        self._world = world
        self._prefix = prefix

    @property
    def url(self) -> str:
        """Where its API is."""
        return f"http://{self.host}:{self.port}/api/v1"

    @property
    def pid(self) -> int:
        """Of the running process."""
        assert self.process is not None
        return self.process.pid

    @property
    def said(self) -> str:
        """Its log so far, JSON lines."""
        return (self.folder / "service.log").read_text()

    async def start(self) -> None:
        """Begin a process; it is not ready yet."""
        serve = ["serve", "--host", self.host, "--port", str(self.port), "--log-format", "json"]
        serve += ["--database", self.database_url]
        program = [sys.executable, str(LAUNCHER)] if self._world is not None else COMMAND
        ours = {f"BATHYFLEET_{name}": value for name, value in self._settings.items()}
        world = {f"FAULTS_{name}": value for name, value in (self._world or {}).items()}
        with (self.folder / "service.log").open("ab") as log:
            self.process = await asyncio.create_subprocess_exec(
                *(*self._prefix, *program, *serve),
                env=environment(**ours, **world),
                cwd=self.folder,
                stdout=log,
                stderr=log,
            )

    async def await_ready(self, api: httpx.AsyncClient) -> None:
        """Wait until it can do its work."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                assert self.process is not None
                assert self.process.returncode is None, self.said[-3000:]
                try:
                    if (await api.get("/health/ready")).status_code == httpx.codes.OK:
                        return
                except httpx.TransportError:
                    pass
                await asyncio.sleep(0.05)

    async def kill(self) -> None:
        """End it without a word."""
        assert self.process is not None
        self.process.kill()
        await self.process.wait()

    async def end(self) -> int:
        """Ask it to end; returns its exit code."""
        assert self.process is not None
        self.process.terminate()
        return await self.process.wait()

    def rows(self, query: str, *values: object) -> list[Any]:
        """What a query gives, read beside the service."""
        with closing(sqlite3.connect(f"file:{self.database}?mode=ro", uri=True)) as connection:
            return connection.execute(query, values).fetchall()

    def steps(self, mission_id: str) -> int:
        """How many steps are committed."""
        return int(self.rows("select count(*) from steps where mission_id = ?", mission_id)[0][0])


@asynccontextmanager
async def service_in(folder: Path, **changes: Any) -> AsyncIterator[tuple[Service, httpx.AsyncClient]]:
    """A service that is ready, and a client of it; it is killed in the end."""
    service = Service(folder, **changes)
    try:
        async with httpx.AsyncClient(base_url=service.url, timeout=60, verify=False) as api:  # noqa: S501
            await service.start()
            await service.await_ready(api)
            yield service, api
    finally:
        if service.process is not None and service.process.returncode is None:
            await service.kill()
