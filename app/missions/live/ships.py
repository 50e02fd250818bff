"""The ships about a mission, and how close they come to its vehicles."""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.clock import now
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member, Team
from app.missions.traffic.approach import TimedWay, closest_approach, planned_way
from app.missions.traffic.ship_list import Ship
from app.missions.traffic.watch import Traffic
from app.missions.views.traffic import ApproachView, ShipView, TrafficMessage, own_ship_view, ship_view

SHOWN_S = 1800.0
"""How far ahead approaches are shown; alarms have a time of their own."""
MOST_SHOWN = 300
DRAUGHT_MARGIN_M, DEPTH_STEP_M, DEEPEST_M = 2.0, 5.0, 30.0
"""Vehicles are this much below a ship's draught; the depth is rounded up, and nothing draws more than the last."""
RELEASE = 1.25
"""An alarm is over once the ship stays this many times farther away, within so many times the time."""


@dataclass(frozen=True, slots=True)
class Encounter:
    """A ship that comes close to a vehicle."""

    ship: Ship
    distance_m: float
    in_s: float

    @property
    def words(self) -> str:
        """What the operator reads."""
        told = self.ship.particulars
        name = told.name or f"MMSI {self.ship.position.mmsi}"
        kind = f" ({told.type})" if told.type else ""
        when = "now" if self.in_s < 1.0 else f"in {self.in_s:.0f} s"
        return f"the ship {name}{kind} comes to {self.distance_m:.0f} m {when}"


