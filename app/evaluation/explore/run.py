"""Runs of the papers' scenario, planner by planner."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation import Landmarks
from app.evaluation.explore.oracles import GradientOracle, MoveOracle
from app.evaluation.explore.osarses import Osarses
from app.evaluation.explore.teams import LimitedTeam, UnlimitedTeam
from app.evaluation.explore.world import DEEPEST, SHALLOWEST, ExploreScenario, World, names_of
from app.evaluation.runs.summary import first_step
from app.exploration.core.problem import Situation
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import ONLY_IN_SIMULATION, PLANNERS, create_planner

OSARSES, TRIED_SPSA, TRIED_FDSA = ONLY_IN_SIMULATION
EXPLORERS = (*sorted(PLANNERS), *ONLY_IN_SIMULATION)

UNSEEN_DEPTH = (DEEPEST + SHALLOWEST) / 2
"""Assumed depth of an unseen landmark, where errors are summed."""


@dataclass(frozen=True)
class ExploreRun:
    """What came of a run; names as in the command's JSON.

    ``robots`` is the team at the start; ``broken_constraints`` counts the steps of single vehicles that broke a limit;
    ``sum_of_error`` is AURO15 eq. (25): over all steps, the norm of the error of all landmarks; ``message_bytes`` is
    what vehicles and station sent under limited communication. Of the landmarks that are accurate at the end,
    ``done_nees`` is the mean squared error over its variance (1 where claims hold) and ``done_within_pct`` the share
    whose depth is within the deviation that was asked for; None where there are none.
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
    capacity: int | None
    message_bytes: int
    done_nees: float | None
    done_within_pct: float | None
    fallback_steps: int


def run_explore(
    scenario: ExploreScenario,
    planner: str,
    options: PlannerOptions,
    progress: Callable[[int], None] = lambda step: None,
    observe: Callable[[FloatArray, BoolArray, FloatArray], None] = lambda positions, accurate, landmarks: None,
) -> ExploreRun:
    """Run the closed loop with one of ``EXPLORERS``; ``osarses`` makes ``options.tries`` real tries per step.

    ``observe`` is told after every step where vehicles are, which landmarks are accurate, and where these truly are.

    Those that really try try on everything that is known: they cannot be run with a limited capacity (ValueError).
    """
    if planner in ONLY_IN_SIMULATION and scenario.capacity is not None:
        raise ValueError(f"capacity: {planner} tries its moves on everything that is known; leave the capacity out")
    began = time.perf_counter()
    world = World(scenario)
    noise, choice = (np.random.default_rng([scenario.seed, k]) for k in (1, 2))
    chooser = _chooser(planner, options, world, noise)
    team = (
        LimitedTeam(world, scenario.capacity, scenario.message_loss, np.random.default_rng([scenario.seed, 5]))
        if scenario.capacity is not None
        else UnlimitedTeam(world)
    )
    team.sense(noise)
    history, plan_s, distance, broken, error, fallback_steps = [], [], 0.0, 0, 0.0, 0
    for step in range(1, scenario.steps + 1):
        world.change_team(step)
        vehicles, at, belief = team.report(step)
        situation = Situation(
            step,
            scenario.steps,
            names_of(vehicles),
            at,
            np.full(len(vehicles), np.nan),
            belief,
            np.zeros((0, 2)),
            scenario.constraints,
        )
        t0 = time.perf_counter()
        proposal = chooser.propose(situation, choice)
        plan_s.append(time.perf_counter() - t0)
        fallback_steps += int(proposal.terms.get("fallback", 0.0))
        positions = world.clear(team.order(vehicles, proposal.positions))
        broken += world.broken(positions)
        distance += float(np.linalg.norm(positions - world.positions, axis=1).sum())
        world.positions = positions
        team.sense(noise)
        history.append(100.0 * float(1.0 - team.landmarks.accurate.mean()))
        error += float(np.linalg.norm(np.nan_to_num(team.landmarks.depth_m, nan=UNSEEN_DEPTH) - world.truth[:, 2]))
        observe(world.positions, team.landmarks.accurate, world.truth)
        progress(step)
    nees, within = _claims_of_done(team.landmarks, world.truth, world.estimator.accuracy_sd_m)
    return ExploreRun(
        planner=planner,
        terrain=scenario.terrain.name,
        seed=scenario.seed,
        robots=scenario.robots,
        landmarks=len(world.truth),
        steps=scenario.steps,
        remaining_pct=history[-1],
        t99=first_step(history),
        sum_of_error=error,
        history=history,
        distance=distance,
        wall_s=time.perf_counter() - began,
        plan_ms_median=1e3 * float(np.median(plan_s)),
        plan_ms_p99=1e3 * float(np.quantile(plan_s, 0.99)),
        real_tries=chooser.real_tries if isinstance(chooser, MoveOracle) else 0,
        broken_constraints=broken,
        capacity=scenario.capacity,
        message_bytes=team.sent_bytes,
        done_nees=nees,
        done_within_pct=within,
        fallback_steps=fallback_steps,
    )


def _claims_of_done(landmarks: Landmarks, truth: FloatArray, accuracy_sd: float) -> tuple[float | None, float | None]:
    """Return the NEES of accurate landmarks, and how many lie within the accuracy asked for, in %."""
    done = landmarks.accurate & landmarks.seen
    if not done.any():
        return None, None
    error = landmarks.depth_m[done] - truth[done, 2]
    return float((error**2 / landmarks.variance_m2[done]).mean()), 100.0 * float((abs(error) <= accuracy_sd).mean())


def _chooser(
    planner: str, options: PlannerOptions, world: World, noise: np.random.Generator
) -> PlannerBase | MoveOracle:
    if planner == OSARSES:
        return Osarses(world, options.tries, noise, options.objective)
    if planner in (TRIED_SPSA, TRIED_FDSA):
        return GradientOracle("spsa" if planner == TRIED_SPSA else "fdsa", world, noise, options.objective)
    return create_planner(planner, options, world.scenario.sensor)
