"""Keeps vehicles off keep-out zones while they turn.

Legs are planned past zones with room for turns. But a vehicle that nobody heard drifts, one that was held or gave way
begins anew where it is, and no vehicle turns on the spot: sent on from beside a zone, it may turn into it. So what
counts once more is how it will steer. Where that leads into a zone it goes somewhere else first, from where its way is
free. A leg that this does not help is given up: there is no room for its turns.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import shapely
import structlog
from shapely.geometry import LineString, Point, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.fleet.interface import WaypointOrder
from app.missions.flight.decisions.separation import planned_places, steered_ahead
from app.missions.flight.legs.asides import HORIZON_S, Asides, Because, depth_now_m
from app.missions.flight.observation.waiting import until_next_look
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.recovery.way_home import homeward_ground
from app.missions.task.planner import turn_radius_m
from app.missions.team import Member
from app.missions.views.mission import Level

CLEARANCE_M = 1.0
"""A vehicle is led aside, and on again, by ways that keep off zones by so much: none steers exactly as foreseen."""

DIRECTIONS = 16
REACHES = (2.0, 3.0, 5.0)
"""How many turning radii away a vehicle is led aside, and at least ``LEAST_REACH_M``."""
LEAST_REACH_M = 3.0

MOST_TRIES = 2
"""So often a vehicle is led aside from the same leg: where its turns have no room at the end, they have none later."""

log = structlog.get_logger(__name__)


class KeepOutZones:
    """The keep-out zones of a mission, in its local frame."""

    def __init__(self, zones: Iterable[FloatArray]) -> None:
        self._zones = [Polygon(zone) for zone in zones]

    def near(self, place_m: FloatArray, within_m: float) -> bool:
        """Whether one lies at most so far from a place (2,)."""
        return any(zone.distance(Point(place_m)) <= within_m for zone in self._zones)

    def room_m(self, way_m: FloatArray) -> float:
        """Return how far a way (n, 2) keeps off the zones; 0 where it leads into one that it does not begin in."""
        way = LineString(way_m) if len(way_m) > 1 else Point(way_m[0])
        begin = Point(way_m[0])
        return min((float(zone.distance(way)) for zone in self._zones if not zone.contains(begin)), default=math.inf)

    def entered_by(self, way_m: FloatArray) -> bool:
        """Whether a way (n, 2) leads into a zone that it does not begin in."""
        return self.room_m(way_m) <= 0.0


class KeepingOff:
    """Looks at the vehicles of one running mission, and leads those aside that are about to turn into a zone.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self, live: LiveMission, constraints: Constraints, zones: KeepOutZones, asides: Asides, time_scale: float
    ) -> None:
        self._live = live
        self._constraints = constraints
        self._zones = zones
        self._asides = asides
        self._time_scale = time_scale
        self._tries: dict[str, tuple[WaypointOrder, int]] = {}
        """From which leg each vehicle was led aside last, and how often."""

    async def keep(self) -> None:
        """Keep vehicles off zones, where there are any, until cancelled."""
        while self._live.spec.keep_out:
            if not self._live.flight.halted:
                await self.look()
            await until_next_look(self._time_scale)

    async def look(self) -> None:
        """Look once whether any vehicle's way leads too near to a zone."""
        aside = self._asides.of(Because.ZONE)
        for member in list(self._live.team):
            if not self._asides.may_lead(member, Because.ZONE):
                continue
            places = planned_places(member, self._live)
            if len(places) < 2 or not self._zones.near(places[0][:2], self._reach_m(member)):
                if member.name in aside:
                    await self._asides.lead_on(member)
                continue
            on_m = self._way_m(member, places)
            if member.name not in aside:
                if self._zones.entered_by(on_m):
                    await self._keep_off(member, places)
            elif self._goes_on(on_m):
                await self._asides.lead_on(member)
            elif self._is_there(member):
                await self._lead_aside(member, places)

    def _reach_m(self, member: Member) -> float:
        """Return how far a vehicle comes while it is looked at, whatever the current does."""
        current_mps = math.hypot(*self._live.team.current_mps)
        return HORIZON_S * (self._live.spec.speed_of(member.spec) + current_mps)

    def _way_m(self, member: Member, places: Sequence[FloatArray]) -> FloatArray:
        """Return what a vehicle passes over in a moment that steers for some places, (n, 2)."""
        return steered_ahead(self._live, member, list(places), HORIZON_S).place_m[:, :2]

    def _goes_on(self, way_m: FloatArray) -> bool:
        """Whether a vehicle that is led aside may fly its leg: no nearer to zones than it is, or with room enough."""
        room_m = self._zones.room_m(way_m)
        return room_m >= CLEARANCE_M or (room_m > 0.0 and room_m >= self._zones.room_m(way_m[:1]) - 1e-6)

    def _is_there(self, member: Member) -> bool:
        if member.waits_m is None:
            return True
        arrived_m = max(self._live.spec.arrival_radius_m, turn_radius_m(self._live.spec, member.spec))
        return math.dist(member.place_m(self._live.frame), member.waits_m) <= arrived_m

    async def _keep_off(self, member: Member, places: list[FloatArray]) -> None:
        """Lead a vehicle aside from its leg; one that surveys gives that up where this has not helped."""
        if member.order is None:
            return
        last, tries = self._tries.get(member.name, (None, 0))
        tries = tries if last is member.order else 0
        self._tries[member.name] = (member.order, tries + 1)
        await self._lead_aside(member, places)
        if tries >= MOST_TRIES and member.plannable:
            await self._asides.give_up(member, "its turns would lead it into a keep-out zone")

    async def _lead_aside(self, member: Member, places: list[FloatArray]) -> None:
        """Lead a vehicle to where its turns keep off zones: there, and best on from there, too."""
        best, best_m = None, self._zones.room_m(self._way_m(member, places))
        for place_m in self._around(member, places[0][:2], places[1][:2]):
            place = np.append(place_m, depth_now_m(member))
            there_m = self._zones.room_m(self._way_m(member, [places[0], place]))
            on_m = self._zones.room_m(self._way_m(member, [places[0], place, *places[1:2]]))
            if on_m >= CLEARANCE_M:
                best = place_m
                break
            if there_m > best_m:
                best, best_m = place_m, there_m
        if best is not None and await self._asides.lead(member, best, Because.ZONE):
            words = f"{member.name} would turn into a keep-out zone: it goes round another way"
            await self._live.journal.log(Level.INFO, "safety", words, vehicle=member.name)

    def _around(self, member: Member, here_m: FloatArray, end_m: FloatArray) -> Iterator[FloatArray]:
        """Yield places (2,) inside the area about a vehicle, the nearest to its leg's end first, that it can go to."""
        constraints, live = self._constraints, self._live
        home_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
        if member.withdrawal is not None and home_m is not None:
            constraints = homeward_ground(constraints, home_m)
        course = np.arange(0.0, 2 * np.pi, 2 * np.pi / DIRECTIONS)
        unit = np.column_stack([np.sin(course), np.cos(course)])
        radius_m = turn_radius_m(self._live.spec, member.spec)
        places_m = np.concatenate([here_m + max(reach * radius_m, LEAST_REACH_M) * unit for reach in REACHES])
        inside = shapely.contains_xy(Polygon(constraints.area), places_m[:, 0], places_m[:, 1])
        for place_m in places_m[inside][np.argsort(np.hypot(*(places_m[inside] - end_m).T), kind="stable")]:
            if self._zones.room_m(np.array([here_m, place_m])) > 0.0 and self._asides.is_clear(member, place_m):
                yield place_m
