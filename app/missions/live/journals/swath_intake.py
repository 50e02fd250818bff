"""A mission's pings between the database and the grid that counts their beams."""

import asyncio
from collections import defaultdict
from collections.abc import Mapping

from app.mapping.swath.pings import Pings
from app.missions.live.journals.journal import Journal
from app.missions.maps.swath_grid import SwathGrid
from app.missions.pings.store import PingStore
from app.missions.soundings.corrections import Corrections


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
            if not self._begun:
                async with self._journal.writing:
                    # What is committed from here on is noted.
                    until = await self._store.newest_block()
                    self._begun, self.behind = True, False
                self._grid.begin_anew()
                try:
                    async for vehicle, pings in self._store.all_accepted(until):
                        await asyncio.to_thread(self._grid.add, vehicle, pings)
                except BaseException:
                    self._begun, self.behind = False, True
                    self._noted.clear()
                    raise
            noted, self._noted = self._noted, defaultdict(list)
            self.behind = False
            for vehicle, some in noted.items():
                await asyncio.to_thread(self._grid.add, vehicle, Pings.joined(some))

    def correct(self, corrections: Corrections) -> None:
        """Place all pings anew, by other corrections, before the next map."""
        self._grid.place = corrections.beams
        self._begun = False
        self._noted.clear()
