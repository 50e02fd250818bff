"""Runs of the dynamic case, planner by planner."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.evaluation.runs.summary import first_step
from app.evaluation.track.trace_greedy import TRACE_GREEDY, TraceGreedy
from app.evaluation.track.world import TrackScenario, TrackWorld
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS, create_planner

TRACKERS = (*sorted(PLANNERS), TRACE_GREEDY)
SETTLED_AFTER = 100
"""Steps after which the figures of tracking begin."""

CHI3_99 = 3.37
"""An error norm beyond this many standard deviations (the same along all axes) happens by chance once in a hundred."""


class Chooser(Protocol):
    """What decides: a planner, or a yardstick."""

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return the next configuration."""
        ...


@dataclass(frozen=True)
class TrackRun:
    """What came of a run; names as in the command's JSON.

    ``sum_of_error``, ``sum_of_cost``, ``final_cost`` and ``remaining`` are MED13's four criteria: the norm of the error
    of all landmarks and targets summed over the steps, J summed over the steps, J at the end, and how many landmarks
    are not accurately known at the end. ``target_tracked_pct`` and ``target_error`` count from step 100 on. A
    ``needless`` rising came before it was needed. ``wrongly_accurate_pct``: landmarks of ``A`` that are farther from
    their estimates than ``CHI3_99`` times the accuracy that ``A`` asks for. ``accurate_nees``: mean squared error of
    the landmarks of ``A``, normalised by their claimed covariances (3 while these hold, more where the filter is too
    sure); None where ``A`` is empty. ``error`` is the norm of the landmarks' error per step.
    ``broken_constraints`` counts the steps of single vehicles that broke a limit as they were flown, which may not be
    as they were sent: altimeters lift vehicles off ground that lies higher than estimated.
    """

    planner: str
    setup: str
    seed: int
    robots: int
    landmarks: int
    targets: int
    steps: int
    remaining_pct: float
    remaining: int
    t99: int | None
    sum_of_error: float
    sum_of_cost: float
    final_cost: float
    target_tracked_pct: float | None
    target_error: float | None
    localization_ok_pct: float | None
    localization_error_max: float | None
    resurfacings: int
    needless_resurfacings: int
    wrongly_accurate_pct: float
    accurate_nees: float | None
    history: list[float]
    error: list[float]
    distance: float
    wall_s: float
    plan_ms_median: float
    plan_ms_p99: float
    broken_constraints: int


def run_track(
    scenario: TrackScenario,
    planner: str,
    options: PlannerOptions,
    setup: str = "own",
    progress: Callable[[int], None] = lambda step: None,
    observe: Callable[[FloatArray, BoolArray, FloatArray], None] = lambda positions, accurate, landmarks: None,
) -> TrackRun:
    """Run the closed loop with one of ``TRACKERS``; ``observe`` as in ``run_explore`` of the exploration room."""
    began = time.perf_counter()
    options = options.model_copy(update={"accuracy_sd_m": scenario.accuracy})
    world = TrackWorld(scenario)
    noise, choice = (np.random.default_rng([scenario.seed, k]) for k in (1, 2))
    chooser: Chooser = (
        TraceGreedy(world) if planner == TRACE_GREEDY else create_planner(planner, options, scenario.sensor)
    )
    world.sense(noise)
    history: list[float] = []
    landmark_error: list[float] = []
    plan_s: list[float] = []
    tracked: list[float] = []
    target_error: list[float] = []
    lost: list[float] = []
    distance, error, cost, broken = 0.0, 0.0, 0.0, 0
    for step in range(1, scenario.steps + 1):
        situation = world.situation(step)
        t0 = time.perf_counter()
        proposal = chooser.propose(situation, choice)
        plan_s.append(time.perf_counter() - t0)
        before = world.estimated.copy()
        distance += float(world.move(proposal.positions).sum())
        # A drift that is made up for in a vehicle's reckoning is no step of its own.
        after = world.estimated if scenario.fading is None else proposal.positions
        broken += len({v.vehicle for v in scenario.constraints.violations(world.names, before, after)})
        world.pass_time()
        world.sense(noise)
        history.append(100.0 * float(1.0 - world.known.accurate.mean()))
        errors = world.landmark_errors()
        landmark_error.append(float(np.linalg.norm(errors)))
        error += float(np.linalg.norm(np.append(errors, world.target_errors())))
        cost += world.cost()
        lost.append(float(world.localization_errors().max()))
        if step > SETTLED_AFTER and world.tracks:
            tracked.append(float(np.mean([world.target_estimator.accurate(track) for track in world.tracks])))
            target_error.append(float(world.target_errors().mean()))
        observe(world.positions, world.known.accurate, world.truth)
        progress(step)
    fading = scenario.fading is not None
    return TrackRun(
        planner=planner,
        setup=setup,
        seed=scenario.seed,
        robots=scenario.robots,
        landmarks=len(world.truth),
        targets=scenario.targets,
        steps=scenario.steps,
        remaining_pct=history[-1],
        remaining=int((~world.known.accurate).sum()),
        t99=first_step(history),
        sum_of_error=error,
        sum_of_cost=cost,
        final_cost=world.cost(),
        target_tracked_pct=100.0 * float(np.mean(tracked)) if tracked else None,
        target_error=float(np.mean(target_error)) if target_error else None,
        localization_ok_pct=100.0 * float(np.mean(np.array(lost) <= scenario.lost_beyond)) if fading else None,
        localization_error_max=max(lost) if fading else None,
        resurfacings=world.resurfacings,
        needless_resurfacings=world.needless,
        wrongly_accurate_pct=_wrongly_accurate_pct(world),
        accurate_nees=_accurate_nees(world),
        history=history,
        error=landmark_error,
        distance=distance,
        wall_s=time.perf_counter() - began,
        plan_ms_median=1e3 * float(np.median(plan_s)),
        plan_ms_p99=1e3 * float(np.quantile(plan_s, 0.99)),
        broken_constraints=broken,
    )


def _wrongly_accurate_pct(world: TrackWorld) -> float:
    accurate = world.known.accurate
    if not accurate.any():
        return 0.0
    beyond = CHI3_99 * world.scenario.accuracy
    return 100.0 * float((world.landmark_errors()[accurate] > beyond).mean())


def _accurate_nees(world: TrackWorld) -> float | None:
    accurate = world.known.accurate
    if not accurate.any():
        return None
    error = world.known.position_m[accurate] - world.truth[accurate]
    information = np.linalg.pinv(world.known.covariance_m2[accurate], hermitian=True)
    return float(np.einsum("ki,kij,kj->k", error, information, error).mean())
