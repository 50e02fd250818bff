"""What really becomes of simulated vehicles on a mission: where they are, what they have left, whom they meet."""

import asyncio
import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

from shapely import Polygon
from shapely.geometry import LineString

if TYPE_CHECKING:
    from app.missions.fleet.links.sim import SimFleetLink
    from app.missions.live.mission import LiveMission
    from app.missions.team import Member

TICK_S = 0.05
LONG_M, TALL_M = 2.5, 0.8
"""Vehicles touch each other of which the centres are closer than one is long, and than one is tall that is pitched."""

NOWHERE_M = 1.0
"""A leg that is not longer leads nowhere: its vehicle circles."""

Place = tuple[float, float, float]


@dataclass
class Seen:
    """What became of one vehicle: true figures, whatever it told."""

    surveys_at_pct: float | None = None
    """What it had left when it began to survey,"""
    turned_at_pct: float | None = None
    """when it turned back,"""
    home_at_pct: float | None = None
    """and when it was home."""
    waited_pct: float = 0.0
    """What it used before it turned back while it had no leg, or one that led nowhere."""
    from_point_m: float | None = None
    why: str = ""

    @property
    def surveyed_pct(self) -> float | None:
        """Of the energy that neither its way there nor its way home took, which part it used on legs of the survey.

        None for one that turned back for another reason than its energy.
        """
        if self.surveys_at_pct is None or self.turned_at_pct is None or self.home_at_pct is None:
            return None
        over_pct = self.surveys_at_pct - (self.turned_at_pct - self.home_at_pct)
        if "energy" not in self.why or over_pct <= 0.0:
            return None
        return round(100.0 * (self.surveys_at_pct - self.turned_at_pct - self.waited_pct) / over_pct, 1)


def leads_on(member: "Member") -> bool:
    """Whether a vehicle has a leg that leads anywhere."""
    if not member.ordered or member.target_m is None:
        return False
    return member.leg.start_m is None or math.dist(member.leg.start_m, member.target_m) > NOWHERE_M


