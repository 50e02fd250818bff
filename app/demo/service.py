"""What demonstrations share: the real service in this process while something is done with it over REST."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console

from app.settings import Settings
from app.storage.processes.process_lock import LockHeldError, ProcessLock, is_held

NOBODYS = 0
"""Services on a database are numbered from 1: this lock is none of theirs, and holds before one has begun."""


class DemoError(Exception):
    """The demonstration cannot go on; the message says why and what to do."""


@contextlib.contextmanager
def claimed(settings: Settings, database: Path) -> Iterator[None]:
    """Remove the database of an earlier demonstration, and let no other one have it meanwhile.

    Raises
    ------
    StartupError
        When the port is taken.
    DemoError
        When another demonstration has the database, or a service that goes on with one.
    """
    from app.main import listen

    listen(settings).close()
    try:
        if any(map(is_held, database.parent.glob(f"{database.name}-process-*"))):
            raise LockHeldError
        path = database.with_name(f"{database.name}-process-{NOBODYS}")
        lock = ProcessLock(path, NOBODYS)
    except LockHeldError:
        raise DemoError(
            f"{database} is in use by another demonstration, or by a service that goes on with one: "
            "end that one first, or name another folder with --output"
        ) from None
    try:
        for old in set(database.parent.glob(f"{database.name}*")) - {path}:
            old.unlink()
        yield
    finally:
        lock.release()


async def serve_during(
    settings: Settings, work: Callable[[str], Awaitable[None]], *, keep_serving: bool, console: Console
) -> bool:
    """Serve while ``work`` is done with the service's address, with ``keep_serving`` until Ctrl-C.

    Returns
    -------
    False when serving ended before the work was done.

    Raises
    ------
    DemoError
        When the service does not begin, or what ``work`` raises.
    """
    from app.main import Server, serve

    up: asyncio.Future[Server] = asyncio.get_running_loop().create_future()
    serving = asyncio.create_task(serve(settings, started=lambda server: up.set_result(server)))
    begun: list[asyncio.Future[Any]] = [serving, up]
    await asyncio.wait(begun, return_when=asyncio.FIRST_COMPLETED)
    if not up.done():
        await serving
        raise DemoError("the service ended before it began; see service.log in the output folder")
    server = up.result()
    working = asyncio.ensure_future(work(server.url))
    await asyncio.wait([serving, working], return_when=asyncio.FIRST_COMPLETED)
    try:
        # A request that was under way when the service was told to end fails: that is no trouble of the work's.
        if not working.done() or (server.should_exit and working.exception() is not None):
            working.cancel()
            await asyncio.gather(working, return_exceptions=True)
            return False
        await working
        if keep_serving:
            console.print(f"Still serving at [bold]{server.url}[/]. Ctrl-C ends it.")
            await serving
    finally:
        server.stop()
        await serving
    return True


def client(url: str) -> httpx.AsyncClient:
    """Return a client of the service's API.

    It keeps no connection: where compiling holds up the loop that both share, the service would close an idle one in
    the moment in which it is used again.
    """
    limits = httpx.Limits(max_keepalive_connections=0)
    return httpx.AsyncClient(base_url=f"{url}/api/v1", timeout=60.0, limits=limits)


async def get(api: httpx.AsyncClient, path: str) -> Any:
    """Return what the service answers."""
    answer = await api.get(path)
    check(answer)
    return answer.json()


async def post(api: httpx.AsyncClient, path: str, body: dict[str, Any] | None = None) -> Any:
    """Send something and return what the service answers."""
    answer = await api.post(path, json=body or {})
    check(answer)
    return answer.json()


def check(answer: httpx.Response) -> None:
    """Raise DemoError with the service's own words when it refused."""
    if answer.is_error:
        problem = answer.json()
        remedy = f". {problem['remedy']}" if problem.get("remedy") else ""
        raise DemoError(f"{answer.request.url.path}: {problem.get('detail', answer.text)}{remedy}")
