"""Vehicles that are flown ahead, without a body: where they are, how far they have come, what came of it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.missions.flight.decisions.decision import Place, planned_way_m, turn_radius_m
from app.missions.flight.legs.commit import STILL_M
from app.missions.flight.own_legs import HARDLY_BEGUN, LEAST_WAY_M
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member


@dataclass(frozen=True)
class WholeSurvey:
    """What a survey with swath sonars came to that was flown on until nothing was left to ensonify.

    Attributes
    ----------
    ways_m : (k, 2) each
        The ends of everybody's legs, from where it began.
    clocks_s : (k,) each
        When it was there.
    distances_m
        Length of everybody's way, turns included.
    drawn_out
        How many times as much the whole is, where not all of it was flown for want of time; else 1.
    coverage_pct
        Share that is ensonified in the end.
    within_budget
        Whether all was done before anybody's way was used up.
    """

    ways_m: dict[str, FloatArray]
    clocks_s: dict[str, FloatArray]
    distances_m: dict[str, float]
    drawn_out: float
    coverage_pct: float
    within_budget: bool


@dataclass(frozen=True)
class Flown:
    """What one flight came to. ``steps`` is less than asked for when the time was up; then the rest is drawn out.

    ``distances_m`` has every vehicle's way, ``remaining_pct`` the landmarks that are not known in the end.
    """

    duration_s: float
    distances_m: dict[str, float]
    coverage_pct: float
    remaining_pct: float
    mean_sd_m: float | None
    steps: int
    whole: WholeSurvey | None = None
    """Where swath sonars ensonify an area: all of it, whatever the budget."""

    def with_whole(self, whole: WholeSurvey) -> "Flown":
        """Return the same with what the whole survey takes."""
        return replace(self, whole=whole)


@dataclass(frozen=True)
class StepFlown:
    """How far vehicles have come after a step: metres each, (vehicles,), and the vehicles' seconds."""

    step: int
    distance_m: FloatArray
    seconds: float
    left_m: float
    """How far all of them together may still fly."""
    here_m: FloatArray
    """Where their legs end, (vehicles, 2): east, north."""


class Swarm:
    """Vehicles without a body: straight legs at their speed, and a while for every turn.

    Attributes
    ----------
    here : (n, 3)
        Where their last legs end.
    heading_rad, clock_s, distance_m, left_m : (n,)
        Their course then (NaN: none yet), when that is, and how far they have come and may still go.
    legs : (n,)
        How many they had.
    """

    def __init__(self, spec: MissionSpec, members: list[Member], starts_m: FloatArray, first_step: int) -> None:
        self._spec, self._members = spec, members
        self._speed_mps = np.array([spec.speed_of(member.spec) for member in members])
        self._radius_m = np.array([turn_radius_m(spec, member.spec) for member in members])
        n = len(members)
        self.here = np.column_stack([starts_m, np.zeros(n)])
        self.heading_rad = np.full(n, np.nan)
        self.clock_s, self.distance_m = np.zeros(n), np.zeros(n)
        self.legs = np.full(n, first_step - 1)
        if spec.budget.steps is not None:
            self.left_m = np.full(n, max(spec.steps - first_step + 1, 0) * spec.limits.max_step_m)
        else:
            self.left_m = np.array([member.way_left_m(spec) for member in members])

    def flown(self, step: int) -> StepFlown:
        """Return how far they have come after a step."""
        left_m, seconds = float(self.left_m.sum()), float(self.clock_s.max())
        return StepFlown(step, self.distance_m.copy(), seconds, left_m, self.here[:, :2].copy())

    def due(self, *, apart: bool) -> BoolArray:
        """Return who gets the next leg, (n,): all together, or who ends its last one first, with those right after."""
        able = self.left_m > LEAST_WAY_M
        if not apart or not able.any():
            return able
        soon_s = self.clock_s[able].min() + HARDLY_BEGUN * self._spec.limits.max_step_m / self._speed_mps
        return np.asarray(able & (self.clock_s <= soon_s))

    def places(self, due: BoolArray) -> list[Place]:
        """Return where legs begin, for a decision."""
        return [
            Place(
                member.name,
                self.here[i, :2],
                float(self.heading_rad[i]),
                member.cruise_depth_m(self._spec.limits),
                keeps_depth=member.capabilities.keeps_depth,
                moving=bool(due[i]),
                left_m=planned_way_m(self._spec, float(self.left_m[i])),
                altitude_m=member.altitude_m,
            )
            for i, member in enumerate(self._members)
        ]

    def radius_m(self, i: int) -> float:
        """Return the radius of one vehicle's turning circle."""
        return float(self._radius_m[i])

    def flew(self, i: int, end: FloatArray, heading_rad: float, way_m: float) -> None:
        """Note that one vehicle came to the end of its leg, (3,), by a way of its own; the leg counts, not the way."""
        leg_m = float(np.hypot(*(end[:2] - self.here[i, :2])))
        counts_m = self._spec.limits.max_step_m if self._spec.budget.steps is not None else leg_m
        self.left_m[i] = max(self.left_m[i] - counts_m, 0.0)
        self.legs[i] += 1
        self.heading_rad[i] = heading_rad
        self.distance_m[i] += way_m
        self.clock_s[i] += way_m / self._speed_mps[i]
        self.here[i] = end

    def fly(self, i: int, end: FloatArray) -> None:
        """Bring one vehicle to the end of its leg, (3,)."""
        east, north = end[:2] - self.here[i, :2]
        leg_m, step_m = float(np.linalg.norm(end - self.here[i])), self._spec.limits.max_step_m
        if math.hypot(east, north) > 0.0:
            course = math.atan2(east, north)
            turn = 0.0 if np.isnan(self.heading_rad[i]) else abs(math.remainder(course - self.heading_rad[i], math.tau))
            self.heading_rad[i] = course
            self.clock_s[i] += turn * self._radius_m[i] / self._speed_mps[i]
        counts_m = step_m if self._spec.budget.steps is not None or leg_m <= STILL_M else leg_m
        self.left_m[i] = max(self.left_m[i] - counts_m, 0.0)
        self.legs[i] += 1
        self.distance_m[i] += leg_m
        self.clock_s[i] += (counts_m if leg_m <= STILL_M else leg_m) / self._speed_mps[i]
        self.here[i] = end
