"""Databases for tests: SQLite files, or those of a real PostgreSQL server that the tests start for themselves."""

import asyncio
import itertools
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from app.storage.database import make_engine
from app.storage.upkeep import migrate

KINDS = ("sqlite", "postgresql")
SERVER_USERS = ("postgres", "nobody")


class Databases:
    """Makes databases, each test its own; ``kind`` is what tests get that do not say which they want."""

    def __init__(self, kind: str, folder: Path, stack: ExitStack) -> None:
        self.kind = kind
        self._folder = folder
        self._stack = stack
        self._numbers = itertools.count(1)
        self._server: PostgresServer | None = None
        self._template: dict[str, str] = {}

    @property
    def server(self) -> "PostgresServer":
        """The PostgreSQL server; the test is skipped where there is none."""
        if self._server is None:
            self._server = self._stack.enter_context(postgres_server())
        return self._server

    def empty(self, kind: str | None = None) -> str:
        """Return the URL of a database without a table."""
        name = f"trial_{next(self._numbers)}"
        if (kind or self.kind) == "sqlite":
            return f"sqlite+aiosqlite:///{self._folder / name}.db"
        return self.server.create(name)

    def fresh(self, kind: str | None = None) -> str:
        """Return the URL of a database with every table and no row."""
        kind = kind or self.kind
        if kind not in self._template:
            self._template[kind] = self.empty(kind)
            _elsewhere(migrate.upgrade(self._template[kind]))
        template = self._template[kind]
        if kind == "sqlite":
            url = self.empty(kind)
            shutil.copy(path_of(template), path_of(url))
            return url
        return self.server.create(f"trial_{next(self._numbers)}", template=template.rpartition("/")[2])


def path_of(url: str) -> Path:
    """Return an SQLite database's file."""
    return Path(url.removeprefix("sqlite+aiosqlite:///"))


def query(url: str, statement: str, **values: Any) -> Sequence[Any]:
    """Return what a statement gives; one that writes waits for others, so a test's own loop should not wait for it."""

    async def ask() -> Sequence[Any]:
        engine = make_engine(url)
        try:
            async with engine.connect() as connection:
                await connection.execution_options(bathyfleet_writes=not statement.startswith("select"))
                async with connection.begin():
                    result = await connection.execute(text(statement), values)
                    return [tuple(row) for row in result] if result.returns_rows else []
        finally:
            await engine.dispose()

    return _elsewhere(ask())


def _elsewhere(work: Any) -> Any:
    """Run a coroutine in a thread: the caller's may have a loop already."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()


class PostgresServer:
    """A private server on a free port of this machine."""

    def __init__(self, url: str, command: list[str], data: Path, control: Callable[..., None]) -> None:
        self.url = url
        self._command = command
        self._data = data
        self._control = control

    @property
    def socket_url(self) -> str:
        """Where it is on this machine without a network."""
        rest, _, port = self.url.rpartition(":")
        return f"{rest.rpartition('@')[0]}@/{{}}?host={self._data.parent}&port={port}"

    def create(self, name: str, *, template: str = "template0") -> str:
        """Make a database; returns its URL."""
        subprocess.run([*self._command, "-T", template, name], check=True)
        return f"{self.url}/{name}"

    @contextmanager
    def as_standby(self) -> Iterator[None]:
        """Start it anew as a standby, as after a change of servers; it is promoted in the end."""
        (self._data / "standby.signal").touch()
        self._control("-m", "fast", "restart")
        try:
            yield
        finally:
            self._control("promote")


@contextmanager
def postgres_server() -> Iterator[PostgresServer]:
    """Start a server; skips the test where that is not possible."""
    binaries = _postgres_binaries()
    if binaries is None:
        pytest.skip("no PostgreSQL server here: neither /usr/lib/postgresql/*/bin/initdb nor initdb on the PATH")
    user = None
    if os.geteuid() == 0:
        # The server refuses to run as root.
        known = {entry.pw_name for entry in pwd.getpwall()}
        user = next((name for name in SERVER_USERS if name in known), None)
        if user is None or shutil.which("runuser") is None:
            pytest.skip("PostgreSQL does not run as root, and there is no other user to run it as")
    # Not below pytest's folder, which other users may not enter; the path of a Unix socket must be short as well.
    folder = Path(tempfile.mkdtemp(prefix="pg"))
    data = folder / "data"
    if user is not None:
        shutil.chown(folder, user)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]

    def run(program: str, *arguments: str, **options: Any) -> None:
        command = [str(binaries / program), *arguments]
        as_user = command if user is None else ["runuser", "-u", user, "--", *command]
        subprocess.run(as_user, check=True, cwd=folder, **options)

    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        run("initdb", "-D", str(data), "-U", "fleet", "-A", "trust", "-E", "UTF8", "--no-sync", capture_output=True)
        # Tests do not survive a power cut either.
        options = (
            f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder} -c max_connections=300 "
            "-c fsync=off -c synchronous_commit=off -c full_page_writes=off"
        )
        control = partial(run, "pg_ctl", "-D", str(data), "-w", "-l", str(folder / "log"), **silent)
        control("-o", options, "start")
        try:
            create = [str(binaries / "createdb"), "-h", "127.0.0.1", "-p", str(port), "-U", "fleet"]
            yield PostgresServer(f"postgresql+asyncpg://fleet@127.0.0.1:{port}", create, data, control)
        finally:
            control("-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _postgres_binaries() -> Path | None:
    installed = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    found = shutil.which("initdb")
    candidates = [*installed, *([Path(found)] if found else [])]
    return candidates[-1].resolve().parent if candidates else None
