"""How the flight serves a search: scans before decisions, the time that is left, obstacles on the way, the end."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.site_search import SearchTask
from app.exploration.site_search.ground import SiteGround
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.search.state import Search
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member

FIRST_PACE = 0.5
"""Part of the asked speed at which a team is taken to get on before that was measured: it turns, and waits."""
FIRST_STEPS = 10.0
"""Steps that this assumption counts as beside those that were measured."""
RESERVE = 0.1
"""Part of the time that is left which nobody plans with."""
SPARE_STEPS = 0.5
"""Part of a full step that each step that is left counts as on the way home."""
REST_S = 2.0
"""Vehicle time that a decision in which nobody moves waits for a new scan."""
STILL_M = 0.1
LITTLE = 0.05
"""Part of the time window that is not worth going out again for once everybody is back."""
IDLE_STEPS = 3
"""Decisions in a row that send nobody anywhere: the search stands still."""


@dataclass
class Course:
    """One run of a search.

    Attributes
    ----------
    travelled_m, travelled_s
        Length of steps by their longest legs, and the vehicle time they took, stops for turning and deciding among it.
    idle
        Decisions in a row that sent nobody anywhere.
    """

    search: Search
    spec: MissionSpec
    frame: LocalFrame
    travelled_m: float = field(init=False)
    travelled_s: float = field(init=False)
    idle: int = 0
    told_late: bool = False
    told_stuck: bool = False

    def __post_init__(self) -> None:
        self.travelled_m = FIRST_STEPS * self.spec.limits.max_step_m
        self.travelled_s = self.travelled_m / (FIRST_PACE * self.spec.speed_mps)

    @property
    def pace_mps(self) -> float:
        """How fast the team gets on."""
        return min(self.spec.speed_mps, self.travelled_m / self.travelled_s)

    def task(self, step: int, standing_m: FloatArray) -> SearchTask:
        """Return what planners are to see when ``step`` is decided: the way that is left by time and by steps.

        ``standing_m`` (k, 2): where vehicles are that take no part now.
        """
        by_time_m = self.search.left_s() * (1.0 - RESERVE) * self.pace_mps
        by_steps_m = (self.spec.steps - step + 1) * self.spec.limits.max_step_m * SPARE_STEPS
        task = self.search.task(min(by_time_m, by_steps_m), spare_m=self.search.spare_m)
        return replace(task, standing_m=standing_m, apart_m=self.spec.limits.min_separation_m)

    def unseen(self, team: Sequence[Member]) -> list[str]:
        """Return the vehicles whose own place nobody has looked at yet: where to go from there is not known."""
        return [member.name for member in team if not self.search.knows(member.place_m(self.frame))]

    def barred(self, member: Member) -> bool:
        """Return whether something stands on what is left of a vehicle's leg by what is known now."""
        if member.target_m is None or member.report is None:
            return False
        here, end = member.place_m(self.frame), member.target_m
        left_m = float(np.hypot(*(end - here)))
        return left_m > self.spec.arrival_radius_m and not self.search.clear(here, end)

    def note(self, legs_m: FloatArray, vehicle_s: float) -> None:
        """Learn from a step how fast the team gets on; legs (n,)."""
        longest_m = float(legs_m.max(initial=0.0))
        self.idle = 0 if longest_m > STILL_M else self.idle + 1
        if longest_m > STILL_M:
            self.told_stuck = False
            self.travelled_m += longest_m
            self.travelled_s += vehicle_s

    def away(self, team: Sequence[Member]) -> list[str]:
        """Return the vehicles that are not back at the entry."""
        radius_m = self.search.home_radius_m(len(team))
        return [m.name for m in team if self.search.way_to_entry_m(m.place_m(self.frame)) > radius_m]

    @property
    def rest_s(self) -> float:
        """Vehicle time from one decision to the next while nobody moves: no less than a step takes, or none is left."""
        return max(REST_S, self.spec.limits.max_step_m / self.spec.speed_mps)

    def held(self, team: Sequence[Member]) -> bool:
        """Return whether nobody gets a step away from where it is by what is known now, though something is unseen."""
        some = self.search.may_see_more and len(team) > 0
        return some and not any(self.search.gets_away(member.place_m(self.frame)) for member in team)

    @property
    def little_left(self) -> bool:
        """Whether the time that is left is not worth going out again."""
        return self.search.left_s() <= LITTLE * self.search.spec.window_s

    def over(self, team: Sequence[Member], homebound: int, *, homewards: bool) -> str:
        """Return why a search is over: everybody is back and has nothing more to do, or no time for it; else "".

        Parameters
        ----------
        homebound
            Vehicles that its planner sends home for want of time, or of a way.
        homewards
            Whether no view is left to fly to, or its planner comes home by itself.
        """
        if not team or self.away(team):
            return ""
        back = "everybody is back at the entry"
        if self.held(team):
            return f"{back}, where obstacles held them: {self._unseen}" if self.little_left else ""
        if self.idle >= IDLE_STEPS and homewards:
            return back
        if self.little_left:
            return f"{back} and the time is up: {self._unseen}"
        return back if homebound >= len(team) else ""

    @property
    def _unseen(self) -> str:
        figures = self.search.figures
        goal_pct, site_pct = 100.0 * (1.0 - figures.explored_goal_part), 100.0 * (1.0 - figures.explored_part)
        return f"{goal_pct:.0f} % of the goal area and {site_pct:.0f} % of the site were not seen"


def hold_before_hazards(
    task: SearchTask, names: Sequence[str], origin: FloatArray, proposed: FloatArray
) -> tuple[FloatArray, list[str]]:
    """Return the positions (n, 3) with everybody held whose leg comes too near to a hazard, and what to tell of that.

    Planners keep off by themselves; this is the check that does not trust them.
    """
    ground, checked, notes = SiteGround.for_legs(replace(task, spare_m=0.0)), proposed.copy(), []
    for i, name in enumerate(names):
        still = np.hypot(*(proposed[i, :2] - origin[i, :2])) <= 0.0
        if not still and np.isfinite(proposed[i]).all() and not ground.clear(origin[i, :2], proposed[i : i + 1, :2])[0]:
            checked[i] = origin[i]
            notes.append(
                f"{name}: its leg comes closer than {task.safety_m:g} m to an obstacle or to what nobody has looked "
                "at; the vehicle holds instead"
            )
    return checked, notes
