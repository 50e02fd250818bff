"""What comes faster than it should be written: gathered for a moment, then written in one transaction.

Nothing counts before that transaction has committed. What cannot be written, because the disk is full for example,
stays noted until it can.
"""

import asyncio
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import structlog
from sqlalchemy.ext.asyncio import AsyncSession

from app.missions.errors import MissionElsewhereError
from app.missions.live.journals.db_retry import RETRY_S, DatabaseRetry
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database

log = structlog.get_logger(__name__)

T = TypeVar("T")
Committed = Callable[[], None]
"""Called once a transaction has committed: only now what it stored counts."""


class WriteBehind(ABC, Generic[T]):
    """Writes what is noted, in the order it came.

    Parameters
    ----------
    storage
        Waits where the database cannot be used.
    period_s
        How long is gathered.
    """

    def __init__(self, database: Database, mission_id: str, storage: DatabaseRetry, period_s: float) -> None:
        self.storage = storage
        self.writing = asyncio.Lock()
        """Held while anything of this kind is judged and stored, so that nothing changes under it."""
        self._database = database
        self.mission_id = mission_id
        self._period_s = period_s
        self._noted: list[T] = []
        self._pump: asyncio.Task[None] | None = None

    @abstractmethod
    async def _store(self, noted: Sequence[T], session: AsyncSession) -> Committed:
        """Store in the session's transaction; it may be called again with the same when that fails."""

    def _note(self, *items: T) -> None:
        """Note what is written within a moment."""
        self._noted += items
        if self._pump is None or self._pump.done():
            self._pump = asyncio.create_task(self._flush_soon())

    async def flush(self) -> None:
        """Write everything noted so far. What could not be written stays noted."""
        await to_the_end(self._flush())

    async def _flush(self) -> None:
        async with self.writing:
            noted, self._noted = self._noted, []
            if not noted:
                return
            try:
                async with self._database.writing() as session:
                    committed = await self._store(noted, session)
            except BaseException:
                self._noted[:0] = noted
                raise
            committed()

    def abandon(self) -> None:
        """Forget what is left: the mission is another process's."""
        self._noted = []

    async def close(self) -> None:
        """Write what is left and stop."""
        if self._pump is not None:
            self._pump.cancel()
            await asyncio.gather(self._pump, return_exceptions=True)
        try:
            await self.flush()
        except Exception as error:
            self.storage.note(error)
            log.error(
                "what was heard last is lost, it could not be written",
                mission=self.mission_id,
                lost=dict(Counter(type(item).__name__ for item in self._noted)),
                why=self.storage.trouble,
            )

    async def _flush_soon(self) -> None:
        while self._noted:
            await asyncio.sleep(self._period_s)
            try:
                await self.storage.done(self.flush)
            except MissionElsewhereError:
                return  # nothing more is ours to write
            except Exception:
                log.exception("could not write to the database, trying again", mission=self.mission_id)
                await asyncio.sleep(RETRY_S)
