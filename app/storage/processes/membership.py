"""Which of the processes that share a database are alive, shown by locks that end with their holders.

No clock is compared and no heartbeat written: the operating system (SQLite) or the database server (PostgreSQL) gives
a lock up when its process is killed, and the server also when the network to it is cut. A process that hangs keeps its
lock: PostgreSQL tells when it asked last, as each does every second. In SQLite nothing does.
"""

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from sqlalchemy import make_url, text
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncSession, create_async_engine
from sqlalchemy.pool import NullPool

from app.storage.application_name import PREFIX, connect_arguments
from app.storage.processes.process_lock import LockHeldError, ProcessLock, is_held

LOCKS = 0x62617468
"""The first half of our advisory locks' names in PostgreSQL; the second is the process's number."""
_OURS = (
    "FROM pg_locks LEFT JOIN pg_stat_activity USING (pid) "  # noqa: S608 - nothing of it comes from outside
    f"WHERE locktype = 'advisory' AND classid::bigint = {LOCKS} "
    "AND objsubid = 2 AND granted AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)
HELD = f"SELECT objid::bigint {_OURS}"
"""Asks PostgreSQL for the numbers of a database's processes that have not ended."""
HEARD = f"SELECT objid::bigint, state_change {_OURS}"
"""The same, and when each asked last, by the server's clock; null where the server does not keep that."""
SESSIONS = (
    "SELECT pg_terminate_backend(session.pid) FROM pg_stat_activity session "  # noqa: S608 - the same
    "WHERE session.application_name IN "
    f"(SELECT application_name {_OURS} AND objid::bigint = ANY($1) AND application_name LIKE '{PREFIX}%')"
)
"""Ends everything that some processes have begun in PostgreSQL."""
HUNG_LOOKS = 60
"""A process that asked nothing while another one looked so often is taken for dead."""
LOOK_S = 0.9
"""Looks that follow each other faster count once."""
CHANNEL = "bathyfleet"
"""PostgreSQL's channel on which processes ask each other to look again."""
SILENCE_S = 4
"""PostgreSQL asks a connection that was silent this long whether it is still there, ``PROBES`` times each second."""
PROBES = 3
ANSWER_S = 2.0
"""A server that does not answer for this long is taken for cut off: before the server takes us for dead."""


class MembershipLostError(Exception):
    """Others may take this process for dead now."""


class Membership(Protocol):
    """One process among those that share a database."""

    @property
    def answer_s(self) -> float | None:
        """Who gets no answer from the database for this long may be taken for dead; None where nobody is for that."""

    async def enter(self, number: int) -> None:
        """Hold the lock of this number. Raises MembershipLostError when it cannot be had."""

    async def alive(self, numbers: Iterable[int]) -> set[int]:
        """Return those of the numbers whose processes live. Raises MembershipLostError."""

    async def end_sessions(self, numbers: Iterable[int]) -> None:
        """End what processes that are taken for dead have begun in the database, and may hold others up with."""

    async def call(self) -> None:
        """Tell the others to look again, where there is a way; they look every second anyway."""

    async def leave(self) -> None:
        """Give the lock up."""


def make_membership(url: str, on_call: Callable[[], None], application_name: str = "") -> Membership:
    """Return the membership for a database; ``on_call`` is called when another process says that something changed.

    ``application_name``: what the process is called on all its connections, see :mod:`app.storage.application_name`.
    """
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        return FileMembership(Path(parsed.database or "bathyfleet.db"))
    return AdvisoryMembership(url, on_call, application_name)


async def alive_beside(session: AsyncSession, url: str, numbers: Iterable[int]) -> set[int]:
    """Return those of the numbers whose processes live, as it is seen by one that is none of them."""
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        return await FileMembership(Path(parsed.database or "bathyfleet.db")).alive(numbers)
    return set(await session.scalars(text(HELD))) & set(numbers)


class FileMembership:
    """Processes on one machine that share an SQLite file: each holds a locked file beside it."""

    answer_s: float | None = None

    def __init__(self, database: Path) -> None:
        self._database = database
        self._number = 0
        self._lock: ProcessLock | None = None

    async def enter(self, number: int) -> None:
        """Hold the lock of this number."""
        if self._lock is not None and self._number == number and self._lock.is_ours:
            return
        await self.leave()
        try:
            self._lock = ProcessLock(self._path(number), number, self._owner())
        except (LockHeldError, OSError) as error:
            raise MembershipLostError(f"{self._path(number)} cannot be locked: {error}") from error
        self._number = number

    async def alive(self, numbers: Iterable[int]) -> set[int]:
        """Return the numbers whose files are locked by processes that live; ours only while others can see it."""
        return {number for number in numbers if self._lives(number)}

    def _lives(self, number: int) -> bool:
        if number == self._number:
            return self._lock is not None and self._lock.is_ours
        return is_held(self._path(number), self._owner())

    def _owner(self) -> int | None:
        try:
            return self._database.stat().st_uid
        except OSError:
            return None

    def _path(self, number: int) -> Path:
        return self._database.with_name(f"{self._database.name}-process-{number}")

    async def end_sessions(self, numbers: Iterable[int]) -> None:
        """Do nothing: with its lock a process has given up its transactions."""

    async def call(self) -> None:
        """Do nothing: the others look every second."""

    async def leave(self) -> None:
        """Give the lock up."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None


class Silence:
    """For how many looks in a row others were not heard; two that were both held up for long do not blame each other.

    Parameters
    ----------
    now_s
        A clock in seconds.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._counted_s = -math.inf
        self._heard: dict[int, tuple[datetime, int]] = {}
        """When each was heard last, and in how many looks it was not since."""

    def hung(self, heard: Mapping[int, datetime | None]) -> set[int]:
        """Return who was silent for too long, of all that are there, each with when it was heard last."""
        counts = self._now_s() - self._counted_s >= LOOK_S
        if counts:
            self._counted_s = self._now_s()
        found: dict[int, tuple[datetime, int]] = {}
        for number, at in heard.items():
            if at is not None:
                before, silent = self._heard.get(number, (None, 0))
                found[number] = at, silent + counts if before == at else 0
        self._heard = found
        return {number for number, (_, silent) in found.items() if silent >= HUNG_LOOKS}


class AdvisoryMembership:
    """Processes that share a PostgreSQL database: each holds an advisory lock on a connection of its own."""

    def __init__(self, url: str, on_call: Callable[[], None], application_name: str = "") -> None:
        self.answer_s = ANSWER_S
        self._engine = create_async_engine(url, poolclass=NullPool, connect_args=connect_arguments(application_name))
        self._number = 0
        self._silence = Silence()
        self._on_call = on_call
        self._connection: AsyncConnection | None = None
        self._driver: Any = None
        self._asking = asyncio.Lock()

    async def enter(self, number: int) -> None:
        """Connect and hold the lock of this number."""
        await self._disconnect()
        try:
            async with asyncio.timeout(2 * ANSWER_S):
                await self._connect()
                held = await self._driver.fetchval("SELECT pg_try_advisory_lock($1, $2)", LOCKS, number)
        except Exception as error:
            # Whatever it is, as from a server that is a standby for a while: who is not certain to be in is not in.
            raise MembershipLostError(f"the database lets nobody in: {error or type(error).__name__}") from error
        if not held:
            raise MembershipLostError(f"another process has number {number}")
        self._number = number

    async def _connect(self) -> None:
        self._connection = await self._engine.connect()
        raw = await self._connection.get_raw_connection()
        self._driver = raw.driver_connection
        # So the server notices within seconds when we are gone without a word.
        for setting, value in (("idle", SILENCE_S), ("interval", 1), ("count", PROBES)):
            await self._driver.execute(f"SET tcp_keepalives_{setting} = {value}")
        await self._driver.add_listener(CHANNEL, lambda *_: self._on_call())

    async def alive(self, numbers: Iterable[int]) -> set[int]:
        """Return the numbers whose locks are held, by processes that do not hang.

        Raises MembershipLostError when the server does not answer.
        """
        heard = {int(number): at for number, at in await self._ask("fetch", HEARD)}
        others = {number: at for number, at in heard.items() if number != self._number}
        return (set(heard) - self._silence.hung(others)) & set(numbers)

    async def end_sessions(self, numbers: Iterable[int]) -> None:
        """End the connections of processes, whatever transaction they are in. Raises MembershipLostError."""
        await self._ask("execute", SESSIONS, list(numbers))

    async def call(self) -> None:
        """Tell the others to look again."""
        await self._ask("execute", f"NOTIFY {CHANNEL}")

    async def _ask(self, method: str, query: str, *arguments: object) -> Any:
        if self._driver is None:
            raise MembershipLostError("not connected")
        try:
            async with self._asking, asyncio.timeout(ANSWER_S):
                return await getattr(self._driver, method)(query, *arguments)
        except Exception as error:
            # Whatever it is: without an answer from the server nothing is certain.
            raise MembershipLostError(f"the database does not answer: {error or type(error).__name__}") from error

    async def leave(self) -> None:
        """Give the lock up and disconnect."""
        with contextlib.suppress(MembershipLostError):
            # Disconnecting alone does it, too, but only once the server notices.
            await self._ask("execute", "SELECT pg_advisory_unlock_all()")
        await self._disconnect()

    async def _disconnect(self) -> None:
        connection, driver = self._connection, self._driver
        self._connection = self._driver = None
        if driver is not None:
            driver.terminate()
        if connection is not None:
            with contextlib.suppress(Exception):
                async with asyncio.timeout(ANSWER_S):
                    await connection.invalidate()
                    await connection.close()
