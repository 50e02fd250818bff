"""A waypoint under way: where its vehicle is sent, and when it has arrived.

DUNE flies straight to a reference only until some 7 m before it, then circles; one closer than 15 m it circles at once,
and at the surface it drifts there with its motor off. So a waypoint is passed on the way to a point beyond it where
there is room for that, and otherwise circled as closely as the vehicle can.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from imc_bridge.control.references import SentReference
from imc_bridge.distances import Place, distance_m, offset_m
from imc_bridge.events import StateReport, Waypoint, WaypointStatus

STATE_LOITER = 3
STATE_HOVER = 4
CIRCLING_DWELL_S = 6.0
"""The closest approach comes within 5 s after DUNE has begun to circle."""
CIRCLING_MARGIN_M = 2.5
NEAR_TOLERANCE_M = 15.0
"""DUNE's own tolerance around a reference of radius 0."""
FLOWN_STRAIGHT_M = NEAR_TOLERANCE_M + 2.0
"""A reference farther away than this is flown to straight."""
CLOSE_RADIUS_M = 2.0
"""Radius asked for around a reference that DUNE circles at once: tighter than it can fly, so it comes close."""
PASSED_WITHIN_M = 8.0
"""A vehicle that passes its waypoint at most this far to the side has arrived; farther off it is sent back."""


@dataclass(slots=True)
class Order:
    """The current waypoint and how far it has come."""

    waypoint: Waypoint
    status: WaypointStatus | None = None
    limited: str = ""
    """Why its depth is less than was asked for."""
    circling_since: float | None = None
    """Since when the vehicle has been circling or hovering at this waypoint by its own account."""
    circling_limit_m: float = 0.0
    start: Place | None = None
    """Where the vehicle was when the order came."""
    leading: bool = False
    """Whether it is sent to the waypoint's lead, to pass the waypoint on the way."""
    radius_m: float = 0.0
    unseen: bool = False
    """Whether the vehicle went on to it where no radio reached."""
    sent: deque[SentReference] = field(default_factory=lambda: deque(maxlen=8))

    @classmethod
    def made(cls, waypoint: Waypoint, report: StateReport | None) -> Order:
        """Choose how the vehicle gets there: past it, where there is room for that, else close round it."""
        order = cls(waypoint)
        if report is None:
            return order
        order.start = (report.lat_deg, report.lon_deg)
        lead = order.lead
        order.leading = (
            lead is not None
            and distance_m(order.start, lead) > FLOWN_STRAIGHT_M
            and _ahead(order.start, order.place, lead)
        )
        if not order.leading and distance_m(order.start, order.place) <= FLOWN_STRAIGHT_M:
            order.radius_m = CLOSE_RADIUS_M
        return order

    @property
    def place(self) -> Place:
        """The waypoint."""
        return self.waypoint.lat_deg, self.waypoint.lon_deg

    @property
    def lead(self) -> Place | None:
        """The point beyond it, where it has one."""
        waypoint = self.waypoint
        if waypoint.lead_lat_deg is None or waypoint.lead_lon_deg is None:
            return None
        return waypoint.lead_lat_deg, waypoint.lead_lon_deg

    @property
    def way(self) -> list[Place]:
        """Where the vehicle flies from where it is: the waypoint, then the lead where it is sent there."""
        return [self.place, self.lead] if self.leading and self.lead is not None else [self.place]

    def note_circling(self, state: int, loiter_radius_m: float, now: float) -> None:
        """Note what the vehicle does there by its own account (FollowRefState.state)."""
        if state == STATE_HOVER:
            self.circling_limit_m = NEAR_TOLERANCE_M
        elif state == STATE_LOITER:
            self.circling_limit_m = loiter_radius_m + CIRCLING_MARGIN_M
        else:
            self.circling_since = None
            return
        if self.circling_since is None:
            self.circling_since = now

    def arrival(self, report: StateReport, depth_tolerance_m: float, now: float) -> str | None:
        """Whether a vehicle that is there has arrived: None while not, else in which way ('' for plainly).

        A vehicle that has been circling for a while does not come closer: it has arrived, and the words say how near.
        """
        distance = distance_m((report.lat_deg, report.lon_deg), self.place)
        radius_m = self.waypoint.arrival_radius_m
        if self.unseen and distance <= max(radius_m, NEAR_TOLERANCE_M):
            return f"came up {distance:.0f} m from it after it was out of reach under water"
        if not self._deep_enough(report, depth_tolerance_m):
            return None
        if distance <= radius_m:
            return ""
        if self.leading:
            return f"passed at {distance:.0f} m" if distance <= PASSED_WITHIN_M and self._passed(report) else None
        circled = self.circling_since is not None and now - self.circling_since >= CIRCLING_DWELL_S
        if circled and distance <= self.circling_limit_m:
            return f"as near as the vehicle comes: circles {distance:.0f} m from it"
        return None

    def missed(self, report: StateReport, depth_tolerance_m: float) -> bool:
        """Whether a vehicle that has not arrived has passed by too far to the side."""
        return self.leading and self._deep_enough(report, depth_tolerance_m) and self._passed(report)

    def _deep_enough(self, report: StateReport, tolerance_m: float) -> bool:
        return abs(report.depth_m - self.sent[-1].depth_m) <= tolerance_m

    def _passed(self, report: StateReport) -> bool:
        """Whether the vehicle is beyond the waypoint, as seen from where the order came."""
        if self.start is None:
            return False
        leg_north, leg_east = offset_m(self.start, self.place)
        north, east = offset_m(self.place, (report.lat_deg, report.lon_deg))
        return north * leg_north + east * leg_east >= 0.0

    def turn_back(self, report: StateReport) -> None:
        """Send the vehicle, which has passed too far to the side, to the waypoint itself."""
        self.leading = False
        distance = distance_m((report.lat_deg, report.lon_deg), self.place)
        self.radius_m = CLOSE_RADIUS_M if distance <= FLOWN_STRAIGHT_M else 0.0


def _ahead(start: Place, place: Place, beyond: Place) -> bool:
    """Whether who goes from a start to what lies beyond a place passes the place on the way.

    One that was led aside, and sent on, may be past it already.
    """
    to_north, to_east = offset_m(start, place)
    on_north, on_east = offset_m(place, beyond)
    return to_north * on_north + to_east * on_east > 0.0
