"""ACCESS13's experiment: one search as a run of ``bathyfleet evaluate rescue``."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from app.estimation import Sensor
from app.evaluation.runs.jobs import Progress
from app.evaluation.search.world import SearchScenario, explored_pct, fully_explored, run_search
from app.exploration.planner.options import PlannerOptions

TRAPPED_M, LEFT_PCT = 200.0, 5.0
"""A team is trapped that saw nothing new in at least so much of the window, the last in which it searched, while so
much of what can be seen was left: it never got away. Standstills that it got away from are reported apart.
"""
HOME_M = 3.0
"""Distance to the entry, per robot, within which one is back."""


@dataclass(frozen=True)
class SearchRun:
    """One run; names as in the command's JSON.

    ``goal_area_pct`` and ``map_pct``: explored part of all free cells that a robot could see from anywhere it can get
    to. ``too_close``: legs on which the safety distance was not kept; ``collisions``: legs on which an obstacle was
    touched. ``trapped``: see :data:`TRAPPED_M`. ``longest_standstill_m``: most of the window that went by between one
    new cell and the next. ``plan_cpu_ms``: what the deciding thread computed; on a busy machine a decision takes
    longer.
    """

    planner: str
    scenario: str
    rc: float
    seed: int
    robots: int
    clock: str
    window_m: float
    goal_area_pct: float
    map_pct: float
    returned_in_time: bool
    collisions: int
    too_close: int
    trapped: bool
    longest_standstill_m: float
    way_m: float
    steps: int
    plan_ms_median: float
    plan_ms_p99: float
    plan_cpu_ms_median: float
    plan_cpu_ms_p99: float


@dataclass(frozen=True)
class SearchJob:
    """One run of ``bathyfleet evaluate rescue``; ``key`` distinguishes it in a report."""

    scenario: SearchScenario
    planner: str
    options: PlannerOptions

    @property
    def key(self) -> str:
        """What makes the run what it is."""
        s = self.scenario
        return f"{s.world.name}/{s.goal_radius_m:g}/{self.planner}/{s.clock}/{s.robots}/{s.window_m:g}/{s.seed}"

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        s = self.scenario
        return f"{s.world.name}, r_c {s.goal_radius_m:g}, {self.planner}, seed {s.seed}"

    @property
    def steps(self) -> int:
        """Its length at most."""
        return int(np.ceil(self.scenario.window_m / self.scenario.step_m))

    @property
    def sensor(self) -> Sensor:
        """What its robots measure with."""
        return self.scenario.scanner

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run it."""
        return {"key": self.key, **asdict(run_and_judge(self.scenario, self.planner, self.options, progress))}


def run_and_judge(
    scenario: SearchScenario, planner: str, options: PlannerOptions, progress: Progress = lambda step: None
) -> SearchRun:
    """Run a search and judge it by the truth."""
    track = run_search(scenario, planner, options, progress)
    world = scenario.world
    north, east = (np.indices(world.solid.shape) + 0.5) * world.cell_m
    goal = np.hypot(east - world.goal_m[0], north - world.goal_m[1]) <= scenario.goal_radius_m
    whole = fully_explored(scenario)
    away = np.hypot(*(track.positions_m[-1, :, :2] - world.entry_m).T)
    # A first decision compiles or loads machine code.
    later = slice(1, None) if len(track.plan_s) > 1 else slice(None)
    plan_ms, plan_cpu_ms = 1e3 * track.plan_s[later], 1e3 * track.plan_cpu_s[later]
    seen = explored_pct(track.grid, whole)
    return SearchRun(
        planner=planner,
        scenario=world.name,
        rc=scenario.goal_radius_m,
        seed=scenario.seed,
        robots=scenario.robots,
        clock=scenario.clock,
        window_m=scenario.window_m,
        goal_area_pct=explored_pct(track.grid, whole & goal),
        map_pct=seen,
        returned_in_time=bool(away.max() <= HOME_M * scenario.robots and track.left_m[-1] >= -1e-6),
        collisions=track.collisions,
        too_close=track.too_close,
        trapped=bool(track.last_standstill_m >= TRAPPED_M and 100.0 - seen >= LEFT_PCT),
        longest_standstill_m=track.longest_standstill_m,
        way_m=float(np.linalg.norm(np.diff(track.positions_m, axis=0), axis=2).sum(axis=0).max()),
        steps=len(track.plan_s),
        plan_ms_median=float(np.median(plan_ms)),
        plan_ms_p99=float(np.quantile(plan_ms, 0.99)),
        plan_cpu_ms_median=float(np.median(plan_cpu_ms)),
        plan_cpu_ms_p99=float(np.quantile(plan_cpu_ms, 0.99)),
    )
