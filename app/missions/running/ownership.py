"""Which process has which mission, where several share a database.

A mission lives in the memory of one process only: whoever asks for it first takes it, everybody else sends requests on
to its owner. When a process ends, what it had belongs to nobody; missions that run are taken up by others at once.
What an owner writes for a mission carries a guard, so that a process that was taken for dead cannot write any more.
"""

import asyncio
import secrets
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.clock import now
from app.missions.errors import MissionElsewhereError, NotAMemberError
from app.missions.states import AT_SEA
from app.storage.database import Database, Guard
from app.storage.models import ProcessRow
from app.storage.processes import processes
from app.storage.processes.membership import MembershipLostError, make_membership

PERIOD_S = 1.0
"""How often is looked whether other processes ended."""

TRIES = 5
"""Entering is tried again when another process looks at the wrong moment."""

T = TypeVar("T")

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class Peer:
    """Another process that shares the database, and what it takes to speak to it."""

    number: int
    url: str
    secret: str
    certificate: str | None


class Ownership:
    """What one process has, among those that share a database.

    Parameters
    ----------
    url, certificate
        Where the others reach this process, and the certificate (PEM) that it shows them if it serves TLS with its own.

    Attributes
    ----------
    secret
        What others show who send a request on to this process.
    called
        Set when another process says that something changed.
    aside
        Whether others may take this process for dead: its vehicles are stopped, and no other begins to fly.
    entries
        How often this process became a new one. SQLite gives numbers again that others had.
    """

    def __init__(self, database: Database, url: str, certificate: str | None = None) -> None:
        self._database = database
        self._reserved = database.reserved()
        self._url = url
        self._certificate = certificate
        self.secret = secrets.token_hex(32)
        self.called = asyncio.Event()
        self.aside = False
        self.entries = 0
        self._membership = make_membership(database.url, self.called.set, database.application_name)
        self._number = 0
        self._mine: set[str] = set()
        self._peers: dict[int, Peer] = {}

    @property
    def url(self) -> str:
        """Where the others reach this process."""
        return self._url

    @property
    def number(self) -> int:
        """What this process is called among the others; 0 before it entered."""
        return self._number

    @property
    def peers(self) -> Sequence[Peer]:
        """The other processes that were alive when we last looked."""
        return list(self._peers.values())

    async def enter(self) -> bool:
        """Become one of the processes; False when what we had before may have been others' meanwhile.

        Raises
        ------
        MembershipLostError
            When that is not possible now.
        """
        if self._number:
            await self._membership.enter(self._number)
            if await self._is_known():
                return True
        self.entries += 1
        self._mine.clear()
        for _ in range(TRIES):
            row = ProcessRow(url=self._url, secret=self.secret, certificate=self._certificate, began_at=now())
            async with self._reserved.writing() as session:
                session.add(row)
                await session.flush()
                self._number = row.id
            await self._membership.enter(self._number)
            # Between the two another process may have found the lock free and taken us for dead.
            if await self._is_known():
                return False
        raise MembershipLostError(f"this process was taken for dead {TRIES} times while it began")

    async def _is_known(self) -> bool:
        async def there(session: AsyncSession) -> bool:
            return await session.get(ProcessRow, self._number) is not None

        return await self._ask(there)

    async def _ask(self, query: Callable[[AsyncSession], Awaitable[T]]) -> T:
        """Return what a query gives. Raises MembershipLostError where the answer does not come in time."""
        try:
            return await self._database.answer(self._membership.answer_s, query)
        except TimeoutError as error:
            raise MembershipLostError(f"the database does not answer: {error or type(error).__name__}") from error

    async def leave(self) -> None:
        """Give everything up and tell the others."""
        if self._number:
            try:
                async with self._reserved.writing() as session:
                    await processes.bury(session, [self._number])
                await self._membership.call()
            except Exception as error:
                # The others find out by themselves.
                log.warning("could not say that this process ends", error=str(error))
            self._number = 0
        self._mine.clear()
        await self._membership.leave()

    async def look(self) -> Sequence[str]:
        """Look who lives. Returns the missions at sea that nobody has, or this process, oldest first.

        Raises
        ------
        MembershipLostError
            When the others may take this process for dead.
        """
        known = await self._ask(processes.all_processes)
        alive = await self._membership.alive([row.id for row in known])
        if self._number not in alive:
            raise MembershipLostError("this process was taken for dead")
        dead = {row.id for row in known} - alive
        if dead:
            await self._membership.end_sessions(dead)
            async with self._reserved.writing() as session:
                await processes.bury(session, dead)
            log.warning("another process ended, or hangs", processes=sorted(dead))
        self._peers = {
            row.id: Peer(row.id, row.url, row.secret, row.certificate)
            for row in known
            if row.id in alive and row.id != self._number
        }
        return await self._ask(partial(processes.open_to, states=AT_SEA, process=self._number))

    async def owner(self, mission_id: str) -> Peer | None:
        """Return the other process that has a mission; None when it is ours, nobody's or unknown.

        Raises
        ------
        NotAMemberError
            While this process knows of no other one.
        """
        if mission_id in self._mine:
            return None
        async with self._database.reading() as session:
            number = await processes.owner(session, mission_id)
        if number is None or number == self._number:
            return None
        if number not in self._peers:
            try:
                await self.look()
            except MembershipLostError as error:
                raise _not_a_member() from error
        return self._peers.get(number)

    def check_member(self, entries: int) -> None:
        """Raise NotAMemberError where this process stands aside, or is a new one since it had entered so often."""
        if self.aside or entries != self.entries:
            raise _not_a_member()

    async def take(self, mission_id: str) -> bool:
        """Have a mission from now on; False when another process has it. Raises NotAMemberError."""
        async with self._database.writing() as session:
            await self.take_within(session, mission_id)
            mine = await processes.owner(session, mission_id) == self._number
        if mine:
            self._mine.add(mission_id)
        return mine

    async def take_within(self, session: AsyncSession, mission_id: str) -> None:
        """Have a mission without owner once a transaction ends well.

        Raises
        ------
        NotAMemberError
            When this process is none of those that share the database: whatever the transaction wrote is taken back.
        """
        if not await processes.is_known(session, self._number):
            raise _not_a_member()
        await processes.take(session, mission_id, self._number, now())

    async def release(self, mission_ids: Iterable[str]) -> None:
        """Give missions up."""
        given = set(mission_ids)
        self._mine -= given
        async with self._database.writing() as session:
            await processes.release(session, given, self._number)

    def guard(self, mission_id: str) -> Guard:
        """Return what keeps a transaction from writing for a mission that is another process's now."""

        async def check(session: AsyncSession) -> None:
            if await processes.owner(session, mission_id, hold=True) != self._number:
                raise MissionElsewhereError(
                    f"mission {mission_id} belongs to another process now", "ask again: the request finds its way there"
                )

        return check


def _not_a_member() -> NotAMemberError:
    return NotAMemberError(
        "this process is none of those that share the database now: it was out of reach, or others took it for dead",
        "Ask again in a moment: it enters again by itself as soon as it can",
    )