class ShipsAbout:
    """What a mission knows of ships.

    Parameters
    ----------
    traffic
        What is heard; None: nothing listens.
    """

    def __init__(
        self, mission_id: str, spec: Callable[[], MissionSpec], frame: LocalFrame, team: Team, time_scale: float
    ) -> None:
        self.traffic: Traffic | None = None
        self._mission_id = mission_id
        self._spec = spec
        self._frame = frame
        self._team = team
        self._time_scale = time_scale

    @property
    def listens(self) -> bool:
        """Whether there is anything to hear ships by."""
        return self.traffic is not None and self.traffic.listens

    def message(self) -> TrafficMessage | None:
        """Return what those who watch the mission are shown of ships; None where nothing listens for any."""
        if self.traffic is None or not self.traffic.listens:
            return None
        return TrafficMessage(time=now(), ships=self.views(), own_ship=own_ship_view(self.traffic))

    def views(self) -> list[ShipView]:
        """Return the ships near the mission, the nearest first, each with the vehicle that it comes closest to."""
        if self.traffic is None:
            return []
        ships = self.traffic.near(self._frame.origin_lat_deg, self._frame.origin_lon_deg)[:MOST_SHOWN]
        closest = self.closest(ships)
        return [ship_view(ship, self.traffic, closest.get(ship.position.mmsi)) for ship in ships]

    def closest(self, ships: list[Ship]) -> dict[int, ApproachView]:
        """Return by MMSI to which vehicle ships come closest, of those that come close to any."""
        if self.traffic is None or not ships:
            return {}
        limits = self.traffic.settings
        best: dict[int, ApproachView] = {}
        for member in self._team:
            if member.report is None:
                continue
            distance, in_s = self._approaches(member, ships, SHOWN_S)
            soon, _ = self._approaches(member, ships, limits.cpa_s)
            for ship, far_m, later_s, near_m in zip(ships, distance, in_s, soon, strict=True):
                before = best.get(ship.position.mmsi)
                if math.isfinite(far_m) and (before is None or far_m < before.distance_m):
                    best[ship.position.mmsi] = ApproachView(
                        mission_id=self._mission_id,
                        vehicle=member.name,
                        distance_m=round(float(far_m), 1),
                        in_s=round(float(later_s), 1),
                        alarm=bool(near_m <= limits.cpa_m) and not self._is_own(ship),
                    )
        return best

    def encounters(self, member: Member, begun: Collection[int]) -> list[Encounter]:
        """Return the ships that come too close to a vehicle, the closest first.

        Parameters
        ----------
        begun
            Ships (MMSI) that did so a moment ago: they have to stay farther away until that is over.
        """
        if self.traffic is None or member.report is None:
            return []
        limits = self.traffic.settings
        ships = [s for s in self.traffic.near(*self._place_deg(member)) if not self._is_own(s)]
        if not ships:
            return []
        within_m = np.array([limits.cpa_m * (RELEASE if s.position.mmsi in begun else 1.0) for s in ships])
        distance, in_s = self._approaches(member, ships, limits.cpa_s)
        if begun:
            longer, longer_s = self._approaches(member, ships, RELEASE * limits.cpa_s)
            again = np.array([s.position.mmsi in begun for s in ships])
            distance, in_s = np.where(again, longer, distance), np.where(again, longer_s, in_s)
        found = [
            Encounter(ship, float(away), float(when))
            for ship, away, when, most in zip(ships, distance, in_s, within_m, strict=True)
            if away <= most
        ]
        return sorted(found, key=lambda one: (one.distance_m, one.in_s))

    def is_up(self, member: Member) -> bool:
        """Whether a vehicle is in ships' way now."""
        return (
            self.traffic is not None
            and member.report is not None
            and member.report.position.depth_m < self.traffic.settings.near_surface_m
        )

    def _approaches(self, member: Member, ships: list[Ship], within_s: float) -> tuple[FloatArray, FloatArray]:
        """Return how close ships' hulls come to a vehicle (n,) and in how many seconds; inf: to none while it is up."""
        assert self.traffic is not None  # noqa: S101 - callers looked
        now_s = self.traffic.now_s
        lat, lon = (np.array([getattr(s.position, name) for s in ships]) for name in ("lat_deg", "lon_deg"))
        east, north = self._frame.to_local(lat, lon)
        speed = np.array([s.position.sog_mps or 0.0 for s in ships])
        known = np.array([s.position.cog_deg is not None for s in ships])
        course = np.radians([s.position.cog_deg or 0.0 for s in ships])
        velocity = np.column_stack([np.sin(course), np.cos(course)]) * (speed * known)[:, None]
        age = np.array([max(now_s - s.heard_s, 0.0) for s in ships])
        here = np.column_stack([east, north]) + velocity * age[:, None]
        way = self._way(member)
        deep = np.array([self._least_depth_m(s) for s in ships])
        distance, in_s = np.full(len(ships), np.inf), np.zeros(len(ships))
        for depth in np.unique(deep):
            of_it = deep == depth
            distance[of_it], in_s[of_it] = closest_approach(here[of_it], velocity[of_it], way, float(depth), within_s)
        return np.maximum(distance - np.array([s.hull_m for s in ships]), 0.0), in_s

    def _way(self, member: Member) -> TimedWay:
        """Return where a vehicle goes; one that holds below would come up where it is."""
        assert member.report is not None  # noqa: S101 - callers looked
        here, depth_m = member.place_m(self._frame), member.report.position.depth_m
        withdrawal = member.withdrawal
        ends: list[tuple[FloatArray, float]] = []
        if withdrawal is not None and withdrawal.below:
            ends = [(here, 0.0)]
        else:
            if member.ordered and member.order is not None and member.target_m is not None:
                ends.append((member.target_m, member.order.position.depth_m))
            ends += [(leg.target_m, leg.position.depth_m) for leg in member.ahead]
        return planned_way(here, depth_m, ends, self._spec().speed_of(member.spec) * self._time_scale)

    def _least_depth_m(self, ship: Ship) -> float:
        """Return from which depth on a vehicle is out of a ship's way."""
        assert self.traffic is not None  # noqa: S101 - callers looked
        drawn = (ship.particulars.draught_m or 0.0) + DRAUGHT_MARGIN_M
        rounded = min(DEPTH_STEP_M * math.ceil(drawn / DEPTH_STEP_M), DEEPEST_M)
        return max(self.traffic.settings.near_surface_m, rounded if ship.particulars.draught_m else 0.0)

    def _is_own(self, ship: Ship) -> bool:
        assert self.traffic is not None  # noqa: S101 - callers looked
        return ship.position.own or ship.position.mmsi in self.traffic.settings.own_mmsi

    def _place_deg(self, member: Member) -> tuple[float, float]:
        assert member.report is not None  # noqa: S101 - callers looked
        return member.report.position.lat_deg, member.report.position.lon_deg
