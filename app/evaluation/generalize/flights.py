"""The six tasks as they are flown over one floor; each function is one of them."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from app.estimation.swath import SwathSonar
from app.evaluation.coverage.surveys import fly_fixed, fly_ours
from app.evaluation.coverage.world import CoverageScenario, cell_by_depth_m, outcome
from app.evaluation.explore.run import ExploreRun, run_explore
from app.evaluation.explore.world import CubeTerrain, ExploreScenario
from app.evaluation.generalize.site import site_of
from app.evaluation.generalize.trial import Recorder, Trial, rounded, thinned
from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.pcao.simulation.world import SeaFloor
from app.evaluation.search.run import HOME_M
from app.evaluation.search.world import SearchScenario, explored_pct, fully_explored, run_search
from app.evaluation.survey.run import best_even_survey, even_coverage, fly_pattern, judge
from app.evaluation.survey.world import SurveyScenario, fly_planner
from app.evaluation.track.run import run_track
from app.evaluation.track.world import TrackScenario
from app.exploration.lines.lawnmower import lawnmower_routes
from app.exploration.pcao.model import default_model
from app.exploration.planner.options import PlannerOptions
from simulator.floors.terrain import Terrain

Size = Literal["full", "quick"]
Flight = Callable[[Terrain, int, Size], Trial]
"""A task over a floor with a seed, in full or in a small version."""

MOST_LEFT_PCT = 1.0
TRACKED_PCT = 90.0
PUBLISHED_GOAL_PCT = 88.88
"""What CAO explores of the goal area of ACCESS13's first car park, r_c = 50."""
EXPLORE_RATIO, SURVEY_RATIO, FIXED_RATIO = 0.85, 1.05, 1.02


def explore(floor: Terrain, seed: int, size: Size) -> Trial:
    """Steps to 99 % of the landmarks: the default planner beside the formation lawnmower.

    A run that does not get there counts as one step more than it had.
    """
    scenario = _landmarks(floor, seed, size)
    options = PlannerOptions() if size == "full" else PlannerOptions(rollouts=8)
    seen, half = Recorder(), CubeTerrain(floor).half
    ours = run_explore(scenario, "rollout", options, observe=seen)
    lines = run_explore(scenario, "lawnmower", PlannerOptions())
    steps = [scenario.steps + 1 if run.t99 is None else run.t99 for run in (ours, lines)]
    facts = {
        "left_pct": ours.remaining_pct, "left_by_yardstick_pct": lines.remaining_pct,
        "broken": float(ours.broken_constraints), "broken_by_yardstick": float(lines.broken_constraints),
    }  # fmt: skip
    kept = steps[0] <= EXPLORE_RATIO * steps[1]
    return Trial(float(steps[0]), float(steps[1]), kept, facts, seen.tracks(half), seen.missed(half))


def pcao(floor: Terrain, seed: int, size: Size) -> Trial:
    """Landmarks that the shipped controller leaves, in %: the more of the paper's scenario and of a linked team's."""
    scenario = _landmarks(floor, seed, size)
    sea_floor = SeaFloor(floor)
    task = TrainingTask((sea_floor,), (seed,), landmarks=scenario.landmarks or 0, steps=scenario.steps, visiting=True)
    remaining, _ = task.run(sea_floor, seed, default_model().parameters)
    paper = 100.0 * float(remaining[-1]) / task.landmarks
    seen, half = Recorder(), sea_floor.cube.half
    linked: ExploreRun = run_explore(scenario, "pcao", PlannerOptions(), observe=seen)
    left = max(paper, linked.remaining_pct)
    facts = {"paper_left_pct": paper, "linked_left_pct": linked.remaining_pct}
    facts |= {"broken": float(linked.broken_constraints), "fallback_steps": float(linked.fallback_steps)}
    kept = left <= MOST_LEFT_PCT + 1e-9
    return Trial(left, MOST_LEFT_PCT, kept, facts, seen.tracks(half), seen.missed(half))


def track(floor: Terrain, seed: int, size: Size) -> Trial:
    """Landmarks that are left of MED13's 1000 while two targets are tracked, in %."""
    small = size == "quick"
    scenario = TrackScenario(floor, landmarks=60 if small else 1000, steps=6 if small else 500, seed=seed)
    seen, half = Recorder(), CubeTerrain(floor).half
    run = run_track(scenario, "rollout", PlannerOptions(rollouts=4 if small else 100), observe=seen)
    tracked = run.target_tracked_pct
    facts = {} if tracked is None else {"tracked_pct": tracked}
    kept = run.remaining_pct <= MOST_LEFT_PCT + 1e-9 and (tracked is None or tracked >= TRACKED_PCT)
    return Trial(run.remaining_pct, MOST_LEFT_PCT, kept, facts, seen.tracks(half), seen.missed(half))


