"""What a mission has to write is written, if need be once the database is well again; meanwhile everyone is told."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

import structlog

from app.storage.db_errors import trouble_of

RETRY_S = 1.0

log = structlog.get_logger(__name__)

T = TypeVar("T")


class DatabaseRetry:
    """Tries again for as long as the database cannot be used.

    Parameters
    ----------
    tell
        Called when a trouble begins or ends.
    begun
        Called with what it is when one begins.
    over
        Called with words for the mission's log when one has ended.

    Attributes
    ----------
    trouble
        What keeps the database from being used and what to do about it; empty when nothing does.
    """

    def __init__(
        self,
        mission_id: str,
        tell: Callable[[], None],
        begun: Callable[[str], None],
        over: Callable[[str], None],
    ) -> None:
        self.trouble = ""
        self._mission_id = mission_id
        self._tell = tell
        self._begun = begun
        self._over = over
        self._since_s = 0.0

    async def done(self, work: Callable[[], Awaitable[T]]) -> T:
        """Do ``work`` again and again until no trouble keeps it from being done. Raises every other error of it."""
        while True:
            try:
                result = await work()
            except Exception as error:
                self.note(error)
            else:
                self.ended()
                return result
            await asyncio.sleep(RETRY_S)

    def note(self, error: Exception) -> None:
        """Remember a trouble; an error that is none is raised."""
        trouble = trouble_of(error)
        if not trouble:
            raise error
        if not self.trouble:
            self._since_s = asyncio.get_running_loop().time()
            self._begun(trouble)
        if trouble != self.trouble:
            log.error("the database cannot be used, trying again", mission=self._mission_id, why=trouble)
            self.trouble = trouble
            self._tell()

    def ended(self) -> None:
        """Note that something could be written."""
        if not self.trouble:
            return
        trouble, self.trouble = self.trouble, ""
        took_s = asyncio.get_running_loop().time() - self._since_s
        log.info("the database can be used again", mission=self._mission_id, after_s=round(took_s, 1))
        self._over(f"for {took_s:.0f} s nothing could be written down ({trouble}); what came meanwhile was kept")
        self._tell()
