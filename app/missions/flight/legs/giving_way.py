"""Has vehicles give way: of two that are about to pass too close to each other one waits, or goes aside.

Legs are decided so that vehicles stay apart, by when each should be where, or by their depths. Currents, waits and
people change when they are where, and over a shoal bottom vehicles travel less deep than planned. So once more what
counts is where they are, and where they will be in a moment.
"""

import asyncio
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise

import numpy as np
import shapely
import structlog

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.motion.timeline import Timeline, closest_approach
from app.missions.flight.decisions.decision import turn_radius_m
from app.missions.flight.decisions.separation import planned_places, steered_ahead, ways_aside
from app.missions.flight.legs.asides import HORIZON_S, Asides, Because, depth_now_m
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.keeping_off import KeepOutZones
from app.missions.flight.observation.waiting import until_next_look
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.recovery.way_home import homeward_ground
from app.missions.safety.free_space import CIRCLE_M
from app.missions.team import OUT_OF_REACH, Member
from app.missions.views.mission import Level

WAITING_S = 40.0
"""How far ahead the others' ways are looked at where a vehicle waits."""

VERTICAL_SHARE = 0.9
"""Vehicles pass above each other that are this part of ``min_vertical_separation_m`` apart: none keeps its depth
exactly."""

CLOSING_M = 0.5
"""Who comes no nearer than this to one that is close to it already gives no way."""

CLEAR = 1.2
"""A vehicle goes on when it will stay this many times the least separation away."""

