"""Which vehicles of a mission need legs, when, and how many at once: long before they are where their last one ends."""

import asyncio
import math
from collections.abc import Callable, Collection, Iterable

import numpy as np

from app.exploration.motion.leg_rules import AHEAD, HARDLY_BEGUN
from app.exploration.planners import COVERERS
from app.missions.flight.decisions.deciding import DECIDE_AGAIN_S
from app.missions.live.mission import LiveMission
from app.missions.spec.mission import MissionSpec
from app.missions.task.way import least_way_m
from app.missions.team import Member

AHEAD_WHEN_WATCHED = 1
"""The same where targets move, or vehicles come up by what they say of their position: decisions follow closer."""

LEAD_S = 2.0
"""So long before its last leg ends, by its clock, a vehicle gets another one where what it measures decides on that."""

DECISIONS_AHEAD = 3.0
"""How many decisions' time a vehicle's legs last at least."""

MOST_AHEAD = 20

SOON = 1.3
"""A vehicle whose legs end within this many times the usual lead is decided for together with one that needs a leg."""


class LegDemand:
    """Who of a running mission's vehicles needs legs.

    Parameters
    ----------
    decision_s
        Returns how long the next decision of one leg will take, on the wall clock.
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(self, live: LiveMission, decision_s: Callable[[], float], time_scale: float) -> None:
        self._live = live
        self._decision_s = decision_s
        self._time_scale = time_scale
        self.watched = bool(live.spec.targets) or live.spec.surface_policy is not None
        """Whether decisions follow targets, or what vehicles say of their position."""
        self.measured = live.spec.planner.name in COVERERS
        """Whether legs follow from what was measured on those just before."""
        self._ahead = 0 if self.measured else AHEAD_WHEN_WATCHED if self.watched else AHEAD
        self._taking_part = {member.name for member in live.team if member.legs}
        """Vehicles that go on with their own numbers: they had legs, and were not away since."""
        self._again_at_s: dict[str, float] = {}
        """When vehicles that got no leg are looked at again, the event loop's time."""

    @property
    def _spec(self) -> MissionSpec:
        """What the mission is to do, which may change while it is flown."""
        return self._live.spec

    def members(self) -> list[Member]:
        """Return the vehicles to decide for now: none, or those that need a leg, with others that soon will."""
        now_s = asyncio.get_running_loop().time()
        self._taking_part &= {member.name for member in self._live.team if member.controllable}
        able = [
            member
            for member in self._live.team.plannable
            if self.wants_legs(member)
            and self._again_at_s.get(member.name, -math.inf) <= now_s
            and len(member.ahead) < MOST_AHEAD
        ]
        if not any(self._needs_leg(member) for member in able):
            return []
        return [member for member in able if self._needs_leg(member) or self._will_need_leg(member)]

    def look_later(self, names: Iterable[str]) -> None:
        """Leave out vehicles that got no leg for a while."""
        again_at_s = asyncio.get_running_loop().time() + DECIDE_AGAIN_S / self._time_scale
        self._again_at_s |= dict.fromkeys(names, again_at_s)

    def look_now(self, names: Collection[str] | None = None) -> None:
        """Leave out vehicles no longer; None: any."""
        self._again_at_s = {
            name: at_s for name, at_s in self._again_at_s.items() if names is not None and name not in names
        }

    def note_decided(self, names: Collection[str]) -> None:
        """Note that vehicles were decided for: they take part from then on."""
        self._taking_part |= set(names)
        self.look_now(names)

    def next_look_s(self) -> float:
        """Return until when nobody may come to need a leg without telling anything new, the event loop's time."""
        now_s = asyncio.get_running_loop().time()
        # Whose time has come and who gets no leg all the same needs none now: waiting for it would be no waiting.
        later_s = min((at_s for at_s in self._again_at_s.values() if at_s > now_s), default=math.inf)
        # Vehicles come nearer to the end of their legs without telling anything new.
        fastest_mps = max((self._spec.speed_of(member.spec) for member in self._live.team), default=1.0)
        soon_s = now_s + 0.5 * self._spec.limits.max_step_m / (fastest_mps * self._time_scale)
        if self.measured:
            soon_s = min(soon_s, now_s + 0.2 * self._lead_s)
        return min(later_s, soon_s)

    def is_unhurried(self, members: Iterable[Member]) -> bool:
        """Whether the legs of all of some vehicles last for several decisions more."""
        unhurried_s = 2.0 * DECISIONS_AHEAD * self._decision_s()
        return not self.watched and all(self._lasts_s(member) > unhurried_s for member in members)

    def legs_at_once(self, members: Iterable[Member]) -> int:
        """Return how many legs are decided together, so that they last until the next decision is made."""
        if self.watched:
            return 1
        fastest_mps = max(self._spec.speed_of(member.spec) for member in self._live.team)
        way_m = (self._lead_s if self.measured else DECISIONS_AHEAD * self._decision_s()) * self._time_scale
        way_m *= fastest_mps
        idle = any(not member.ordered and not member.ahead for member in members)
        return min(max(math.ceil(way_m / self._spec.limits.max_step_m), 1 + self._ahead * idle), MOST_AHEAD)

    def next_number(self, member: Member) -> int:
        """Return the number of a vehicle's next leg: one that joins or comes back goes on with what others fly."""
        if member.name in self._taking_part or member.ordered or member.ahead:
            return member.legs + 1
        others = [m.legs - len(m.ahead) for m in self._live.team.plannable if m is not member]
        reached = min(others, default=self._live.header.step)
        return max(member.legs, min(reached, self._live.header.step)) + 1

    def wants_legs(self, member: Member) -> bool:
        """Whether a vehicle surveys, and has some of its way left."""
        return member.withdrawal is None and self.has_way(member)

    def has_way(self, member: Member) -> bool:
        """Whether a vehicle has some of its way left."""
        if self._spec.budget.steps is not None:
            return self.next_number(member) <= self._spec.steps
        return member.way_left_m(self._spec) > least_way_m(self._spec)

    def _needs_leg(self, member: Member) -> bool:
        if not member.ordered and not member.ahead:
            return True
        if self.measured:
            return self._lasts_s(member) < self._lead_s
        if len(member.ahead) < self._ahead:
            return True
        return not self.watched and self._lasts_s(member) < DECISIONS_AHEAD * self._decision_s()

    @property
    def _lead_s(self) -> float:
        """How long before a vehicle's legs end the next one is decided, on the wall clock, where they are measured."""
        # A vehicle rather circles for a slow decision than gets all the next ones from what is not measured yet.
        shortest_s = LEAD_S / self._time_scale
        return shortest_s + DECISIONS_AHEAD * min(self._decision_s(), shortest_s)

    def _will_need_leg(self, member: Member) -> bool:
        if self.measured:
            return self._lasts_s(member) < SOON * self._lead_s
        # Where decisions are slow one for everybody takes the time of one for somebody.
        others_s = len(self._live.team.plannable) * self._decision_s()
        if not self.watched and self._lasts_s(member) < DECISIONS_AHEAD * self._decision_s() + others_s:
            return True
        left_m = self._left_of_leg_m(member)
        return len(member.ahead) <= self._ahead and left_m <= HARDLY_BEGUN * self._spec.limits.max_step_m

    def _left_of_leg_m(self, member: Member) -> float:
        if member.target_m is None or member.report is None or not member.ordered:
            return 0.0
        return float(np.linalg.norm(member.target_m - member.place_m(self._live.frame)))

    def _lasts_s(self, member: Member) -> float:
        """Return how long a vehicle's legs last, on the wall clock."""
        speed_mps = self._spec.speed_of(member.spec) * self._time_scale
        return member.way_ahead_m(self._live.frame) / speed_mps
