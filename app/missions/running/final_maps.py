"""Maps that are made while nobody waits for them: of missions that were taken up, and of those that just ended.

Of missions of a site, what they found of it as well.
"""

import asyncio
from collections.abc import Coroutine
from typing import Any

import structlog

from app.missions.live.mission import LiveMission
from app.missions.running.site_surveys import belongs_to_a_site, is_kept, keep_survey

log = structlog.get_logger(__name__)


class FinalMaps:
    """Makes maps beside everything else: no state changes and no vehicle waits for one."""

    def __init__(self) -> None:
        # Those of missions that were taken up come one at a time: a map that somebody asks for has a thread, too.
        self._one_at_a_time = asyncio.Lock()
        self._taken_up: dict[str, asyncio.Task[None]] = {}
        self._last: dict[str, asyncio.Task[None]] = {}
        self._surveys: dict[str, asyncio.Task[None]] = {}
        # Of those whose soundings changed since their survey was begun.
        self._wanted: set[str] = set()

    def busy(self, mission_id: str) -> bool:
        """Tell whether a map of this mission is on its way."""
        return mission_id in self._taken_up or mission_id in self._last

    def holds(self, mission_id: str) -> bool:
        """Tell whether a mission has to stay in memory until what is made of it is stored."""
        return self.busy(mission_id) or mission_id in self._surveys

    def survey(self, live: LiveMission) -> None:
        """Store what a mission that ended found of its site, unless that is stored already."""
        if not belongs_to_a_site(live):
            return
        self._wanted.add(live.id)
        task = self._surveys.get(live.id)
        if task is None or task.done():
            self._begin(self._surveys, live, self._survey(live))

    async def surveyed(self, mission_id: str) -> None:
        """Wait until what a mission found of its site is stored; at once when nothing is on its way."""
        while (task := self._surveys.get(mission_id)) is not None:
            await asyncio.wait([task])

    def take_up(self, live: LiveMission) -> None:
        """Make the map of what was stored."""
        if live.map.is_missing:
            self._begin(self._taken_up, live, self._map_stored(live))

    def map_last(self, live: LiveMission) -> None:
        """Make the map of a mission that has just ended, of everything until its vehicles stopped."""
        self._begin(self._last, live, _map_all(live))

    async def last(self, mission_id: str) -> None:
        """Wait for the last map of a mission that has just ended; at once when none is being made."""
        task = self._last.get(mission_id)
        if task is not None:
            await asyncio.wait([task])

    def forget(self, mission_id: str) -> None:
        """Make no map of a mission that is deleted."""
        for tasks in (self._taken_up, self._last, self._surveys):
            if mission_id in tasks:
                tasks[mission_id].cancel()

    async def close(self) -> None:
        """Make no more maps."""
        tasks = [*self._taken_up.values(), *self._last.values(), *self._surveys.values()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _map_stored(self, live: LiveMission) -> None:
        async with self._one_at_a_time:
            await live.map.build_stored()

    async def _survey(self, live: LiveMission) -> None:
        while live.id in self._wanted:
            self._wanted.discard(live.id)
            await self.last(live.id)
            async with self._one_at_a_time:
                if belongs_to_a_site(live) and not await is_kept(live):
                    await keep_survey(live)
                    await live.stored_soundings.keep(live.header.step, ended=True)

    def _begin(self, tasks: dict[str, asyncio.Task[None]], live: LiveMission, work: Coroutine[Any, Any, None]) -> None:
        def done(ended: asyncio.Task[None]) -> None:
            if tasks.get(live.id) is ended:
                del tasks[live.id]
            error = None if ended.cancelled() else ended.exception()
            if error is not None:
                log.error("the map is not made yet; it is when it is asked for", mission=live.id, exc_info=error)

        tasks[live.id] = task = asyncio.create_task(work, name=f"map of {live.id}")
        task.add_done_callback(done)


async def _map_all(live: LiveMission) -> None:
    await live.journal.flush()
    await live.pings.move()
    await live.map.build()
    live.publish_summary()
    if belongs_to_a_site(live):
        # Before the soundings leave memory.
        await keep_survey(live)
    await live.stored_soundings.keep(live.header.step, ended=True)
