"""Where vehicles will be in the next moment, as they are led now, and how close two of them come to each other."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.timeline import Timeline, closest_approach
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.flight.decisions.separation import planned_places, steered_ahead
from app.missions.flight.legs.asides import HORIZON_S, depth_now_m
from app.missions.live.mission import LiveMission
from app.missions.task.planner import turn_radius_m
from app.missions.team import OUT_OF_REACH, Member

WAITING_S = 40.0
"""How far ahead the others' ways are looked at where a vehicle waits."""

VERTICAL_SHARE = 0.9
"""Vehicles pass above each other that are this part of ``min_vertical_separation_m`` apart: none keeps its depth
exactly."""

CLOSING_M = 0.5
"""Who comes no nearer than this to one that is close to it already gives no way."""


@dataclass(frozen=True)
class Imminent:
    """Where a vehicle will be in the next moment, and at which depths, least and most."""

    name: str
    motion: Timeline
    least_m: float
    most_m: float
    around_m: float = 0.0
    """How far from there it may be where it waits: it circles there."""
    waits_from_s: float = 0.0
    """From when on it does."""
    member: Member | None = None
    """None: no mission here leads it."""
    live: LiveMission | None = None
    """The mission that leads it."""

    @property
    def here_m(self) -> FloatArray:
        """Where it is now, (2,)."""
        return self.motion.at(np.zeros(1))[0, :2]

    @property
    def homeward(self) -> bool:
        """Whether it is on its way home."""
        return self.member is not None and self.member.withdrawal is not None

    @property
    def searches(self) -> bool:
        """Whether it searches a site with others of its mission."""
        return self.live is not None and self.live.search is not None and not self.homeward


class NextMoment:
    """Tells of the vehicles of one mission where they will be, in a mission's frame.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, live: LiveMission, time_scale: float) -> None:
        self._live = live
        self._time_scale = time_scale

    def as_led(self, member: Member, frame: LocalFrame | None = None) -> Imminent:
        """Return where a vehicle will be, as it is led now; in the frame of another mission where one is given."""
        if member.waits_m is None:
            imminent = self.going_on(member)
        else:
            depth_m = depth_now_m(member)
            imminent = self.waiting(member, member.waits_m, depth_m, depth_m)
        if frame is None or frame is self._live.frame:
            return imminent
        return moved(imminent, self._live.frame, frame)

    def waiting(self, member: Member, place_m: FloatArray, least_m: float, most_m: float) -> Imminent:
        """Return where a vehicle will be that goes to a place (2,) and circles there."""
        here = np.append(member.place_m(self._live.frame), depth_now_m(member))
        if math.dist(place_m, here[:2]) < CLOSING_M:
            motion = Timeline(np.zeros(1), here[None])
        else:
            motion = steered_ahead(self._live, member, [here, np.append(place_m, here[2])], WAITING_S)
        around_m = self.circle_m(member)
        away_m = np.hypot(*(motion.place_m[:, :2] - place_m).T)
        there = np.flatnonzero(away_m <= around_m)
        waits_from_s = float(motion.time_s[there[0] if len(there) else -1])
        return Imminent(member.name, motion, least_m, most_m, around_m, waits_from_s, member, self._live)

    def going_on(self, member: Member) -> Imminent:
        """Return where a vehicle will be on its way."""
        places, age_s = [*planned_places(member, self._live), *self._beyond(member)], self.age_s(member)
        motion = steered_ahead(self._live, member, places, WAITING_S + age_s)
        motion = Timeline(motion.time_s - age_s, motion.place_m)
        begins_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0)[:, :2].T))])[:-1]
        reach_m = (HORIZON_S + age_s) * self._live.spec.speed_of(member.spec)
        depths_m = [float(place[2]) for place in places[: 1 + int((begins_m < reach_m).sum())]]
        if member.order is not None and not member.ordered:
            depths_m.append(member.order.position.depth_m)  # it comes up where it is home
        around_m = self.circle_m(member) if len(places) == 1 else 0.0
        least_m, most_m = min(depths_m), max(depths_m)
        return Imminent(member.name, motion, least_m, most_m, around_m, 0.0, member, self._live)

    def reach_m(self, member: Member) -> float:
        """Return how far a vehicle may be from where it was heard, as long as another one may wait for it."""
        # What the current does to one it does to the other.
        return (WAITING_S + self.age_s(member)) * self._live.spec.speed_of(member.spec) + self.circle_m(member)

    def circle_m(self, member: Member) -> float:
        """Return how wide the circles are in which a vehicle waits; in searches most stand still."""
        if self._live.search is not None:
            return member.capabilities.circles_m
        return max(member.capabilities.circles_m, turn_radius_m(self._live.spec, member.spec))

    def age_s(self, member: Member) -> float:
        """Return how much earlier than the newest of the team a vehicle's report came: their clocks may differ."""
        if member.heard_s is None or member.link not in OUT_OF_REACH:
            return 0.0
        newest_s = max(one.heard_s for one in self._live.team if one.heard_s is not None)
        return (newest_s - member.heard_s) * self._time_scale

    def _beyond(self, member: Member) -> list[FloatArray]:
        """Return where a vehicle flies on to that has flown its last leg, (3,): it is led beyond its end."""
        lead = None if member.order is None else member.order.lead
        if lead is None or member.ordered or member.ahead:
            return []
        east, north = map(float, self._live.frame.to_local(lead.lat_deg, lead.lon_deg))
        away_m = math.dist((east, north), member.place_m(self._live.frame))
        # Nearer than that it circles there already.
        return [np.array([east, north, lead.depth_m])] if away_m > 2.0 * self.circle_m(member) else []


def nearest_m(one: Imminent, other: Imminent, vertical_m: float, until_s: float = HORIZON_S) -> float:
    """Return how close two come to each other in a moment; inf where one stays above the other by ``vertical_m``."""
    apart_m = max(one.least_m - other.most_m, other.least_m - one.most_m)
    if apart_m >= VERTICAL_SHARE * vertical_m:
        return math.inf
    begins_s = sorted({0.0, *(min(it.waits_from_s, until_s) for it in (one, other))})
    least_m = math.inf
    for begin_s, end_s in pairwise([*begins_s, until_s]):
        a, b = (it.motion if begin_s == 0.0 else it.motion.since(begin_s) for it in (one, other))
        apart_m = closest_approach(a, b, until_s=end_s).distance_m
        least_m = min(least_m, apart_m - around_m(begin_s, (one, other)))
    return least_m


def around_m(time_s: float, vehicles: Iterable[Imminent]) -> float:
    """Return how far vehicles together may be from where their motions have them at a time."""
    return sum(it.around_m for it in vehicles if it.waits_from_s <= time_s)


def is_out(member: Member) -> bool:
    """Whether a vehicle is in the water, and not where it was to be in the end."""
    return member.report is not None and not (member.withdrawal is not None and member.withdrawal.over)


def moved(imminent: Imminent, source: LocalFrame, frame: LocalFrame) -> Imminent:
    """Return a vehicle's next moment in another frame."""
    place_m = imminent.motion.place_m
    east, north = frame.to_local(*source.to_geographic(place_m[:, 0], place_m[:, 1]))
    motion = Timeline(imminent.motion.time_s, np.column_stack([east, north, place_m[:, 2]]))
    return replace(imminent, motion=motion)
