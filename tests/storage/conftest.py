import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path

import pytest

from app.storage import migrate
from app.storage.database import Database

SERVER_USERS = ("postgres", "nobody")


def _postgres_binaries() -> Path | None:
    installed = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    found = shutil.which("initdb")
    candidates = [*installed, *([Path(found)] if found else [])]
    return candidates[-1].parent if candidates else None


def _as_server_user(command: list[str], user: str | None) -> list[str]:
    return command if user is None else ["runuser", "-u", user, "--", *command]


@pytest.fixture(scope="session")
def postgres_cluster() -> Iterator[str]:
    """A private PostgreSQL server on a free loopback port; yields the URL without the database's name."""
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
    control = [str(binaries / "pg_ctl"), "-D", str(data), "-w"]
    try:
        subprocess.run(
            _as_server_user(
                [str(binaries / "initdb"), "-D", str(data), "-U", "fleet", "-A", "trust", "-E", "UTF8", "--no-sync"],
                user,
            ),
            check=True,
            capture_output=True,
            cwd=folder,
        )
        options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder}"
        subprocess.run(
            _as_server_user([*control, "-l", str(folder / "log"), "-o", options, "start"], user),
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=folder,
        )
        try:
            yield f"postgresql+asyncpg://fleet@127.0.0.1:{port}"
        finally:
            subprocess.run(
                _as_server_user([*control, "-m", "immediate", "stop"], user),
                check=True,
                stdout=subprocess.DEVNULL,
                cwd=folder,
            )
    finally:
        shutil.rmtree(folder, ignore_errors=True)


async def _on_postgres(cluster: str, statement: str) -> None:
    import asyncpg

    connection = await asyncpg.connect(cluster.replace("+asyncpg", "") + "/postgres")
    try:
        await connection.execute(statement)
    finally:
        await connection.close()


@pytest.fixture(params=["sqlite", "postgresql"])
async def empty_url(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[str]:
    """An empty database of either kind."""
    if request.param == "sqlite":
        yield f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}"
        return
    yield await _empty_on(request.getfixturevalue("postgres_cluster"), "trial")


async def _empty_on(cluster: str, name: str) -> str:
    await _on_postgres(cluster, f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")
    await _on_postgres(cluster, f"CREATE DATABASE {name}")
    return f"{cluster}/{name}"


@pytest.fixture
def make_postgres(postgres_cluster: str) -> Callable[[str], Awaitable[str]]:
    """Makes a migrated PostgreSQL database of a name and returns its URL."""

    async def make(name: str) -> str:
        url = await _empty_on(postgres_cluster, name)
        await migrate.upgrade(url)
        return url

    return make


@pytest.fixture
async def url(empty_url: str) -> str:
    """A database with every table and no row."""
    await migrate.upgrade(empty_url)
    return empty_url


@pytest.fixture
async def database(url: str) -> AsyncIterator[Database]:
    database = Database(url)
    yield database
    await database.close()


@pytest.fixture
async def sqlite(tmp_path: Path) -> AsyncIterator[Database]:
    """A migrated SQLite file, where a statement is about SQLite only."""
    url = f"sqlite+aiosqlite:///{tmp_path / 'fleet.db'}"
    await migrate.upgrade(url)
    database = Database(url)
    yield database
    await database.close()
