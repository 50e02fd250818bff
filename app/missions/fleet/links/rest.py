"""Vehicles that poll: they post their positions and soundings and fetch their waypoints over HTTP.

A vehicle acknowledges a waypoint by fetching it and a stop by being told so; arrival is judged by the positions that it
posts. Nothing is sent to it of our own accord, so it counts as lost when it has been silent for ``lost_after_s``. One
that asks on without telling where it is may be under water, or tell only where it arrives: it has the time for its leg.
"""

import asyncio
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Self

from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions.clock import now
from app.missions.fleet.interface import (
    EventSink,
    LinkCapabilities,
    LinkState,
    StopReceipt,
    VehicleInfo,
    VehicleRefusedError,
    VehicleReport,
    WaypointOrder,
    WaypointStatus,
)
from app.missions.fleet.links.visiting import VisitedLink, Visitor
from imc_bridge.control.plans import leg_time_s
from imc_bridge.nodes.plausibility import CONFIRMATIONS, PlausiblePlace, PositionVerdict, moved_m, reach_m
from imc_bridge.telemetry.soundings import StateSample

KEPT_S = 86_400.0
"""For how long vehicles may keep positions before they post them, at the most: older ones tell of another clock."""

AHEAD_S = 5.0
"""A report whose time is farther ahead than this, both of our clock and of its vehicle's own, has a wrong time."""


@dataclass
class _Poller(Visitor):
    heard_s: float = 0.0
    placed_s: float | None = None
    """When it last told where it is, the event loop's time."""
    doubtful_since_s: float | None = None
    """Since when it has told only of places where it cannot be, the event loop's time; None: it has not."""
    unplaced_since_s: float | None = None
    """Since when it has a waypoint to go to and asks on without telling where it is, the event loop's time."""
    unplaced_order: WaypointOrder | None = None
    """The newest of the waypoints that it has got since then."""
    unplaced_way_m: float = 0.0
    """How far it is from where it told to be last over all of these, one after the other."""
    newest_s: float = -math.inf
    """The newest time by its clock: what is older was kept until now."""
    newest_heard_s: float = 0.0
    """When that came, the event loop's time."""
    ahead_since_s: float | None = None
    """Since when its times have been too far ahead, the event loop's time; None: they are not."""
    stopping: bool = False
    told: asyncio.Event = field(default_factory=asyncio.Event)

    def owes_no_place(self) -> None:
        """Begin to wait for a place anew."""
        self.unplaced_since_s = self.unplaced_order = None

    def latest_s(self, now_s: float, time_scale: float) -> float:
        """Return the latest time that its clock can tell, at the event loop's time ``now_s``."""
        own_s = self.newest_s + time_scale * (now_s - self.newest_heard_s)
        return max(own_s, now().timestamp()) + AHEAD_S


