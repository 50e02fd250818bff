"""When vehicles with legs of their own have surveyed all that there is for them, who goes home then, and why."""

import asyncio
from collections.abc import Collection, Sequence

import numpy as np

from app.exploration.planner.ordered import OrderedPlanner
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.legs.demand import LegDemand
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.live.mission import LiveMission
from app.missions.live.remaining import left_words
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.task.survey_lines import lengths_words
from app.missions.team import Member, WithdrawalCause

NOT_WAITED_FOR = 3
"""A vehicle that misses so many legs in a row is no longer waited for when the others have flown their ways."""

ANYWHERE = 2.0
"""Who can still fly this many times across the area has nothing left to survey when its planner has no leg for it."""

LINES_FLOWN = "all lines are flown"

LEAST_TOLD_M = 5.0
"""Less of lines that are left is not told: where they end they are cut short."""

TOLD_PCT = 0.1
"""A mission that leaves more of its area unseen says so when it ends."""


class SurveyEnd:
    """Who of a running mission's vehicles is done.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    """

    def __init__(
        self,
        live: LiveMission,
        planner: OrderedPlanner,
        demand: LegDemand,
        energy_range: EnergyRange,
        time_scale: float,
    ) -> None:
        self._live = live
        self._planner = planner
        self._demand = demand
        self._range = energy_range
        self._time_scale = time_scale
        self._absent_since_s: dict[str, float] = {}
        self._done: set[str] = set()
        """Vehicles for which nothing was left to do when all that was flown had been looked at."""
        self._idle: set[str] = set()
        """Vehicles that had flown all their legs when there was nothing for them."""
        self._sent_home: set[str] = set()
        """Vehicles that were sent home with what was too little of their way for a further line."""
        self._left_pct = 0.0
        """Share of the area that was not ensonified when that was last looked at."""

    @property
    def _spec(self) -> MissionSpec:
        """What the mission is to do, which may change while it is flown."""
        return self._live.spec

    def look_again(self) -> None:
        """Take nobody to be done any more: there is more, or less, to do."""
        self._done, self._idle, self._sent_home = set(), set(), set()

    def at_rest(self, members: Collection[Member]) -> set[str]:
        """Return who of some vehicles has flown all its legs, as it had when there was nothing for it last."""
        return {member.name for member in members if not member.ordered and not member.ahead} & self._idle

    def note_decided(
        self, members: Collection[Member], decisions: Sequence[Decision], at_rest: set[str], *, all_flown: bool
    ) -> set[str]:
        """Learn from decisions for vehicles who is done; returns those of them for whom there was nothing.

        ``at_rest``: who had flown all its legs when there was nothing for it before. ``all_flown``: everybody had.
        """
        names = {member.name for member in members}
        done = names & frozenset().union(*(decision.done for decision in decisions[:1]))
        self._left_pct = decisions[0].terms.get("left_pct", self._left_pct) if decisions else self._left_pct
        self._idle -= names
        self._idle |= {m.name for m in members if m.name in done and not m.ordered and not m.ahead}
        # What vehicles were just measuring is not known yet.
        sure = done & at_rest if self._demand.measured else done
        self._done = (self._done - names) | sure if all_flown else set()
        return done

    def call_home(self, names: Collection[str]) -> None:
        """Send those of some vehicles home that have flown all that is planned and can fly no further line."""
        for member in self._live.team.plannable:
            idle = not member.ahead and not member.ordered
            if member.name in names and idle and self._spec.ends_at_home(member.spec):
                energy_m, left_m = self._range.beyond_m(member), member.way_left_m(self._spec)
                if self._spec.lines_asked_for:
                    why, cause = "no line is left for it", WithdrawalCause.PART_DONE
                elif energy_m is not None and energy_m < left_m:
                    why, cause = "its energy lasts for its way home and for no further line", WithdrawalCause.CALLED
                elif left_m > ANYWHERE * float(np.hypot(*np.ptp(self._spec.local_area(), axis=0))):
                    why, cause = "nothing is left for it to survey", WithdrawalCause.PART_DONE
                else:
                    why = "what is left of its way is for going home and for no further line"
                    cause = WithdrawalCause.PART_DONE
                self._live.withdraw(member, Response.RETURN, why, cause=cause)
                self._sent_home.add(member.name)

    def flown_out(self) -> list[Member]:
        """Return the vehicles that have flown their way and go home: none of them waits at sea for the others."""
        return [
            member
            for member in self._live.team.plannable
            if not self._demand.has_way(member)
            and not member.ahead
            and not member.ordered
            and member.asked is None
            and self._spec.ends_at_home(member.spec)
        ]

    def is_reached(self) -> bool:
        """Whether everybody has flown its way; who does not get on, or is out of reach for long, keeps nobody.

        Who is held with some of its way left is waited for.
        """
        demand, team = self._demand, self._live.team.surveying
        left = [
            m
            for m in team
            if (demand.wants_legs(m) and (m.name not in self._done or m.asked is not None)) or m.ordered or m.ahead
        ]
        if not left:
            held = any(demand.has_way(m) for m in self._live.team.held)
            return bool(list(self._live.team)) and not held and not self.awaits_batteries
        names = {m.name for m in left}
        somebody_is_done = self._somebody_is_home or any(m.controllable for m in team if m.name not in names)
        if any(m.controllable and not (somebody_is_done and m.misses >= NOT_WAITED_FOR) for m in left):
            return False
        if not somebody_is_done and any(demand.wants_legs(m) for m in left):
            return False
        patience_s = self._spec.step_deadline_s / self._time_scale
        return all(m.controllable or self._absent_s(m) >= patience_s for m in left)

    @property
    def awaits_batteries(self) -> bool:
        """Whether nobody surveys, and somebody may do so again with another battery."""
        if not self._live.awaits_batteries:
            return False
        return any(self._demand.has_way(m) and m.name not in self._sent_home for m in self._live.team)

    @property
    def nobody_to_lead(self) -> bool:
        """Whether those that want legs are all out of reach, and nobody is home yet."""
        team = self._live.team
        if not list(team):
            return True
        somebody_wants_legs = any(self._demand.wants_legs(member) for member in team.surveying)
        return not team.plannable and not self._somebody_is_home and somebody_wants_legs

    def reason(self) -> str:
        """Return in words why nobody goes on."""
        demand, team = self._demand, self._live.team
        left = [m for m in team.surveying if demand.wants_legs(m) or m.ordered or m.ahead]
        if self._done and any(demand.wants_legs(member) for member in left):
            return self._all_seen() if demand.measured else self._with_lines("nobody can fly a further line")
        gave_up = (m for m in team if m.withdrawal is not None and not m.withdrawal.done)
        if any(m.name not in self._sent_home and demand.has_way(m) for m in gave_up):
            return f"nobody surveys any more{left_words(self._spec, team)}"
        words = "every step is done" if self._spec.budget.steps is not None else "everybody has flown its way"
        words = self._with_lines(words)
        words += f" but {', '.join(m.name for m in left)}" if left else ""
        return words + team.missed_words({m.name for m in left})

    def _with_lines(self, words: str) -> str:
        """Return why nobody goes on, in words, and what that says of lines that were asked for."""
        if not self._spec.lines_asked_for:
            return words
        planner = self._planner.planner
        left_m, by_name = planner.lines_left_m(), planner.lines_left()
        named = {name: one_m for name, one_m in by_name.items() if one_m > LEAST_TOLD_M}
        if left_m <= LEAST_TOLD_M or (by_name and not named):
            return LINES_FLOWN
        return f"{words}: {left_m / 1000.0:.2f} km of lines are not flown" + (
            f": {lengths_words(named)}" if named else ""
        )

    def _all_seen(self) -> str:
        but = f" but {self._left_pct:.1f} % of the area, which lines do not see" if self._left_pct >= TOLD_PCT else ""
        return f"nothing is left to ensonify{but}"

    @property
    def _somebody_is_home(self) -> bool:
        """Whether a vehicle has flown its way and is home, or on its way there."""
        return any(
            m.withdrawal is not None and m.withdrawal.response is Response.RETURN and not self._demand.has_way(m)
            for m in self._live.team
        )

    def _absent_s(self, member: Member) -> float:
        """Return for how long a vehicle has been out of reach, as far as anybody looked, on the wall clock."""
        now_s = asyncio.get_running_loop().time()
        if member.controllable:
            self._absent_since_s.pop(member.name, None)
            return 0.0
        return now_s - self._absent_since_s.setdefault(member.name, now_s)
