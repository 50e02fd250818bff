"""A mission's soundings and its stored map: shown at once, the soundings read when something is to be made of them."""

import asyncio
from typing import Any

import numpy as np
import structlog

from app.arrays import BoolArray, FloatArray
from app.mapping.types import SoundingRows
from app.missions.clock import now
from app.missions.live.journals.journal import Journal
from app.missions.maps.builder import BuiltMap, MapBuilder
from app.missions.maps.codec import pack, unpack
from app.missions.maps.queue import Replacement
from app.missions.maps.sounding_table import SoundingTable
from app.storage.bulk import read_numbers
from app.storage.concurrency.uncancellable import to_the_end
from app.storage.database import Database
from app.storage.queries import soundings as sounding_queries
from app.storage.queries import stored_maps
from app.storage.queries.stored_maps import Stored

WORTH_KEEPING = 20_000
"""While a mission runs its map is stored from so many soundings on: of fewer it is made anew in a moment."""

GROWTH = 1.2
"""It is stored again when the soundings grew by this factor: the map of five million is stored thirty times."""

TOO_MANY_TO_HOLD = 200_000
"""Where there are at least so many, soundings leave memory once the mission has ended and its last map is stored."""

log = structlog.get_logger(__name__)


class SoundingStore:
    """The soundings of one mission between the database and the builder of its map.

    The builder has all of them or, while they are at rest, none but those that came since.
    """

    def __init__(self, database: Database, mission_id: str, builder: MapBuilder, journal: Journal) -> None:
        self._database = database
        self._mission_id = mission_id
        self._builder = builder
        self._journal = journal
        self._reading: asyncio.Task[None] | None = None
        self._kept: BuiltMap | None = None
        self._shown: BuiltMap | None = None
        self._shown_step = 0
        self.imports_noticed = 0
        """The newest log line of an import whose soundings are counted."""

    async def show(self, stored: Stored, newest_import: int, *, imported: bool, ended: bool) -> None:
        """Begin with the stored map, if there is one; the soundings stay at rest when nothing is missing in it.

        ``newest_import``: the log's line of the newest import that is counted.
        ``imported``: the mission has soundings from elsewhere. The map of a mission that ``ended`` is a thorough one.
        """
        self.imports_noticed = newest_import
        row = stored.row
        if row is not None:
            try:
                built, doubted = await asyncio.to_thread(
                    unpack, row.content, row.digest, row.soundings, thorough=row.thorough
                )
            except ValueError as error:
                log.warning("the map is made anew", mission=self._mission_id, reason=str(error))
                row = None
            else:
                self._builder.show(built, doubted)
                self._shown, self._shown_step, self._kept = built, row.step, built
        whole = row is not None and row.soundings == stored.accepted and (row.thorough or not ended)
        if not whole and (stored.accepted or imported):
            self._builder.arrivals.expect()

    def step_of(self, built: BuiltMap, step: int) -> int:
        """Return the step that a map is of: a stored one is of its own, every other of the present one."""
        return self._shown_step if built is self._shown else step

    def changed(self, newest_import: int | None = None) -> None:
        """Read all soundings again before the next map: those in the database are not those in memory any more.

        ``newest_import``: the log's line of the newest import that is counted, if that changed.
        The caller holds the journal's ``writing``, or nothing was counted since the change was committed.
        """
        self.imports_noticed = newest_import if newest_import is not None else self.imports_noticed
        self._builder.arrivals.expect()

    async def complete(self) -> None:
        """Return when all soundings are in memory."""
        while self._builder.arrivals.at_rest:
            if self._reading is None or self._reading.done():
                self._reading = asyncio.create_task(self._read(), name=f"soundings of {self._mission_id}")
            # Whoever stops waiting does not end it for the others.
            await asyncio.shield(self._reading)

    async def _read(self) -> None:
        async with self._journal.writing:
            # All that is committed was counted, too: what comes from here on is not read below.
            coming = self._builder.arrivals.expect()
            async with self._database.reading() as session:
                newest = await stored_maps.newest_sounding(session, self._mission_id)
                prior = await sounding_queries.imported_arrays(session, self._mission_id)
        found = await accepted(self._database, self._mission_id, self._journal.counts.accepted, until_id=newest)
        self._builder.arrivals.arrived(coming, Replacement(found.table, prior, found.trusted))

    async def keep_when_grown(self, step: int) -> None:
        """Store the map of a mission that runs, unless it is small or was stored of almost as many soundings."""
        built, kept = self._builder.newest, self._kept.soundings if self._kept is not None else 0
        if built is not None and built.soundings >= max(WORTH_KEEPING, GROWTH * kept):
            await self.keep(step)

    async def keep(self, step: int, *, ended: bool = False) -> None:
        """Store the newest map, so that the mission can be opened without its soundings."""
        built = self._builder.newest
        if built is None or built is self._kept:
            return
        content = await asyncio.to_thread(pack, built.map, self._builder.doubted())
        async with self._journal.writing:
            if built is not self._builder.newest or not self._builder.is_current:
                return  # something else is the case by now
            await to_the_end(self._store(built, step, content))
        self._kept = built
        if ended and built.thorough and built.soundings >= TOO_MANY_TO_HOLD:
            self._builder.release()

    async def _store(self, built: BuiltMap, step: int, content: bytes) -> None:
        counts = self._journal.counts
        async with self._database.writing() as session:
            values: dict[str, Any] = {
                "mission_id": self._mission_id,
                "made_at": now(),
                "step": step,
                "last_sounding": await stored_maps.newest_sounding(session, self._mission_id),
                "last_import": self.imports_noticed,
                "accepted": counts.accepted,
                "rejected": counts.rejected,
                "soundings": built.soundings,
                "thorough": built.thorough,
                "digest": built.digest,
                "content": content,
            }
            await stored_maps.keep(session, values)

    async def close(self, step: int) -> None:
        """Read no more, and store the newest map."""
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)
        await self.keep(step)


async def accepted(
    database: Database, mission_id: str, expected: int, *, until_id: int | None = None, until_step: int | None = None
) -> "Rows":
    """Return the accepted soundings, about as many as ``expected``, in the order they came."""
    found = Rows(expected)
    query = sounding_queries.accepted_query(mission_id, until_id=until_id, until_step=until_step)
    await read_numbers(database, query, found.take)
    return found


class Rows:
    """Grows by pieces: east, north, depth, deviation, and whether an operator restored it."""

    def __init__(self, expected: int) -> None:
        self._table = SoundingTable(expected)
        self._trusted: list[BoolArray] = []

    def take(self, piece: FloatArray) -> None:
        """Take a piece in, (k, 5)."""
        self._table.extend(piece[:, :4])
        self._trusted.append(piece[:, 4] != 0)

    @property
    def table(self) -> SoundingRows:
        """The soundings, (n, 4)."""
        return self._table.rows

    @property
    def trusted(self) -> BoolArray:
        """Which of them were restored, (n,)."""
        return np.concatenate([np.zeros(0, dtype=bool), *self._trusted])