class RestFleetLink(VisitedLink):
    """The fleet interface for vehicles that poll.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    kind = "rest"
    capabilities = LinkCapabilities(stays_put=True)

    def __init__(self, time_scale: float = 1.0, *, lost_after_s: float = 30.0) -> None:
        super().__init__(lost_after_s)
        self._time_scale = time_scale
        self._pollers: dict[str, _Poller] = {}
        self._places: dict[str, PlausiblePlace] = {}
        """Where vehicles can be, by where they were."""

    @property
    def polled_vehicles(self) -> Self:
        """The link itself, which is called as requests come in."""
        return self

    async def start(self, sink: EventSink) -> None:
        """Begin; events go to ``sink``."""
        self._begin(sink)

    async def close(self) -> None:
        """Stop every engaged vehicle, then end."""
        engaged = [p.name for p in self._pollers.values() if p.state is LinkState.ENGAGED]
        await asyncio.gather(*(self.stop(name, timeout_s=1.0) for name in engaged))
        await self._end()

    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle that was heard of since the service started."""
        now_s = asyncio.get_running_loop().time()
        return [
            VehicleInfo(
                name=p.name,
                kind=self.kind,
                state=p.state,
                reason=self._reason(p.state),
                age_s=now_s - p.heard_s,
                position_age_s=None if p.placed_s is None else now_s - p.placed_s,
                without_position=self._without_position(p),
                report=p.report,
            )
            for p in self._pollers.values()
        ]

    def _without_position(self, poller: _Poller) -> bool:
        if poller.doubtful_since_s is not None and poller.heard_s - poller.doubtful_since_s > self._lost_after_s:
            return True
        order = poller.unplaced_order
        if poller.order is None or order is None or poller.unplaced_since_s is None:
            return False
        way_s = leg_time_s(poller.unplaced_way_m, order.position.depth_m, order.speed_mps) / self._time_scale
        return poller.heard_s - poller.unplaced_since_s > self._lost_after_s + way_s

    async def engage(self, vehicle: str) -> None:
        """Let a vehicle follow. Raises VehicleRefusedError when it was never heard or is silent."""
        poller = self._pollers.get(vehicle)
        if poller is None:
            raise VehicleRefusedError(
                vehicle,
                "not heard since the service was started",
                "let it post its position: POST /api/v1/missions/{id}/measurements",
            )
        if poller.state is LinkState.LOST:
            raise VehicleRefusedError(vehicle, self._reason(poller.state), "check its connection; it must poll again")
        poller.stopping = False
        self._set_state(poller, LinkState.ENGAGED)

    async def order(self, order: WaypointOrder) -> None:
        """Lay a waypoint out for the vehicle to fetch."""
        poller = self._pollers.get(order.vehicle)
        if poller is None or poller.state is not LinkState.ENGAGED:
            raise VehicleRefusedError(order.vehicle, "does not follow this service now", "it must poll again")
        if poller.order == order and poller.status is not None:
            self._report(poller, poller.status)
            return
        poller.order = order
        poller.status = None
        self._report(poller, WaypointStatus.SENT)

    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Withdraw the waypoint; acknowledged when the vehicle polled and was told."""
        poller = self._pollers.get(vehicle)
        follows = poller is not None and poller.state in (LinkState.ENGAGED, LinkState.LOST)
        if poller is None or not (follows or poller.stopping):
            return StopReceipt(vehicle, acknowledged=True, detail="was not following")
        poller.order = None
        poller.status = None
        poller.stopping = True
        poller.told.clear()
        if poller.state is LinkState.ENGAGED:
            self._set_state(poller, LinkState.READY)
        try:
            await asyncio.wait_for(poller.told.wait(), timeout_s)
        except TimeoutError:
            return StopReceipt(vehicle, acknowledged=False, detail="has not polled since; it is told at its next poll")
        return StopReceipt(vehicle, acknowledged=True, detail="told at its poll")

    def doubt(self, report: VehicleReport) -> str:
        """Return why a vehicle cannot be where it says, by where it was; '' where it can.

        Asked once of every position, in the order of their times. One far away is believed when others agree.
        """
        places = self._places.setdefault(report.vehicle, PlausiblePlace())
        sample = self._sample(report)
        if places.take(sample) is not PositionVerdict.DOUBTFUL or (last := places.last) is None:
            return ""
        poller = self._touch(report.vehicle)
        if poller.doubtful_since_s is None:
            poller.doubtful_since_s = poller.heard_s
        passed_s = abs(sample.time_s - last.time_s) / self._time_scale
        away_m, most_m = moved_m(last, sample), reach_m(last, sample)
        return (
            f"lat_deg, lon_deg, depth_m: {away_m:.0f} m from where it was {passed_s:.1f} s before; "
            f"at most {most_m:.0f} m can be; believed once {CONFIRMATIONS} positions in a row agree"
        )

    def _sample(self, report: VehicleReport) -> StateSample:
        place, time_s = report.position, report.time_s
        lat_rad, lon_rad = math.radians(place.lat_deg), math.radians(place.lon_deg)
        poller = self._pollers.get(report.vehicle)
        if poller is not None and math.isfinite(poller.newest_s):
            # Nobody comes farther by a time that is ahead.
            time_s = min(time_s, poller.latest_s(asyncio.get_running_loop().time(), self._time_scale))
        # Clocks that keep to the wall's tell little of how far one comes that lives faster.
        return StateSample(self._time_scale * time_s, lat_rad, lon_rad, place.depth_m, 0.0, 0.0, 0.0)

    def heard(self, report: VehicleReport) -> None:
        """Take a position that a vehicle posted, unless a newer one is known: it may post what it kept under water.

        One whose clock was set back is believed after ``lost_after_s``, and at once where that was by a day or more.
        What comes after a time that is ahead is not older for that, unless times have been ahead for as long.
        """
        poller = self._touch(report.vehicle)
        now_s = asyncio.get_running_loop().time()
        poller.doubtful_since_s = None
        poller.owes_no_place()
        older_s = poller.newest_s - report.time_s
        if 0.0 < older_s < KEPT_S and now_s - poller.newest_heard_s < self._lost_after_s:
            return
        is_ahead = report.time_s > poller.latest_s(now_s, self._time_scale)
        if is_ahead or older_s > 0.0:
            # Its clock was set: nothing tells how far it can have come.
            self._places.pop(report.vehicle, None)
        if not is_ahead:
            poller.ahead_since_s = None
        elif poller.ahead_since_s is None:
            poller.ahead_since_s = now_s
        if poller.ahead_since_s is None or now_s - poller.ahead_since_s >= self._lost_after_s:
            poller.newest_s, poller.newest_heard_s = report.time_s, now_s
        poller.report, poller.placed_s = report, now_s
        self._sink(report)
        self._check_arrival(poller)

    def has_waypoint(self, vehicle: str, step: int) -> None:
        """Note that a vehicle has the waypoint of ``step``: it fetched it now, or says that it did before."""
        poller = self._touch(vehicle)
        if poller.order is not None and poller.order.step <= step and poller.status is WaypointStatus.SENT:
            self._report(poller, WaypointStatus.ACKNOWLEDGED)
            self._check_arrival(poller)
        self._count_unplaced(poller)

    def _count_unplaced(self, poller: _Poller) -> None:
        """Note that a vehicle has its waypoint: it owes a place once it can have gone there."""
        order, report = poller.order, poller.report
        if order is None or report is None or order == poller.unplaced_order:
            return
        if poller.status in (WaypointStatus.SENT, WaypointStatus.REACHED) or self._without_position(poller):
            return
        before = poller.unplaced_order
        if before is None:
            poller.unplaced_since_s, poller.unplaced_way_m = poller.heard_s, 0.0
        begins = report.position if before is None else before.position
        poller.unplaced_way_m += horizontal_distance_m(begins.lat_lon, order.position.lat_lon)
        poller.unplaced_order = order

    def _check_arrival(self, poller: _Poller) -> None:
        order, report = poller.order, poller.report
        if order is None or report is None or poller.status is not WaypointStatus.ACKNOWLEDGED:
            return
        if horizontal_distance_m(report.position.lat_lon, order.position.lat_lon) <= order.arrival_radius_m:
            self._report(poller, WaypointStatus.REACHED)

    def told_to_wait(self, vehicle: str) -> None:
        """Note that a vehicle was told to hold for now: it need not tell again and again where."""
        self._touch(vehicle).owes_no_place()

    def told_to_stop(self, vehicle: str, mission_id: str) -> None:
        """Note that a vehicle was told to stop, which acknowledges the stop, also one that is yet to come."""
        if vehicle not in self._pollers:
            return
        poller = self._touch(vehicle)
        poller.stopping = False
        poller.owes_no_place()
        poller.told.set()
        if poller.order is not None and poller.order.mission_id == mission_id:
            poller.order = None
            poller.status = None
            self._set_state(poller, LinkState.READY)

    def _touch(self, vehicle: str) -> _Poller:
        now_s = asyncio.get_running_loop().time()
        poller = self._pollers.get(vehicle)
        if poller is None:
            poller = self._pollers[vehicle] = _Poller(vehicle, LinkState.UNKNOWN)
        poller.heard_s = now_s
        if poller.state in (LinkState.UNKNOWN, LinkState.LOST):
            poller.owes_no_place()  # what it could not tell while it was not heard
            self._set_state(poller, LinkState.READY)
        return poller

    def _reason(self, state: LinkState) -> str:
        return f"silent for more than {self._lost_after_s:g} s" if state is LinkState.LOST else ""

    def _silent(self) -> Iterable[Visitor]:
        limit_s = asyncio.get_running_loop().time() - self._lost_after_s
        return [poller for poller in self._pollers.values() if poller.heard_s < limit_s]
