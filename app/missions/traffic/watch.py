"""Hears AIS and keeps the ships that are about, at a pace that no flood of sentences can change."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import structlog

from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions.clock import now
from app.missions.settings import AisSettings
from app.missions.traffic.own_ship import OwnShip
from app.missions.traffic.sentences import SentenceError, SentenceReader, ShipPosition
from app.missions.traffic.ship_list import NEAR_M, Ship, ShipList
from app.missions.traffic.sources import FileSource, Source, TcpSource, UdpSource

TICK_S, MOST_PER_TICK = 0.05, 50
"""So many sentences are decoded so often: 1000 a second, ten times what both channels of AIS carry."""
MOST_WAITING = 2000
FORGET_S = 1.0
SILENCE_S = 60.0
"""Who heard nothing for so long hears nothing."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class SourceState:
    """How a source is; ``trouble`` empty: open. ``silent_s``: since its last sentence, None: none came yet."""

    name: str
    trouble: str
    sentences: int
    silent_s: float | None


class Traffic:
    """The ships about, as they are heard.

    Parameters
    ----------
    places
        Returns where missions are, latitude and longitude: ships near them come before others.

    Attributes
    ----------
    settings
        See :class:`AisSettings`; without a source nothing is heard.
    own_ship
        Where the receivers themselves are.
    malformed, dropped
        Sentences that could not be read, and those that came faster than they can be.
    """

    def __init__(self, settings: AisSettings, places: Callable[[], Sequence[tuple[float, float]]] = tuple) -> None:
        self.settings = settings
        self.ship_list = ShipList(settings.max_age_s)
        self.own_ship = OwnShip(settings.max_age_s)
        self.malformed = 0
        self.dropped = 0
        self._places = places
        self._reader = SentenceReader()
        self._waiting: deque[tuple[bytes, Source]] = deque()
        self._task: asyncio.Task[None] | None = None
        self._began_s: float | None = None
        self._epoch_s = 0.0
        self.sources: list[Source] = []
        if settings.udp_port is not None:
            self.sources.append(UdpSource(settings.udp_address, settings.udp_port, self._put))
        if settings.tcp_host:
            self.sources.append(TcpSource(settings.tcp_host, settings.tcp_port, self._put))
        if settings.file is not None:
            self.sources.append(FileSource(settings.file, self._put))

    @property
    def listens(self) -> bool:
        """Whether there is anything to hear ships by."""
        return bool(self.sources)

    @property
    def now_s(self) -> float:
        """The clock that ships' ``heard_s`` is by."""
        return asyncio.get_running_loop().time()

    async def start(self) -> None:
        """Begin to listen; what cannot be opened is tried again."""
        if not self.listens:
            return
        self._began_s = self.now_s
        self._epoch_s = now().timestamp() - self._began_s
        for source in self.sources:
            source.open()
        self._task = asyncio.create_task(self._keep())

    async def close(self) -> None:
        """Listen no more."""
        for source in self.sources:
            await source.close()
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    def ships(self) -> list[Ship]:
        """Return the ships that were heard lately, the nearest to a mission first."""
        return sorted(self.ship_list, key=lambda ship: (ship.distance_m, ship.position.mmsi))

    def near(self, lat_deg: float, lon_deg: float, within_m: float = NEAR_M) -> list[Ship]:
        """Return the ships within so far of a place."""
        here = lat_deg, lon_deg
        return [ship for ship in self.ships() if horizontal_distance_m(here, ship.position.lat_lon) <= within_m]

    def states(self) -> list[SourceState]:
        """Return how each source is."""
        return [
            SourceState(
                source.name,
                source.trouble,
                source.sentences,
                None if source.heard_s is None else self.now_s - source.heard_s,
            )
            for source in self.sources
        ]

    def utc_of(self, clock_s: float) -> datetime:
        """Return a time of the clock that ``heard_s`` is by as the wall clock had it, were it never set since."""
        return datetime.fromtimestamp(self._epoch_s + clock_s, UTC)

    @property
    def listened_s(self) -> float:
        """For how long it has listened."""
        return 0.0 if self._began_s is None else self.now_s - self._began_s

    @property
    def deaf(self) -> str:
        """Why no ship is heard by any source any more; empty as long as one may be, also where nothing listens."""
        why = []
        for state in self.states():
            silent_s = self.listened_s if state.silent_s is None else state.silent_s
            if silent_s < (SILENCE_S if state.trouble else self.settings.max_age_s):
                return ""
            why.append(f"{state.name}: {state.trouble or f'nothing for {silent_s:.0f} s'}")
        return "; ".join(why)

    def _put(self, line: bytes, source: Source) -> None:
        if len(self._waiting) >= MOST_WAITING:
            self.dropped += 1
        else:
            self._waiting.append((line, source))

    async def _keep(self) -> None:
        looked_s = self.now_s
        while True:
            await asyncio.sleep(TICK_S)
            try:
                self._take_some()
                if self.now_s - looked_s >= FORGET_S:
                    looked_s = self.now_s
                    self.ship_list.forget_silent(looked_s)
                    self.ship_list.watch_over(self._places())
            except Exception:
                log.exception("ships could not be told apart")

    def _take_some(self) -> None:
        for _ in range(min(len(self._waiting), MOST_PER_TICK)):
            line, source = self._waiting.popleft()
            try:
                if self.own_ship.read(line, source.name, self.now_s):
                    continue
                told = self._reader.read(line, source.name, self.now_s)
            except SentenceError:
                self.malformed += 1
                continue
            if told is None:
                continue
            source.sentences += 1
            source.heard_s = self.now_s
            for one in told:
                if isinstance(one, ShipPosition):
                    self.ship_list.place(one, self.now_s)
                    if one.own:
                        self.own_ship.place(one, source.name, self.now_s)
                else:
                    self.ship_list.describe(one)
