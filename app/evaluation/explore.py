"""Runs of the papers' scenario, planner by planner."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.evaluation.cube_world import DEEPEST, SHALLOWEST, ExploreScenario, World
from app.evaluation.osarses import Osarses
from app.evaluation.tries import GradientTrier, Trier
from app.exploration.options import PlannerOptions
from app.exploration.planners import ONLY_IN_SIMULATION, PLANNERS, create_planner
from app.exploration.planners.base import PlannerBase
from app.exploration.problem import Situation

OSARSES, TRIED_SPSA, TRIED_FDSA = ONLY_IN_SIMULATION
EXPLORERS = (*sorted(PLANNERS), *ONLY_IN_SIMULATION)


@dataclass(frozen=True)
class ExploreRun:
    """What came of a run; names as in the command's JSON.

    ``robots`` is the team at the start; ``broken_constraints`` counts the steps of single vehicles that broke a limit.
    """

    planner: str
    terrain: str
    seed: int
    robots: int
    landmarks: int
    steps: int
    remaining_pct: float
    t99: int | None
    sum_of_error: float
    history: list[float]
    distance: float
    wall_s: float
    plan_ms_median: float
    plan_ms_p99: float
    real_tries: int
    broken_constraints: int


def run_explore(
    scenario: ExploreScenario,
    planner: str,
    options: PlannerOptions,
    progress: Callable[[int], None] = lambda step: None,
) -> ExploreRun:
    """Run the closed loop with one of ``EXPLORERS``; ``osarses`` makes ``options.tries`` real tries per step."""
    began = time.perf_counter()
    world = World(scenario)
    noise, choice = (np.random.default_rng([scenario.seed, k]) for k in (1, 2))
    chooser = _chooser(planner, options, world, noise)
    world.landmarks = world.measure(world.positions, world.landmarks, noise)
    history, plan_s, distance, broken = [], [], 0.0, 0
    for step in range(1, scenario.steps + 1):
        world.change_team(step)
        situation = Situation(
            step,
            scenario.steps,
            world.names,
            world.positions,
            np.full(len(world.team), np.nan),
            world.belief,
            np.zeros((0, 2)),
            scenario.constraints,
        )
        t0 = time.perf_counter()
        proposal = chooser.propose(situation, choice)
        plan_s.append(time.perf_counter() - t0)
        positions = world.clear(proposal.positions)
        broken += world.broken(positions)
        distance += float(np.linalg.norm(positions - world.positions, axis=1).sum())
        world.positions = positions
        world.landmarks = world.measure(positions, world.landmarks, noise)
        history.append(100.0 * float(1.0 - world.landmarks.accurate.mean()))
        progress(step)
    below = np.flatnonzero(np.array(history) <= 1.0)
    unseen = (DEEPEST + SHALLOWEST) / 2
    error = np.abs(np.nan_to_num(world.landmarks.depth_m, nan=unseen) - world.truth[:, 2]).sum()
    return ExploreRun(
        planner=planner,
        terrain=scenario.terrain.name,
        seed=scenario.seed,
        robots=scenario.robots,
        landmarks=len(world.truth),
        steps=scenario.steps,
        remaining_pct=history[-1],
        t99=int(below[0]) + 1 if len(below) else None,
        sum_of_error=float(error),
        history=history,
        distance=distance,
        wall_s=time.perf_counter() - began,
        plan_ms_median=1e3 * float(np.median(plan_s)),
        plan_ms_p99=1e3 * float(np.quantile(plan_s, 0.99)),
        real_tries=chooser.real_tries if isinstance(chooser, Trier) else 0,
        broken_constraints=broken,
    )


def _chooser(planner: str, options: PlannerOptions, world: World, noise: np.random.Generator) -> PlannerBase | Trier:
    if planner == OSARSES:
        return Osarses(world, options.tries, noise, options.objective)
    if planner in (TRIED_SPSA, TRIED_FDSA):
        return GradientTrier("spsa" if planner == TRIED_SPSA else "fdsa", world, noise, options.objective)
    return create_planner(planner, options, world.scenario.sensor)
