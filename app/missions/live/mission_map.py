"""The map of a mission in memory: made when it is asked for, and shown with what was sounded since."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from app.arrays import FloatArray
from app.missions.live.header import MissionHeader
from app.missions.live.journals.journal import Journal
from app.missions.live.journals.swath_intake import SwathIntake
from app.missions.live.sounding_store import SoundingStore
from app.missions.live.watchers.feed import LiveFeed
from app.missions.maps.builder import BuiltMap, MapBuilder
from app.missions.maps.live_grid import map_of
from app.missions.maps.snapshot import NOT_MADE, MapSnapshot, MissionFacts
from app.missions.maps.tiles import TileCache
from app.missions.states import ENDED

Made = TypeVar("Made")


class MissionMap:
    """Makes and shows one mission's map.

    Parameters
    ----------
    builder, swath, soundings
        Make the map, of pings and soundings which they read when that is due.
    facts
        Returns what every product states.
    executor
        Returns whose threads maps are made in that no vehicle waits for.
    publish_summary
        Tells everyone who watches about the mission's progress.
    """

    def __init__(
        self,
        builder: MapBuilder,
        swath: SwathIntake,
        soundings: SoundingStore,
        journal: Journal,
        header: MissionHeader,
        feed: LiveFeed,
        facts: Callable[[], MissionFacts],
        executor: Callable[[], Executor],
        publish_summary: Callable[[], None],
    ) -> None:
        self._builder = builder
        self._swath = swath
        self._soundings = soundings
        self._journal = journal
        self._header = header
        self._feed = feed
        self._facts = facts
        self._executor = executor
        self._publish_summary = publish_summary
        self._revision = 0
        """Counts changes of what the map is shown with."""
        self.reference_m: FloatArray | None = None
        """Depths of the grid that the map is compared with, at its cells; None: it is compared with nothing."""
        self.tiles = TileCache()

    async def build(self) -> BuiltMap | None:
        """Make the map of everything accepted so far as thoroughly as for a product, in a worker thread."""
        await self._soundings.complete()
        await self._swath.complete()
        before = self._builder.newest
        built = await self.make(partial(self._builder.build, thorough=True))
        if built is not None and built is not before:
            self.publish(built)
            self._publish_summary()
        return built

    async def build_stored(self) -> None:
        """Make the map of a mission that was just taken up, and tell everyone who watches how far it has come."""
        if self.is_missing:
            await self.build()
            await self._soundings.keep(self._header.step, ended=self._header.state in ENDED)

    async def make(self, work: Callable[..., Made], *arguments: Any) -> Made:
        """Have the builder make a map in a worker thread that no vehicle waits for."""
        return await asyncio.get_running_loop().run_in_executor(self._executor(), work, *arguments)

    @property
    def is_missing(self) -> bool:
        """Whether something was measured that is in no map yet."""
        unmapped = self._builder.newest is None and self._journal.counts.pings > 0
        return self._builder.stale or self._swath.behind or (unmapped and self._swath.unread)

    def publish(self, built: BuiltMap) -> None:
        """Tell everyone who watches that there is a new map."""
        self._feed.of_map(built, self._header.step)

    def show_reference(self, depths_m: FloatArray | None) -> None:
        """Compare the map with these depths at its cells, or with nothing."""
        self.reference_m = depths_m
        self.shown_otherwise()

    def shown_otherwise(self) -> None:
        """Note that what the map is shown with has changed: whoever has it asks for it again."""
        self._revision += 1

    def snapshot(self, built: BuiltMap) -> MapSnapshot:
        """Return a map with what is needed to understand it."""
        step = self._soundings.step_of(built, self._header.step)
        live = self._builder.live
        return MapSnapshot(self._facts(), built, step, self.reference_m, self._revision, interpolation=live)

    def snapshot_at(self, built: BuiltMap, step: int) -> MapSnapshot:
        """Return a map of what was measured until a step's end, with what is needed to understand it."""
        return MapSnapshot(self._facts(), built, step, self.reference_m, self._revision)

    def live_snapshot(self) -> MapSnapshot | None:
        """Return the newest map with what was sounded since; None before the first sounding. For a worker thread."""
        live = None if self._builder.live is None else self._builder.live.fresh()
        built = self._builder.newest
        if built is not None:
            return replace(self.snapshot(built), live=live)
        if live is None:
            return None
        # No map was made yet: there is nothing but what was just sounded.
        first = BuiltMap(NOT_MADE, int(live.count.sum()), map_of(self._builder.grid, live), "")
        return MapSnapshot(self._facts(), first, self._header.step, self.reference_m, self._revision, live)
