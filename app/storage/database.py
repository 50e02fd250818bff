"""The database behind the service: connections, transactions, SQLite's settings."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, nullcontext
from copy import copy
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakSet

from sqlalchemy import Connection, event, make_url, text
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine, AsyncSession, create_async_engine
from sqlalchemy.pool import QueuePool

from app.storage import private
from app.storage.application_name import connect_arguments, new_application_name
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.db_errors import trouble_of

BUSY_TIMEOUT_MS = 30_000
"""How long a writer waits for one of another process."""
TROUBLED_TIMEOUT_MS = 1_000
"""How long one waits once another one has waited in vain."""
PATIENCE = "bathyfleet_patience_ms"
"""Under this name a connection keeps how long it waits."""
CONNECTIONS = 15
"""So many transactions of one process are under way at the same time; others wait for their turn."""
KEPT_CONNECTIONS = 5
"""So many stay open while they are not needed."""
TURN_S = 30.0
"""How long a transaction waits for a connection that is free."""
RESERVED_CONNECTIONS = 2
"""Of what nobody else may hold up: the watch beside other processes, and whether the database can be reached."""
CONNECT_S = 4.0
"""How long opening one of these may take: a server that is cut off does not say so."""
PING_S = 2.0
"""A database that does not answer for this long cannot be reached: before those who ask give up."""
RECENT_S = 60.0
"""A trouble that did not show for this long is taken to be over."""

T = TypeVar("T")


def make_engine(
    url: str,
    application_name: str = "",
    connections: int = CONNECTIONS,
    kept: int = KEPT_CONNECTIONS,
    connect_s: float | None = None,
) -> AsyncEngine:
    """Return an engine for ``url``; SQLite is put into WAL mode with foreign keys and durable commits.

    ``application_name``: what PostgreSQL is told that its connections are called. ``connections``: how many it has at
    most, ``kept`` of them also while they are not needed. ``connect_s``: how long PostgreSQL may take to let us in.

    Raises
    ------
    ValueError
        When the URL names a database or driver that is not supported.
    """
    parsed = make_url(url)
    if parsed.drivername not in ("sqlite+aiosqlite", "postgresql+asyncpg"):
        raise ValueError(
            f"database_url names {parsed.drivername!r}: use sqlite+aiosqlite:///FILE or postgresql+asyncpg://USER@HOST/NAME"
        )
    pool: dict[str, Any] = {"pool_size": kept, "max_overflow": connections - kept, "pool_timeout": TURN_S}
    if parsed.get_backend_name() != "sqlite":
        arguments = connect_arguments(application_name)
        if connect_s is not None:
            arguments["timeout"] = connect_s
        return create_async_engine(url, pool_pre_ping=True, connect_args=arguments, **pool)
    file = Path(parsed.database) if parsed.database and parsed.database != ":memory:" else None
    engine = create_async_engine(url, **(pool if file is not None else {}))

    @event.listens_for(engine.sync_engine, "do_connect")
    def _make_private(*_arguments: Any) -> None:
        # The library would make the file as the umask has it; its journals get the rights of the file itself.
        if file is not None and file.parent.is_dir():
            private.create(file)

    @event.listens_for(engine.sync_engine, "connect")
    def _configure(connection: Any, _record: Any) -> None:
        # The driver's own implicit transactions would begin too late for BEGIN IMMEDIATE.
        connection.isolation_level = None
        cursor = connection.cursor()
        # Patience first: after a crash the journal is recovered, which others may be waiting for or doing.
        for pragma in (f"busy_timeout={BUSY_TIMEOUT_MS}", "journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"):
            cursor.execute(f"PRAGMA {pragma}")
        cursor.close()

    @event.listens_for(engine.sync_engine, "begin")
    def _begin(connection: Connection) -> None:
        # A reader that becomes a writer half-way fails when another writer was faster: writers say so at once.
        options = connection.get_execution_options()
        patience_ms = options.get(PATIENCE)
        if patience_ms not in (None, connection.info.get(PATIENCE, BUSY_TIMEOUT_MS)):
            connection.exec_driver_sql(f"PRAGMA busy_timeout={patience_ms}")
            connection.info[PATIENCE] = patience_ms
        connection.exec_driver_sql("BEGIN IMMEDIATE" if options.get("bathyfleet_writes", False) else "BEGIN")

    return engine


Guard = Callable[[AsyncSession], Awaitable[None]]
"""Looks, within a transaction that is about to write, whether it may; raises when it may not."""


class _Trouble:
    """What kept a transaction from being written."""

    def __init__(self) -> None:
        self.what = ""
        self._noted_s = 0.0

    def note(self, error: Exception) -> None:
        trouble = trouble_of(error)
        if trouble:
            self.what, self._noted_s = trouble, time.monotonic()

    @property
    def recent(self) -> str:
        return self.what if time.monotonic() - self._noted_s < RECENT_S else ""


class Database:
    """Hands out sessions: ``reading`` for queries, ``writing`` for transactions that commit at the end."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.application_name = new_application_name()
        self._engine = make_engine(url, self.application_name)
        # In memory each engine has a database of its own.
        in_memory = not isinstance(self._engine.pool, QueuePool)
        few = (RESERVED_CONNECTIONS, RESERVED_CONNECTIONS, CONNECT_S)
        self._reserved_engine = self._engine if in_memory else make_engine(url, self.application_name, *few)
        self._reserved_drivers = _drivers(self._reserved_engine)
        self._asking: set[asyncio.Task[Any]] = set()
        self._pinging: asyncio.Task[None] | None = None
        # SQLite's writers wait for each other by asking again and again, and the unlucky one gives up ("database is
        # locked"). Those of this process stand in line instead; the timeout is left for other processes.
        self._turn = asyncio.Lock() if self._engine.dialect.name == "sqlite" else None
        self._guard: Guard | None = None
        self._trouble = _Trouble()

    def guarded(self, guard: Guard) -> "Database":
        """Return the same database with a guard before everything that is written through it."""
        guarded = copy(self)
        guarded._guard = guard
        return guarded

    def reserved(self) -> "Database":
        """Return the same database by connections that requests and missions cannot take, for what must not wait."""
        reserved = copy(self)
        reserved._engine = self._reserved_engine
        return reserved

    @asynccontextmanager
    async def reading(self) -> AsyncIterator[AsyncSession]:
        """Yield a session for queries."""
        async with self._connected() as connection, _session_on(connection) as session:
            yield session

    @asynccontextmanager
    async def writing(self) -> AsyncIterator[AsyncSession]:
        """Yield a session whose changes are committed together, or not at all when the block raises."""
        try:
            async with self._turn or nullcontext(), self._connected() as connection:
                # Where one waited in vain the others in line do not each wait as long.
                patience_ms = min(TROUBLED_TIMEOUT_MS, BUSY_TIMEOUT_MS) if self.trouble else BUSY_TIMEOUT_MS
                await connection.execution_options(bathyfleet_writes=True, bathyfleet_patience_ms=patience_ms)
                async with connection.begin(), _session_on(connection) as session:
                    if self._guard is not None:
                        await self._guard(session)
                    yield session
                    await session.flush()
        except Exception as error:
            self._trouble.note(error)
            raise
        self._trouble.what = ""

    @property
    def trouble(self) -> str:
        """What kept the last transaction from being written, a moment ago, and what to do about it; else empty."""
        return self._trouble.recent

    async def ping(self) -> None:
        """Raise when the database cannot be reached; within ``PING_S``, however many connections are in use."""
        # Another one may begin the next while this one waits.
        pinging = self._pinging
        if pinging is None or pinging.done():
            pinging = self._pinging = asyncio.create_task(self.answer(PING_S, _ask_anything), name="ping")
            pinging.add_done_callback(_look_at)
        await asyncio.wait([pinging])
        pinging.result()

    async def answer(self, limit_s: float | None, ask: Callable[[AsyncSession], Awaitable[T]]) -> T:
        """Return what ``ask`` reads, by a reserved connection.

        Raises TimeoutError where that takes longer than ``limit_s``. A server that is cut off would be waited for
        much longer: the reserved ones are dropped then, and later questions are asked on others.
        """
        task = asyncio.create_task(self.reserved()._read(ask), name="ask the database")
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)
        task.add_done_callback(_look_at)
        await asyncio.wait([task], timeout=limit_s)
        if not task.done():
            self._drop_reserved()
            raise TimeoutError(f"it does not answer within {limit_s:g} s")
        return task.result()

    async def _read(self, ask: Callable[[AsyncSession], Awaitable[T]]) -> T:
        async with self.reading() as session:
            return await ask(session)

    def _drop_reserved(self) -> None:
        for driver in list(self._reserved_drivers):
            driver.terminate()

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator[AsyncConnection]:
        # The library's own context managers forget a connection whose opening or closing is cancelled.
        connection = self._engine.connect()
        try:
            await to_the_end(connection.start())
            yield connection
        finally:
            if connection.sync_connection is not None:
                await to_the_end(connection.close())

    async def close(self) -> None:
        """Close every connection; what is still asked is not waited for longer than opening one takes."""
        asking = [*self._asking, *([self._pinging] if self._pinging is not None else [])]
        if any(not task.done() for task in asking):
            self._drop_reserved()
            await asyncio.wait(asking, timeout=CONNECT_S)
        await self._engine.dispose()
        await self._reserved_engine.dispose()


def _drivers(engine: AsyncEngine) -> WeakSet[Any]:
    """Return an engine's connections as PostgreSQL's driver has them, now and later; none for SQLite."""
    drivers: WeakSet[Any] = WeakSet()
    if engine.dialect.name == "postgresql":
        # The first: what follows asks the server already.
        @event.listens_for(engine.sync_engine, "connect", insert=True)
        def _note(connection: Any, _record: Any) -> None:
            drivers.add(connection.driver_connection)

    return drivers


async def _ask_anything(session: AsyncSession) -> None:
    await session.execute(text("SELECT 1"))


def _look_at(done: asyncio.Task[Any]) -> None:
    """Look at a task's error, which nobody may be waiting for any more."""
    if not done.cancelled():
        done.exception()


@asynccontextmanager
async def _session_on(connection: AsyncConnection) -> AsyncIterator[AsyncSession]:
    session = AsyncSession(connection, expire_on_commit=False)
    try:
        yield session
    finally:
        await to_the_end(session.close())
