"""Tells everyone who watches a mission what is new, at a pace that a crowd of viewers can be served with."""

import asyncio
import time
from collections.abc import Callable

import numpy as np

from app.missions.clock import now
from app.missions.live.watchers.broadcast import Broadcaster
from app.missions.maps.builder import BuiltMap
from app.missions.views.messages import MapMessage, TargetsMessage, VehiclesMessage
from app.missions.views.search import SearchMessage, SearchProgress
from app.missions.views.targets import TargetView
from app.missions.views.traffic import TrafficMessage

LIVE_PERIOD_S = 0.2
CROWD, MOST_PERIODS = 20, 5
"""For so many viewers more the period grows by itself once, so many times at most."""
LIVE_MAP_S = 0.3
"""Least time between two times that what was just sounded is told of."""
SHIPS_S = 1.0
"""Time between two pictures of the ships about."""
CROWD_MAP_S = 4.0
"""Least time between two maps that a crowd is told of."""


class LiveFeed:
    """Publishes vehicles and targets at a steady rate while anyone watches, maps and searches when they changed.

    Parameters
    ----------
    vehicles, targets, search, traffic
        Return how these are now. ``targets``: None for a mission without; ``search`` returns None in a survey,
        ``traffic`` where nothing listens for ships.
    """

    def __init__(
        self,
        broadcaster: Broadcaster,
        vehicles: Callable[[], VehiclesMessage],
        targets: Callable[[], list[TargetView]] | None,
        search: Callable[[], SearchProgress | None],
        traffic: Callable[[], TrafficMessage | None] = lambda: None,
    ) -> None:
        self._broadcaster = broadcaster
        self._vehicles = vehicles
        self._targets = targets
        self._search = search
        self._traffic = traffic
        self._ships_told_s = -np.inf
        self._ticker: asyncio.Task[None] | None = None
        self._map = MapMessage(version=0, step=0, min_depth_m=None, max_depth_m=None)
        self._map_is_news = self._soundings_are_news = False
        self._map_told_s = -np.inf
        self._search_told = 0

    def start(self) -> None:
        """Begin to tell, if nobody watched until now."""
        if self._ticker is None or self._ticker.done():
            self._ticker = asyncio.create_task(self._tick())

    def stop(self) -> None:
        """Tell nothing at a steady rate any more."""
        if self._ticker is not None:
            self._ticker.cancel()

    async def close(self) -> None:
        """Stop, and wait until that is done."""
        self.stop()
        if self._ticker is not None:
            await asyncio.gather(self._ticker, return_exceptions=True)

    def of_map(self, built: BuiltMap, step: int) -> None:
        """Tell that there is a new map, made in this step."""
        depth = built.map.depth_m[np.isfinite(built.map.depth_m)]
        self._map = MapMessage(
            version=built.version,
            live=self._map.live,
            step=step,
            min_depth_m=float(depth.min()) if depth.size else None,
            max_depth_m=float(depth.max()) if depth.size else None,
        )
        self._map_is_news = True
        self._tell_of_map()

    def of_soundings(self, count: int, step: int) -> None:
        """Tell soon that so many soundings came in this step."""
        self._map = self._map.model_copy(update={"live": self._map.live + count, "step": step})
        self._soundings_are_news = True

    def of_changes(self, step: int) -> None:
        """Tell soon that what is stored counts in another way than before: it makes another map."""
        self.of_soundings(1, step)

    async def _tick(self) -> None:
        while self._broadcaster.watched:
            self._broadcaster.publish(self._vehicles())
            if self._targets is not None:
                self._broadcaster.publish(TargetsMessage(time=now(), targets=self._targets()))
            self._tell_of_search()
            self._tell_of_ships()
            self._tell_of_map()
            await asyncio.sleep(live_period_s(self._broadcaster.viewers))

    def _tell_of_map(self) -> None:
        """Publish what is new of the map; to a crowd, who would all fetch it, not before it is time again."""
        crowd = self._broadcaster.viewers >= CROWD
        wait_s = CROWD_MAP_S if crowd else 0.0 if self._map_is_news else LIVE_MAP_S
        news = self._map_is_news or self._soundings_are_news
        if news and time.monotonic() - self._map_told_s >= wait_s:
            self._broadcaster.publish(self._map)
            self._map_is_news = self._soundings_are_news = False
            self._map_told_s = time.monotonic()

    def _tell_of_ships(self) -> None:
        """Publish the ships about; they are slow, so that this is seldom."""
        if time.monotonic() - self._ships_told_s >= SHIPS_S:
            self._ships_told_s = time.monotonic()
            message = self._traffic()
            if message is not None:
                self._broadcaster.publish(message)

    def _tell_of_search(self) -> None:
        """Publish how a search stands when a scan changed that."""
        found = self._search()
        if found is not None and found.version != self._search_told:
            self._search_told = found.version
            self._broadcaster.publish(SearchMessage(search=found))


def live_period_s(viewers: int) -> float:
    """Return how often positions are sent: a crowd of viewers sees them less often, so that it costs hardly more."""
    return LIVE_PERIOD_S * min(MOST_PERIODS, 1.0 + viewers // CROWD)
