"""A mission's pings between the database and the grid that counts their beams."""

import asyncio
from collections import defaultdict
from collections.abc import Mapping

from app.mapping.swath.pings import Pings
from app.missions.live.journals.journal import Journal
from app.missions.maps.swath_grid import SwathGrid
from app.missions.pings.store import PingStore
from app.missions.soundings.corrections import Corrections
from app.storage.concurrency.uncancellable import to_the_end


class SwathIntake:
    """Takes committed pings into the grid; those that were stored before are read when the grid is first needed."""

    def __init__(self, grid: SwathGrid, store: PingStore, journal: Journal) -> None:
        self._grid, self._store, self._journal = grid, store, journal
        self._noted: defaultdict[str, list[Pings]] = defaultdict(list)
        self._begun = False
        self.behind = False
        """Whether pings were committed that the grid does not hold."""
        self._taking = asyncio.Lock()

    def add(self, pings: Mapping[str, Pings]) -> None:
        """Note committed pings, by their vehicle."""
        self.behind = True
        if self._begun:
            for vehicle, some in pings.items():
                self._noted[vehicle].append(some)

    @property
    def unread(self) -> bool:
        """Whether there may be stored pings that nobody has read yet."""
        return not self._begun

    async def complete(self) -> None:
        """Return when the grid holds all pings that were committed before."""
        async with self._taking:
            while not self._begun or self._noted:
                if not self._begun:
                    await self._read_all()
                    continue
                vehicle, some = self._noted.popitem()
                await self._take(vehicle, Pings.joined(some))
            self.behind = False

    async def _read_all(self) -> None:
        """Take in what is stored; what is committed meanwhile is noted."""
        async with self._journal.writing:
            until = await self._store.newest_block()
            self._begun = True
        self._grid.begin_anew()
        try:
            async for vehicle, pings in self._store.all_accepted(until):
                await self._take(vehicle, pings)
        except BaseException:
            self._forget()
            raise

    async def _take(self, vehicle: str, pings: Pings) -> None:
        # A thread goes on when nobody waits for it any more: what it adds is not to be counted twice.
        try:
            await to_the_end(asyncio.to_thread(self._grid.add, vehicle, pings))
        except Exception:
            self._forget()
            raise

    def _forget(self) -> None:
        """Read all again before the next map: some was not taken in, or is to be placed anew."""
        self._begun, self.behind = False, True
        self._noted.clear()

    def correct(self, corrections: Corrections) -> None:
        """Place all pings anew, by other corrections, before the next map."""
        self._grid.place = corrections.placing()
        self._forget()