PATIENCE_S = 60.0
"""How long it gives way at the most, seconds of its time."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class _Imminent:
    """Where a vehicle will be in the next moment, and at which depths, least and most."""

    member: Member
    motion: Timeline
    least_m: float
    most_m: float
    around_m: float = 0.0
    """How far from there it may be where it waits: it circles there."""
    waits_from_s: float = 0.0
    """From when on it does."""

    @property
    def here_m(self) -> FloatArray:
        """Where it is now, (2,)."""
        return self.motion.at(np.zeros(1))[0, :2]


@dataclass(frozen=True, order=True)
class _Room:
    """How far a vehicle that gives way stays from all others, where more counts; the first counts most."""

    soon_m: float
    """In the next moment."""
    later_m: float
    """As long as it may wait: who passes later gives way, or is given way to, then."""
    always_m: float
    """As long, if it circled there from now on."""

    def is_enough(self, enough_m: float) -> bool:
        """Whether no other place can be better."""
        return self.always_m >= enough_m


class GivingWay:
    """Looks at the vehicles of one running mission, and has them give way.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self,
        live: LiveMission,
        constraints: Constraints,
        committing: LegCommit,
        zones: KeepOutZones,
        asides: Asides,
        time_scale: float,
    ) -> None:
        self._live = live
        self._constraints = constraints
        self._committing = committing
        self._zones = zones
        self._asides = asides
        self._time_scale = time_scale

    async def keep(self) -> None:
        """Go on until cancelled."""
        while True:
            try:
                if not self._live.halted and self._live.spec.limits.min_separation_m > 0.0:
                    await self.look()
            except Exception:
                log.exception("vehicles' ways could not be looked at")
            await until_next_look(self._time_scale)

    async def look(self) -> None:
        """Look once at everybody."""
        near = {member.name: self._imminent(member) for member in self._may_meet()}
        await self._let_go_on(near)
        settled: set[str] = set()
        for one, other in self._meeting(list(near.values())):
            if not settled & {one.member.name, other.member.name}:
                settled |= {one.member.name, other.member.name}
                await self._keep_apart(one, other, near)

    def _imminent(self, member: Member) -> _Imminent:
        """Return where a vehicle will be, as it is led now."""
        if member.waits_m is None:
            return self._going_on(member)
        depth_m = depth_now_m(member)
        return self._waiting(member, member.waits_m, depth_m, depth_m)

    def _waiting(self, member: Member, place_m: FloatArray, least_m: float, most_m: float) -> _Imminent:
        """Return where a vehicle will be that goes to a place (2,) and circles there."""
        here = np.append(member.place_m(self._live.frame), depth_now_m(member))
        if math.dist(place_m, here[:2]) < CLOSING_M:
            motion = Timeline(np.zeros(1), here[None])
        else:
            motion = steered_ahead(self._live, member, [here, np.append(place_m, here[2])], WAITING_S)
        around_m = self._circle_m(member)
        away_m = np.hypot(*(motion.place_m[:, :2] - place_m).T)
        there = np.flatnonzero(away_m <= around_m)
        waits_from_s = float(motion.time_s[there[0] if len(there) else -1])
        return _Imminent(member, motion, least_m, most_m, around_m, waits_from_s)

    def _going_on(self, member: Member) -> _Imminent:
        """Return where a vehicle will be on its way."""
        places, age_s = [*planned_places(member, self._live), *self._beyond(member)], self._age_s(member)
        motion = steered_ahead(self._live, member, places, WAITING_S + age_s)
        motion = Timeline(motion.time_s - age_s, motion.place_m)
        begins_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0)[:, :2].T))])[:-1]
        reach_m = (HORIZON_S + age_s) * self._live.spec.speed_of(member.spec)
        depths_m = [float(place[2]) for place in places[: 1 + int((begins_m < reach_m).sum())]]
        if member.order is not None and not member.ordered:
            depths_m.append(member.order.position.depth_m)  # it comes up where it is home
        around_m = self._circle_m(member) if len(places) == 1 else 0.0
        return _Imminent(member, motion, min(depths_m), max(depths_m), around_m)

    def _beyond(self, member: Member) -> list[FloatArray]:
        """Return where a vehicle flies on to that has flown its last leg, (3,): it is led beyond its end."""
        lead = None if member.order is None else member.order.lead
        if lead is None or member.ordered or member.ahead:
            return []
        east, north = map(float, self._live.frame.to_local(lead.lat_deg, lead.lon_deg))
        away_m = math.dist((east, north), member.place_m(self._live.frame))
        # Nearer than that it circles there already.
        return [np.array([east, north, lead.depth_m])] if away_m > 2.0 * self._circle_m(member) else []

    def _circle_m(self, member: Member) -> float:
        """Return how wide the circles are in which a vehicle waits; in searches most stand still."""
        if self._live.search is not None:
            return member.capabilities.circles_m
        return max(member.capabilities.circles_m, turn_radius_m(self._live.spec, member.spec))

    def _age_s(self, member: Member) -> float:
        """Return how much earlier than the newest of the team a vehicle's report came: their clocks may differ."""
        if member.heard_s is None or member.link not in OUT_OF_REACH:
            return 0.0
        newest_s = max(one.heard_s for one in self._live.team if one.heard_s is not None)
        return (newest_s - member.heard_s) * self._time_scale

    def _may_meet(self) -> list[Member]:
        """Return the vehicles that are so near another one that they may meet it in a moment."""
        out = [member for member in self._live.team if _is_out(member)]
        if len(out) < 2:
            return []
        here_m = np.array([member.place_m(self._live.frame) for member in out])
        # What the current does to one it does to the other.
        reach_m = np.array([(WAITING_S + self._age_s(m)) * self._live.spec.speed_of(m.spec) for m in out])
        circles_m = np.array([self._circle_m(member) for member in out])
        room_m = self._enough_m + circles_m + reach_m
        near = np.hypot(*(here_m[:, None] - here_m[None]).T) < room_m[:, None] + reach_m[None] + circles_m[None]
        np.fill_diagonal(near, val=False)
        return [out[k] for k in np.flatnonzero(near.any(axis=1))]

    def _meeting(self, near: list[_Imminent]) -> Iterator[tuple[_Imminent, _Imminent]]:
        """Yield pairs that are about to pass too close to each other."""
        for one, other in combinations(near, 2):
            # Ways home are not planned apart, and what is known of the current is not exact.
            homeward = one.member.withdrawal is not None and other.member.withdrawal is not None
            least_m = self._enough_m if homeward else self._live.spec.limits.min_separation_m
            if not self._decided_together(one.member, other.member) and self._too_close(one, other, least_m):
                yield one, other

    def _decided_together(self, one: Member, other: Member) -> bool:
        """Whether two search on: their legs are of one step, decided to be apart, and each waits for the other's."""
        return self._live.search is not None and one.withdrawal is None and other.withdrawal is None

    def _too_close(self, one: _Imminent, other: _Imminent, least_m: float) -> bool:
        """Whether two will be closer than that in a moment, and closer than they are now."""
        nearest_m = self._nearest_m(one, other)
        now_m = math.dist(one.here_m, other.here_m) - _around_m(0.0, one, other)
        return nearest_m < min(least_m, now_m - CLOSING_M)

    def _nearest_m(self, one: _Imminent, other: _Imminent, until_s: float = HORIZON_S) -> float:
        """Return how close two come to each other in a moment; inf where one stays above the other."""
        apart_m = max(one.least_m - other.most_m, other.least_m - one.most_m)
        if apart_m >= VERTICAL_SHARE * self._live.spec.limits.min_vertical_separation_m:
            return math.inf
        begins_s = sorted({0.0, *(min(it.waits_from_s, until_s) for it in (one, other))})
        nearest_m = math.inf
        for begin_s, end_s in pairwise([*begins_s, until_s]):
            a, b = (it.motion if begin_s == 0.0 else it.motion.since(begin_s) for it in (one, other))
            apart_m = closest_approach(a, b, until_s=end_s).distance_m
            nearest_m = min(nearest_m, apart_m - _around_m(begin_s, one, other))
        return nearest_m

    async def _keep_apart(self, one: _Imminent, other: _Imminent, near: dict[str, _Imminent]) -> None:
        """Have one of two give way, where that keeps it farthest from everybody."""
        best: tuple[_Room, Member, FloatArray] | None = None
        for it in self._who_may_give_way(one, other):
            others = [that for name, that in near.items() if name != it.member.name]
            going_on_m = min(self._nearest_m(it, that) for that in others)
            for place_m in self._clear_places(it.member):
                room = self._room(it, place_m, others, going_on_m, None if best is None else best[0])
                if room is not None:
                    best = room, it.member, place_m
                    if room.is_enough(self._enough_m):
                        break
            if best is not None and best[0].is_enough(self._enough_m):
                break
        if best is not None:
            _, member, place_m = best
            await self._give_way(member, place_m, other.member if member is one.member else one.member)

    def _who_may_give_way(self, one: _Imminent, other: _Imminent) -> list[_Imminent]:
        """Return who only waits, else rather who surveys than who goes home, the last by name, first."""
        stands = self._asides.may_stand_elsewhere
        pair = sorted(
            (one, other),
            key=lambda it: (stands(it.member), it.member.withdrawal is None, it.member.name),
            reverse=True,
        )
        return [it for it in pair if self._asides.may_lead(it.member, Because.VEHICLE) or stands(it.member)]

    def _clear_places(self, member: Member) -> Iterator[FloatArray]:
        """Yield where a vehicle may wait, each (2,)."""
        return filter(partial(self._asides.is_clear, member), self._places(member))

    @property
    def _enough_m(self) -> float:
        """How far vehicles are kept apart where there is room."""
        return CLEAR * self._live.spec.limits.min_separation_m

    def _room(
        self, it: _Imminent, place_m: FloatArray, others: list[_Imminent], going_on_m: float, best: _Room | None
    ) -> _Room | None:
        """Return what room a vehicle has at a place (2,) and on the way there.

        None where that is not more than the best, or hardly more than it has where it goes on, or zones are near.
        """
        waiting = self._waiting(it.member, place_m, it.least_m, it.most_m)
        # It circles where it waits.
        if self._zones.entered_by(waiting.motion.place_m[:, :2]) or self._zones.near(place_m, waiting.around_m):
            return None
        soon_m = min(self._nearest_m(waiting, that) for that in others)
        if soon_m <= going_on_m + CLOSING_M or (best is not None and min(soon_m, self._enough_m) < best.soon_m):
            return None
        later_m = min(self._nearest_m(waiting, that, WAITING_S) for that in others)
        circling = replace(waiting, waits_from_s=0.0)
        always_m = min(self._nearest_m(circling, that, WAITING_S) for that in others)
        room = _Room(*(min(room_m, self._enough_m) for room_m in (soon_m, later_m, always_m)))
        return room if best is None or room > best else None

    def _places(self, member: Member) -> list[FloatArray]:
        """Return where a vehicle may wait, each (2,): where it is, else wherever its limits allow."""
        if member.order is None or member.target_m is None:
            return []
        here_m = member.place_m(self._live.frame)
        depth_m = member.order.position.depth_m
        constraints, live = self._constraints, self._live
        home_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
        if member.withdrawal is not None and home_m is not None:
            constraints = homeward_ground(constraints, home_m)
        here, target = np.append(here_m, depth_m), np.append(member.target_m, depth_m)
        aside = ways_aside(here, target, constraints, self._committing.bottom, or_nearer=True)
        places_m = [here_m, *aside[:, :2]]
        if self._asides.may_stand_elsewhere(member):
            # For long, maybe: rather where its circles stay inside, but first of all apart from others.
            places_m.sort(key=lambda place_m: not self._has_room(place_m))
        return places_m

    def _has_room(self, place_m: FloatArray) -> bool:
        """Whether a vehicle may circle at a place (2,) for long: inside the area, and clear of zones."""
        area, place = shapely.Polygon(self._constraints.area), shapely.Point(place_m)
        inside = area.contains(place) and area.exterior.distance(place) >= CIRCLE_M
        return inside and not self._zones.near(place_m, CIRCLE_M)

    async def _give_way(self, member: Member, place_m: FloatArray, other: Member) -> None:
        stands = self._asides.may_stand_elsewhere(member)
        led = self._asides.stand(member, place_m) if stands else self._asides.lead(member, place_m, Because.VEHICLE)
        if await led:
            words = f"{member.name} gives way to {other.name}"
            await self._live.journal.log(Level.INFO, "safety", words, vehicle=member.name, gives_way_to=other.name)

    async def _let_go_on(self, near: dict[str, _Imminent]) -> None:
        """Send vehicles on that would stay clear of the others now, or have waited long."""
        now_s = asyncio.get_running_loop().time()
        for name, giving in self._asides.of(Because.VEHICLE).items():
            member = self._live.team.get(name)
            if member is None or not member.present:
                continue
            if name not in near:
                await self._asides.lead_on(member)
                continue
            waited_s = now_s - giving.since_s
            on = self._going_on(member)
            others = (that for that in near.values() if that.member is not member)
            meets = (that for that in others if not self._decided_together(member, that.member))
            clear = not any(self._too_close(on, that, self._enough_m) for that in meets)
            if clear or waited_s * self._time_scale >= PATIENCE_S:
                near[name] = on
                await self._asides.lead_on(member)


def _around_m(time_s: float, *vehicles: _Imminent) -> float:
    """Return how far vehicles together may be from where their motions have them at a time."""
    return sum(it.around_m for it in vehicles if it.waits_from_s <= time_s)


def _is_out(member: Member) -> bool:
    """Whether a vehicle is in the water, and not where it was to be in the end."""
    return member.report is not None and not (member.withdrawal is not None and member.withdrawal.over)
