"""What links have in common whose vehicles come to us: their states and waypoints as events, and who fell silent."""

import asyncio
from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

from app.missions.fleet.interface import (
    EventSink,
    FleetLink,
    LinkReport,
    LinkState,
    VehicleReport,
    WaypointOrder,
    WaypointReport,
    WaypointStatus,
)

LOOKS = 10
"""How often is looked for silent vehicles in the time after which one is lost."""


@dataclass
class Visitor:
    """A vehicle that comes to us."""

    name: str
    state: LinkState
    report: VehicleReport | None = None
    order: WaypointOrder | None = None
    status: WaypointStatus | None = None


class VisitedLink(FleetLink):
    """Keeps the visitors' states and tells of every change.

    Parameters
    ----------
    lost_after_s
        Silence on the wall clock after which a vehicle is lost.
    """

    def __init__(self, lost_after_s: float) -> None:
        self._lost_after_s = lost_after_s
        self._sink: EventSink = lambda _event: None
        self._watch: asyncio.Task[None] | None = None

    @abstractmethod
    def _reason(self, state: LinkState) -> str:
        """Say why a vehicle is in a state, '' where that goes without saying."""

    @abstractmethod
    def _silent(self) -> Iterable[Visitor]:
        """Return the vehicles that have been silent for too long."""

    def _begin(self, sink: EventSink) -> None:
        self._sink = sink
        self._watch = asyncio.create_task(self._watch_silence())

    async def _end(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)

    def _set_state(self, visitor: Visitor, state: LinkState) -> None:
        if visitor.state is not state:
            visitor.state = state
            self._sink(LinkReport(visitor.name, state, self._reason(state)))

    def _report(self, visitor: Visitor, status: WaypointStatus) -> None:
        visitor.status = status
        if visitor.order is not None:
            order = visitor.order
            self._sink(WaypointReport(visitor.name, order.mission_id, order.step, status))

    async def _watch_silence(self) -> None:
        while True:
            await asyncio.sleep(self._lost_after_s / LOOKS)
            for visitor in self._silent():
                self._set_state(visitor, LinkState.LOST)
