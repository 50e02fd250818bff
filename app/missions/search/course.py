"""How the flight serves a search: scans before decisions, the time that is left, obstacles on the way, the end."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.site_search import SearchTask
from app.exploration.site_search.ground import Ground
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
"""Decisions in a row that send nobody anywhere while all are at the entry: nothing is left to do."""


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
            self.travelled_m += longest_m
            self.travelled_s += vehicle_s

    def away(self, team: Sequence[Member]) -> list[str]:
        """Return the vehicles that are not back at the entry."""
        radius_m = self.search.home_radius_m(len(team))
        return [m.name for m in team if self.search.way_to_entry_m(m.place_m(self.frame)) > radius_m]

    def over(self, team: Sequence[Member], homebound: int) -> bool:
        """Return whether everybody is back and has nothing more to do, or no time for it."""
        if not team or self.away(team):
            return False
        little = LITTLE * self.search.spec.window_s
        return homebound >= len(team) or self.idle >= IDLE_STEPS or self.search.left_s() <= little


def hold_before_hazards(
    task: SearchTask, names: Sequence[str], origin: FloatArray, proposed: FloatArray
) -> tuple[FloatArray, list[str]]:
    """Return the positions (n, 3) with everybody held whose leg comes too near to a hazard, and what to tell of that.

    Planners keep off by themselves; this is the check that does not trust them.
    """
    ground, checked, notes = Ground.for_legs(replace(task, spare_m=0.0)), proposed.copy(), []
    for i, name in enumerate(names):
        still = np.hypot(*(proposed[i, :2] - origin[i, :2])) <= 0.0
        if not still and np.isfinite(proposed[i]).all() and not ground.clear(origin[i, :2], proposed[i : i + 1, :2])[0]:
            checked[i] = origin[i]
            notes.append(
                f"{name}: its leg comes closer than {task.safety_m:g} m to an obstacle or to what nobody has looked "
                "at; the vehicle holds instead"
            )
    return checked, notes
