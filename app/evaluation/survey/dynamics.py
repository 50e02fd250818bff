"""Surveys at sea, in simulated time: vehicles with turning circles fly for as many minutes, every one on its own time.

The rules are those of missions, the code is not: a vehicle has legs ahead of the one that it flies; who will need one
next has it decided from where the last one ends, with the others' legs as they are, and a decision takes its time. The
same vehicles fly the patterns.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation import SingleBeam
from app.evaluation.survey.flown import ARRIVAL_RADIUS_M, FEWER_LINES, LEAST_SD_M, TICK_S
from app.evaluation.survey.world import SPEED_MPS, Log, MapSoFar, SurveyScenario
from app.exploration.core.problem import Belief, Planner, Situation
from app.exploration.motion.leg_rules import AHEAD, HARDLY_BEGUN, LEAST_WAY_M, TURN_S
from app.exploration.motion.on_leg import Place, along_leg
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.mapping.types import Soundings
from simulator.equipment import Equipment
from simulator.sonars.sensors import SonarNoise
from simulator.world import SimulatedVehicle

DECISION_S = 0.5
"""What a decision takes."""
LEAD_M = 4.0
"""A vehicle keeps the leg after the one that it flies where it begins it within so many metres."""
PASSED_WITHIN_M = 8.0
TRIES = 15


@dataclass(frozen=True)
class SeaTrack:
    """What was flown in the same minutes: metres of each vehicle, (vehicles,), in all and along its legs."""

    flown_m: FloatArray
    on_plan_m: FloatArray
    soundings: Soundings
    plan_s: FloatArray
    finished: bool
    """Whether no leg was left when the time was up."""


class _Craft:
    """One vehicle with its legs; ``ends`` (2,) are those of the leg it flies and of the legs ahead."""

    def __init__(self, body: SimulatedVehicle, depth_m: float) -> None:
        self.body, self.depth_m = body, depth_m
        self.ends: list[FloatArray] = []
        self.on_plan_m = 0.0
        self._from = self.place_m

    @property
    def place_m(self) -> FloatArray:
        return np.array(self.body.en_m)

    @property
    def last_end_m(self) -> FloatArray:
        """Where its next leg begins."""
        return self.ends[-1] if self.ends else self.place_m

    @property
    def course_rad(self) -> float:
        """Its heading there."""
        before = self.ends[-2] if len(self.ends) > 1 else self._from
        east, north = self.last_end_m - before
        return float(np.arctan2(east, north)) if self.ends and np.hypot(east, north) > 1e-6 else np.nan

    @property
    def way_ahead_m(self) -> float:
        """How far it is to the end of its last leg."""
        corners = np.array([self.place_m, *self.ends])
        return float(np.hypot(*np.diff(corners, axis=0).T).sum())

    @property
    def left_of_leg_m(self) -> float:
        return float(np.hypot(*(self.ends[0] - self.place_m))) if self.ends else 0.0

    def add(self, end_m: FloatArray) -> None:
        self.ends.append(np.asarray(end_m, dtype=np.float64)[:2])
        if len(self.ends) == 1:
            self._begin()

    def _begin(self) -> None:
        self._leg = (_pair(self._from), _pair(self.ends[0]))
        self.body.go_to(
            *self._leg[1],
            self.depth_m,
            SPEED_MPS,
            arrival_radius_m=ARRIVAL_RADIUS_M,
            pass_within_m=PASSED_WITHIN_M,
        )

    def advance(self, log: Log, relative_noise: float) -> None:
        """Live for a tick, sound, and go on with the next leg where one was reached."""
        before = self.body.en_m
        for echo in self.body.advance(TICK_S):
            if echo.footprint is not None:
                place = echo.footprint
                log.add(place.east_m, place.north_m, place.depth_m, max(relative_noise * echo.range_m, LEAST_SD_M))
        if not self.ends:
            return
        after = self.body.en_m
        if along_leg(before, after, self._leg):
            self.on_plan_m += math.hypot(after[0] - before[0], after[1] - before[1])
        if self.body.arrived:
            self._from = self.ends.pop(0)
            if self.ends:
                self._begin()


def fly_planner_at_sea(
    scenario: SurveyScenario,
    planner: str,
    options: PlannerOptions,
    minutes: float,
    progress: Callable[[int], None] = lambda step: None,
    known: Belief | None = None,
) -> SeaTrack:
    """Let a planner lead the vehicles for so many minutes; it is given ``known`` instead of what was sounded."""
    until_s, log, crafts = 60.0 * minutes, scenario.log(1), _crafts(scenario, 1)
    turning = options.model_copy(update={"turn_radius_m": options.turn_radius_m or TURN_S * SPEED_MPS})
    chooser = create_planner(planner, turning, SingleBeam(scenario.relative_noise))
    rng, so_far = np.random.default_rng([scenario.seed, 0]), MapSoFar(scenario.belief_grid, known)
    plan_s: list[float] = []
    decided: list[tuple[_Craft, FloatArray]] = []
    ready_s, now_s, step = np.inf, 0.0, 0
    names = tuple(f"auv-{k + 1}" for k in range(scenario.vehicles))
    while now_s < until_s:
        way_left_m = (until_s - now_s) * SPEED_MPS
        if not decided and (due := _due(crafts, scenario.max_step_m, way_left_m)).any():
            if so_far.renew(log, now_s / until_s):
                _take_back(crafts, names, chooser)
                due = _due(crafts, scenario.max_step_m, way_left_m)
            sounded_m, doubtful_m = so_far.sounded(log)
            left_m = np.array([max(way_left_m - craft.way_ahead_m, 0.0) for craft in crafts])
            step += 1
            situation = Situation(
                step,
                max(step, scenario.steps),
                names,
                np.array([[*craft.last_end_m, craft.depth_m] for craft in crafts]),
                np.array([craft.course_rad for craft in crafts]),
                so_far.belief,
                sounded_m,
                scenario.constraints,
                doubtful_en_m=doubtful_m,
                moving=due if chooser.decides_apart else None,
                left_m=left_m,
            )
            begun = time.perf_counter()
            ends = chooser.propose(situation, rng).positions
            plan_s.append(time.perf_counter() - begun)
            going = due if chooser.decides_apart else np.ones(len(crafts), dtype=np.bool_)
            decided = [(craft, end) for craft, end, goes in zip(crafts, ends, going, strict=True) if goes]
            ready_s = now_s + DECISION_S
        for craft in crafts:
            craft.advance(log, scenario.relative_noise)
        now_s += TICK_S
        if decided and now_s >= ready_s:
            for craft, end in decided:
                craft.add(end)
            decided = []
        progress(min(int(scenario.steps * now_s / until_s), scenario.steps))
    return _track(crafts, log, plan_s)


def fly_pattern_at_sea(
    scenario: SurveyScenario, routes_of: Callable[[float], list[FloatArray] | None], minutes: float
) -> SeaTrack:
    """Fly the longest of a pattern's routes that can be finished in so many minutes, turning circles included.

    ``routes_of`` returns every vehicle's route, (k, 2), for a distance that each may fly, None where none fits.
    """
    until_s = 60.0 * minutes
    budget_m, best = until_s * SPEED_MPS, None
    for _ in range(TRIES):
        routes = routes_of(budget_m)
        if routes is None:
            break
        log, crafts = scenario.log(2), _crafts(scenario, 2)
        for craft, route in zip(crafts, routes, strict=True):
            for end in route:
                craft.add(end)
        now_s = 0.0
        while now_s < until_s and any(craft.ends for craft in crafts):
            for craft in crafts:
                if craft.ends:
                    craft.advance(log, scenario.relative_noise)
            now_s += TICK_S
        best = _track(crafts, log, [])
        if best.finished:
            break
        way_m = until_s * SPEED_MPS
        budget_m *= min(FEWER_LINES, *(way_m / (way_m + craft.way_ahead_m) for craft in crafts))
    if best is None:
        return SeaTrack(
            np.zeros(scenario.vehicles),
            np.zeros(scenario.vehicles),
            scenario.log(2).soundings,
            np.zeros(0),
            finished=False,
        )
    return best


def _due(crafts: list[_Craft], leg_m: float, way_left_m: float) -> BoolArray:
    """Return who gets the next leg, (vehicles,): whoever needs one, with those that soon will."""
    needs: BoolArray = np.array([len(craft.ends) <= AHEAD for craft in crafts])
    if not needs.any():
        return needs
    able = np.array([way_left_m - craft.way_ahead_m > LEAST_WAY_M for craft in crafts])
    needs &= able
    if not needs.any():
        return needs
    soon = [len(craft.ends) <= AHEAD + 1 and craft.left_of_leg_m <= HARDLY_BEGUN * leg_m for craft in crafts]
    due: BoolArray = needs | (able & np.array(soon, dtype=np.bool_))
    return due


def _take_back(crafts: list[_Craft], names: tuple[str, ...], chooser: Planner) -> None:
    """Take back the legs that are not begun, where there is time to decide them anew by the newer map."""
    open_legs = {
        name: len(craft.ends) - (1 if craft.left_of_leg_m >= LEAD_M else 2)
        for name, craft in zip(names, crafts, strict=True)
    }
    open_legs = {name: count for name, count in open_legs.items() if count > 0}
    if open_legs and chooser.take_back(open_legs):
        for name, craft in zip(names, crafts, strict=True):
            del craft.ends[len(craft.ends) - open_legs.get(name, 0) :]


def _crafts(scenario: SurveyScenario, stream: int) -> list[_Craft]:
    rng = np.random.default_rng([scenario.seed, 4, stream])
    equipment = Equipment(noise=SonarNoise(scenario.relative_noise))
    return [
        _Craft(
            SimulatedVehicle(f"auv-{i + 1}", scenario.terrain, [*start[:2], 0.0], own, equipment),
            float(start[2]),
        )
        for i, (start, own) in enumerate(zip(scenario.starts_m, rng.spawn(scenario.vehicles), strict=True))
    ]


def _track(crafts: list[_Craft], log: Log, plan_s: list[float]) -> SeaTrack:
    return SeaTrack(
        np.array([craft.body.vehicle.distance_m for craft in crafts]),
        np.array([craft.on_plan_m for craft in crafts]),
        log.soundings,
        np.array(plan_s),
        not any(craft.ends for craft in crafts),
    )


def _pair(place_m: FloatArray) -> Place:
    return float(place_m[0]), float(place_m[1])