class Watch:
    """Looks at the vehicles of one mission as they live.

    Parameters
    ----------
    live
    link
        Whose vehicles they are.
    """

    def __init__(self, live: "LiveMission", link: "SimFleetLink") -> None:
        self._live, self._link = live, link
        self._zones = [Polygon(live.spec.to_local(zone)) for zone in live.spec.keep_out]
        self._before: dict[str, Place] = {}
        self._last: dict[str, tuple[Place, float]] = {}
        """Where each was seen last, and what it had left then, percent."""
        self._been_apart: set[tuple[str, str]] = set()
        self.seen: dict[str, Seen] = {}
        self.in_zones: set[str] = set()
        self.drifted_into_zones: set[str] = set()
        """Those that the current took into one after they gave their waypoint up as nobody heard them."""
        self.closest_m = math.inf
        """Least distance aside between two at about the same depth, of which one was on its way home."""
        self.too_close: set[tuple[str, str]] = set()
        """Vehicles that came closer than the mission keeps them apart, one of them on its way home."""
        self.touched: set[tuple[str, str]] = set()
        """Those of them that touched each other."""
        self.touched_before: set[tuple[str, str]] = set()
        """Vehicles that touched each other while neither was on its way home, for example where they are launched."""
        self.meetings: dict[tuple[str, str], list[dict[str, Any]]] = {}
        """Of those that came too close or touched: what both were doing when that was seen first."""

    async def keep(self) -> None:
        """Look on until cancelled."""
        while True:
            self.look()
            await asyncio.sleep(TICK_S)

    def look(self) -> None:
        """Look once where every vehicle is, and note what is not as it has to be."""
        out: dict[str, tuple[Member, Place]] = {}
        for member in self._live.team:
            seen = self.seen.setdefault(member.name, Seen())
            if seen.from_point_m is not None or member.report is None:
                continue  # It was taken out of the water.
            _, before_pct = self._last.get(member.name, (None, 0.0))
            if self._link.swims(member.name):
                self._last[member.name] = self._place(member.name), self._link.battery_pct(member.name)
            elif member.name not in self._last:
                continue
            # The mission's end takes vehicles out between two looks: then they were where they were seen last.
            place, left_pct = self._last[member.name]
            used_pct = max(before_pct - left_pct, 0.0)
            self._note(member, seen, place, left_pct, used_pct)
            self._look_at_zones(member.name, place)
            out[member.name] = member, place
        for (a, (one, here)), (b, (other, there)) in combinations(sorted(out.items()), 2):
            returning = any(m.withdrawal is not None and not m.withdrawal.asked for m in (one, other))
            if self._compare((a, b), here, there, returning=returning):
                both = [self._doing(one, here), self._doing(other, there)]
                self.meetings.setdefault((a, b), both)

    def _note(self, member: "Member", seen: Seen, place: Place, left_pct: float, used_pct: float) -> None:
        from app.missions.flown import Phase
        from app.missions.recovery.berths import point_of

        if seen.surveys_at_pct is None and member.flown.phase is Phase.SURVEY:
            seen.surveys_at_pct = left_pct
        if seen.surveys_at_pct is not None and seen.turned_at_pct is None and not leads_on(member):
            seen.waited_pct += used_pct
        if member.withdrawal is not None and seen.turned_at_pct is None:
            seen.turned_at_pct, seen.why = left_pct, member.withdrawal.why
        recovery = self._live.spec.recovery_of(member.spec)
        if member.is_home and recovery is not None:
            point = point_of(recovery, self._live.spec)
            seen.from_point_m = round(math.hypot(place[0] - point[0], place[1] - point[1]), 1)
            seen.home_at_pct = left_pct

    def _look_at_zones(self, name: str, place: Place) -> None:
        before = self._before.get(name, place)
        self._before[name] = place
        track = LineString([before[:2], place[:2]])
        if any(zone.intersects(track) for zone in self._zones):
            adrift = self._link.swims(name) and self._link.is_adrift(name)
            (self.drifted_into_zones if adrift else self.in_zones).add(name)

    def _doing(self, member: "Member", place: Place) -> dict[str, Any]:
        east_m, north_m, depth_m = (round(one, 1) for one in place)
        heard = self._link.swims(member.name) and not self._link.is_silent(member.name)
        order_m = None if member.order is None else round(member.order.position.depth_m, 1)
        return {
            "vehicle": member.name,
            "east_m": east_m,
            "north_m": north_m,
            "depth_m": depth_m,
            "sent_to_depth_m": order_m,
            "phase": member.flown.phase,
            "heard": heard,
        }

    def _compare(self, pair: tuple[str, str], here: Place, there: Place, *, returning: bool) -> bool:
        """Whether two are closer than they should be."""
        limits = self._live.spec.limits
        aside_m, below_m = math.hypot(here[0] - there[0], here[1] - there[1]), abs(here[2] - there[2])
        if aside_m >= limits.min_separation_m:
            # Vehicles are launched side by side.
            self._been_apart.add(pair)
        if pair not in self._been_apart:
            return False
        close = aside_m < LONG_M and below_m < TALL_M
        if close:
            (self.touched if returning else self.touched_before).add(pair)
        if returning and below_m < limits.min_vertical_separation_m / 2:
            self.closest_m = min(self.closest_m, aside_m)
            if aside_m < limits.min_separation_m:
                self.too_close.add(pair)
                close = True
        return close

    def _place(self, name: str) -> Place:
        place = self._link.true_position(name)
        east, north = self._live.frame.to_local(place.lat_deg, place.lon_deg)
        return float(east), float(north), place.depth_m

    def found(self) -> dict[str, Any]:
        """Return what became of everybody."""
        return {
            name: {
                "from_point_m": seen.from_point_m,
                "energy_left_pct": None if seen.home_at_pct is None else round(seen.home_at_pct, 2),
                "surveyed_pct": seen.surveyed_pct,
                "why": seen.why,
            }
            for name, seen in self.seen.items()
        }