def search(floor: Terrain, seed: int, size: Size) -> Trial:
    """Part of the goal area that is not explored when the time is up, in %, beside what the paper's CAO leaves."""
    world = site_of(floor)
    window_m = 1500.0 if size == "full" else 40.0
    scenario = SearchScenario(world, goal_radius_m=50.0, window_m=window_m, seed=seed)
    flown = run_search(scenario, "rollout", PlannerOptions())
    north, east = (np.indices(world.solid.shape) + 0.5) * world.cell_m
    goal = np.hypot(east - world.goal_m[0], north - world.goal_m[1]) <= scenario.goal_radius_m
    whole = fully_explored(scenario)
    away = np.hypot(*(flown.positions_m[-1, :, :2] - world.entry_m).T)
    back = bool(away.max() <= HOME_M * scenario.robots and flown.left_m[-1] >= -1e-6)
    facts = {
        "map_left_pct": 100.0 - explored_pct(flown.grid, whole), "back_in_time": float(back),
        "collisions": float(flown.collisions),
    }  # fmt: skip
    unseen = 100.0 - explored_pct(flown.grid, whole & goal)
    extent = np.array(world.size_m)
    return Trial(
        unseen, 100.0 - PUBLISHED_GOAL_PCT, unseen <= 100.0 - PUBLISHED_GOAL_PCT and back and not flown.collisions,
        facts, thinned(flown.positions_m[:, :, :2].transpose(1, 0, 2) / extent),
    )  # fmt: skip


def survey(floor: Terrain, seed: int, size: Size) -> Trial:
    """RMSE of the map in metres: the default planner beside the best of three patterns of the same length."""
    steps = 200 if size == "full" else 12
    scenario = SurveyScenario(floor, 2, steps, 2.5, "continuous", seed=seed)
    flown = fly_planner(scenario, "cao", PlannerOptions())
    ours = judge(scenario, flown.soundings, flown.distance_m)
    limit = float(flown.distance_m.mean())
    usual = lawnmower_routes(scenario.constraints, scenario.starts_m[:, :2], np.full(scenario.vehicles, limit))
    even = best_even_survey(scenario, limit)
    patterns = [usual, even_coverage(scenario, limit), *([] if even is None else [even])]
    pattern = float(np.nanmin([fly_pattern(scenario, routes, limit).rmse_m for routes in patterns]))
    extent = np.array([floor.width_m, floor.height_m])
    tracks = thinned(flown.positions_m[:, :, :2].transpose(1, 0, 2) / extent)
    return Trial(ours.rmse_m, pattern, ours.rmse_m <= SURVEY_RATIO * pattern, {}, tracks)


def coverage(floor: Terrain, seed: int, size: Size) -> Trial:
    """Kilometres of full coverage beside fixed lines whose spacing knows the shoalest depth."""
    sonar = SwathSonar(math.radians(120.0), 256 if size == "full" else 32, 5.0, 100.0)
    cell_m = cell_by_depth_m(floor) if size == "full" else 4.0
    scenario = CoverageScenario(floor, 2, sonar, cell_m, seed=seed)
    fleet = fly_ours(scenario)
    ours, fixed = outcome(fleet), outcome(fly_fixed(scenario))
    facts = {
        "ensonified_pct": ours.ensonified_pct,
        "holidays": float(ours.holidays),
        "holidays_by_yardstick": float(fixed.holidays),
        "dense_pct": ours.density_ok_pct,
    }
    extent = np.array([floor.width_m, floor.height_m])
    tracks = [rounded(np.reshape(craft.ends_m, (-1, 2)) / extent) for craft in fleet.crafts.values()]
    rows, cols = np.nonzero(fleet.wanted & ~fleet.density.ensonified)
    missed = np.column_stack([scenario.grid.east_m[cols], scenario.grid.north_m[rows]]) / extent
    kept = ours.km <= FIXED_RATIO * fixed.km and ours.holidays == 0
    return Trial(ours.km, fixed.km, kept, facts, tracks, rounded(missed))


def _landmarks(floor: Terrain, seed: int, size: Size) -> ExploreScenario:
    if size == "quick":
        return ExploreScenario(floor, landmarks=60, steps=12, seed=seed)
    return ExploreScenario(floor, seed=seed)
