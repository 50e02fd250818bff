"""Vehicles that are flown ahead: where they are, how far they have come, what came of it."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.motion.leg_rules import HARDLY_BEGUN
from app.exploration.planner.ordered import OrderedPlanner
from app.missions.flight.decisions.leg import Place
from app.missions.flight.steering import steered
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.task.planner import make_planner
from app.missions.task.way import STILL_M, least_way_m, planned_way_m
from app.missions.team import Member
from simulator.vehicles.vehicle import VehicleLimits

LEAST_RADIUS_M = 0.5

REACTS_S, LEAST_ARRIVAL_M = 0.25, 0.5
"""So long after it has arrived a vehicle turns to its next leg; it arrives within so many metres all the same."""

STILL_S = 1.0
"""So long takes a leg that ends where it begins: its vehicle is there at once."""


@dataclass(frozen=True)
class SoFar:
    """What was done of a mission that is flown ahead from there.

    Attributes
    ----------
    first_step
        The first step that is still to be decided.
    prior, soundings : (n, 4)
        What was imported, and what the mission sounded itself: east, north, depth, deviation.
    memory
        What its planner had in mind; empty: nothing.
    """

    first_step: int = 1
    prior: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    soundings: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    memory: bytes = b""

    @property
    def rows(self) -> FloatArray:
        """All soundings, (n, 4)."""
        return np.concatenate([self.prior, self.soundings])


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
class FlightOutcome:
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

    def with_whole(self, whole: WholeSurvey) -> "FlightOutcome":
        """Return the outcome together with what the whole survey takes."""
        return replace(self, whole=whole)


@dataclass(frozen=True)
class StepFlown:
    """How far vehicles have come when the last of them ends a step: metres each, (vehicles,), and their seconds."""

    step: int
    distance_m: FloatArray
    seconds: float
    left_m: float
    """How far all of them together may still fly."""
    here_m: FloatArray
    """Where their legs end, (vehicles, 2): east, north."""


class Swarm:
    """Vehicles that steer for the ends of their legs in their turning circles, at their speed and in still water.

    Attributes
    ----------
    here : (n, 3)
        Where their last legs end.
    heading_rad, clock_s, distance_m, left_m : (n,)
        The course of those legs (NaN: none yet), when they are flown, and how far they have come and may still go.
    legs : (n,)
        How many they had.
    """

    def __init__(self, spec: MissionSpec, members: list[Member], starts_m: FloatArray, first_step: int = 1) -> None:
        self._spec, self._members = spec, members
        self._speed_mps = np.array([spec.speed_of(member.spec) for member in members])
        self._radius_m = np.array([circle_m(spec, member.spec) for member in members])
        n = len(members)
        self.here = np.column_stack([starts_m, np.zeros(n)])
        # Not everyone tells where it heads.
        headings = [None if m.report is None else m.report.heading_rad for m in members]
        self.heading_rad = np.array([np.nan if heading is None else heading for heading in headings])
        self._poses = [
            (float(start[0]), float(start[1]), float(heading))
            for start, heading in zip(starts_m, self.heading_rad, strict=True)
        ]
        self.clock_s, self.distance_m = np.zeros(n), np.zeros(n)
        self.legs = np.full(n, first_step - 1)
        self._held = np.zeros(n, dtype=bool)
        self._ends_at_home = np.array([spec.ends_at_home(member.spec) for member in members])
        if spec.budget.steps is not None:
            self._most_m = np.full(n, max(spec.steps - first_step + 1, 0) * spec.limits.max_step_m)
        else:
            self._most_m = np.array([member.way_left_m(spec) for member in members])
        self._counted_m, self._ahead_m = np.zeros(n), np.zeros(n)
        """What legs took of that, and how long those were that vehicles had already."""
        self.left_m = self._most_m.copy()

    def flown(self, step: int) -> StepFlown:
        """Return how far they have come after a step."""
        left_m, seconds = float(self.left_m.sum()), float(self.clock_s.max())
        return StepFlown(step, self.circled_m(self.clock_s), seconds, left_m, self.here[:, :2].copy())

    def lift_budget(self) -> None:
        """Let them fly as far as there is anything to do."""
        self._most_m[:] = self.left_m[:] = math.inf

    def end(self, i: int) -> None:
        """Let one vehicle be done, whatever it has left."""
        self._most_m[i], self.left_m[i] = self._counted_m[i], 0.0

    def circled_m(self, ended_s: FloatArray) -> FloatArray:
        """Return how far each comes, (vehicles,), until the last one has ended.

        From when it ended on it goes on in circles, unless it has flown its way and goes home then.
        """
        circles = ~self._ends_at_home | (self.left_m > least_way_m(self._spec))
        way_m: FloatArray = self.distance_m + circles * (ended_s.max() - ended_s) * self._speed_mps
        return way_m

    def due(self, *, apart: bool) -> BoolArray:
        """Return who gets the next leg, (n,): all together, or who ends its last one first, with those right after."""
        able = self.left_m > least_way_m(self._spec)
        if not apart or not able.any():
            return able
        first = int(np.argmin(np.where(able, self.clock_s, np.inf)))
        if self._held[first]:
            # Who held because of others goes on alone: together they would hold for ever.
            return np.asarray(np.arange(len(able)) == first)
        soon_s = self.clock_s[first] + HARDLY_BEGUN * self._spec.limits.max_step_m / self._speed_mps
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

    def legs_ahead(self, i: int) -> list[FloatArray]:
        """Return the ends, (3,) each, of the legs that one vehicle has already."""
        member = self._members[i]
        depth_m = member.cruise_depth_m(self._spec.limits)
        return [np.append(end, depth_m) for end in member.legs_ahead_m()]

    def is_there(self, i: int, end: FloatArray) -> bool:
        """Return whether a leg that ends there, (3,), leads nowhere."""
        return math.hypot(*(end[:2] - self.here[i, :2])) <= STILL_M

    def fly(self, i: int, end: FloatArray, *, ahead: bool = False) -> FloatArray:
        """Let one vehicle fly to where its leg ends, (3,); return its poses, (n, 4): east, north, heading, depth.

        ``ahead``: the leg was its already, and no longer counts.
        """
        leg = end[:2] - self.here[i, :2]
        leg_m = math.hypot(*leg)
        still = self._held[i] = self.is_there(i, end)
        poses, way_m = np.zeros((0, 3)), 0.0
        if not still:
            self.heading_rad[i] = math.atan2(*leg)
            arrival_m = max(self._spec.arrival_radius_m - REACTS_S * float(self._speed_mps[i]), LEAST_ARRIVAL_M)
            to_m, radius_m = (float(end[0]), float(end[1])), float(self._radius_m[i])
            poses, ways_m = steered(self._poses[i], to_m, radius_m, arrival_m)
            way_m = float(ways_m[-1])
        if len(poses):
            self._poses[i] = (float(poses[-1, 0]), float(poses[-1, 1]), float(poses[-1, 2]))
        if not ahead:
            counts_m = self._spec.limits.max_step_m if self._spec.budget.steps is not None or still else leg_m
            self._counted_m[i] += counts_m
            self.legs[i] += 1
        else:
            self._ahead_m[i] += leg_m
        self.distance_m[i] += way_m
        self.clock_s[i] += STILL_S if still else way_m / self._speed_mps[i]
        self.here[i] = end
        late_m = 0.0
        if self._spec.budget.minutes is not None:
            come_m = self._ahead_m[i] + self._counted_m[i]
            late_m = max(float(self.clock_s[i] * self._speed_mps[i] - come_m), 0.0)
        self.left_m[i] = max(float(self._most_m[i] - self._counted_m[i]) - late_m, 0.0)
        return np.column_stack([poses, np.full(len(poses), end[2])])


def circle_m(spec: MissionSpec, vehicle: VehicleSpec) -> float:
    """Return the radius of the circles that a vehicle turns in: as stated, else a LAUV's; planners allow for more."""
    stated_m = vehicle.turn_radius_m or spec.planner.options.turn_radius_m
    return max(stated_m or spec.speed_of(vehicle) / VehicleLimits().turn_rate_radps, LEAST_RADIUS_M)


def planner_of(spec: MissionSpec, so_far: SoFar) -> OrderedPlanner:
    """Return a mission's planner with what it had in mind, as far as it can read that."""
    planner = OrderedPlanner(make_planner(spec))
    if so_far.memory:
        try:
            planner.restore(so_far.memory)
        except ValueError:
            return OrderedPlanner(make_planner(spec))
    return planner


def poses_apart(poses: FloatArray, apart_m: float) -> FloatArray:
    """Return the poses (m, k) along a way (n, k), east and north first, that lie so far apart; the last is there."""
    if len(poses) < 2:
        return poses
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    at_m = np.arange(way_m[-1], 0.0, -apart_m)[::-1]
    return np.column_stack([np.interp(at_m, way_m, column) for column in poses.T])
