"""How long one planning step of CAO takes, over vehicles, landmarks and candidates, in the papers' cube.

``python -m benchmarks.planning.explore_step [--write]``. Beside the milliseconds stands the time relative to a plain
numpy evaluation of the same candidates, measured in the same run, which does not depend on the machine.
"""

import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from app.estimation import RangeSensor, Sensor, SingleBeam
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner, warm_up
from benchmarks.common.report import PLANNING, make_parser, write_section

STEPS = 15
NUMPY_CANDIDATES = 50
SENSOR = RangeSensor()
VEHICLES, LANDMARKS, CANDIDATES = (2, 4, 6, 8, 10), (1000, 2500, 5000, 10_500), (100, 250, 500, 1000)
CURVES = {
    "vehicles": [(n, 10_500, 1000) for n in VEHICLES],
    "landmarks": [(10, m, 1000) for m in LANDMARKS],
    "candidates": [(10, 10_500, c) for c in CANDIDATES],
}


def cube(vehicles: int, landmarks: int, positions: np.ndarray, k: int) -> Situation:
    """A team in a row above a sea floor of which the half that lies behind it is known."""
    rng = np.random.default_rng(0)
    xy = rng.uniform(-1.0, 1.0, (landmarks, 2))
    depth = 0.6 + 0.2 * np.sin(3.0 * xy[:, 0]) * np.cos(2.0 * xy[:, 1])
    known = xy[:, 1] < 0.0
    belief = Belief(
        xy, np.where(known, depth, np.nan), np.where(known, 0.05, np.inf), np.zeros(landmarks, dtype=np.bool_),
        np.ones(landmarks), 0.2,
    )  # fmt: skip
    area = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    limits = Constraints(area, max_step_m=0.05, min_depth_m=-1.0, max_depth_m=1.0, min_altitude_m=0.05, com_range_m=0.3)
    names = tuple(f"auv-{i:02d}" for i in range(vehicles))
    return Situation(k, 500, names, positions, np.full(vehicles, np.nan), belief, np.zeros((0, 2)), limits)


def row(vehicles: int) -> np.ndarray:
    x = 0.18 * (np.arange(vehicles) - (vehicles - 1) / 2)
    return np.column_stack([x, np.full(vehicles, -0.2), np.full(vehicles, 0.2)])


def plan_ms(vehicles: int, landmarks: int, candidates: int) -> float:
    """Return the median time of a step, ``candidates`` team configurations being weighed."""
    planner = create_planner("cao", PlannerOptions(candidates=max(4, round(candidates / vehicles))), SENSOR)
    positions, times = row(vehicles), []
    for k in range(1, STEPS + 1):
        now = cube(vehicles, landmarks, positions, k)
        begun = time.perf_counter()
        positions = planner.propose(now, np.random.default_rng(k)).positions
        times.append(1e3 * (time.perf_counter() - begun))
    return float(np.median(times))


def numpy_ms(vehicles: int, landmarks: int, candidates: int) -> float:
    """Return the time of judging as many candidates by whole-array numpy, scaled up from a few of them."""
    now = cube(vehicles, landmarks, row(vehicles), 1)
    points = np.column_stack([now.belief.xy_m, np.nan_to_num(now.belief.depth_m, nan=0.6)])
    rng = np.random.default_rng(1)
    moved = now.positions + rng.uniform(-0.02, 0.02, (NUMPY_CANDIDATES, vehicles, 3))
    begun = time.perf_counter()
    for team in moved:
        away = team[:, None, :] - points
        r2 = (away**2).sum(axis=2)
        information = np.where(r2 < SENSOR.visibility_m**2, away[..., 2] ** 2 / (SENSOR.relative_noise * r2) ** 2, 0.0)
        share = information.sum(axis=0) / 2500.0
        _ = np.minimum(share, 1.0).sum() + (share >= 1.0).sum() - np.sqrt(r2.min(axis=1)).sum()
    return 1e3 * (time.perf_counter() - begun) * candidates / NUMPY_CANDIDATES


def survey_ms(vehicles: int, landmarks: int, candidates: int) -> tuple[float, float]:
    """Return median and worst milliseconds of a bathymeter mission; the worst is the first step (the backbone)."""
    sensor: Sensor = SingleBeam()
    planner = create_planner("cao", PlannerOptions(candidates=candidates), sensor)
    position = np.column_stack([2.0 + 5.0 * np.arange(vehicles), np.full(vehicles, 2.0), np.full(vehicles, 2.0)])
    rng = np.random.default_rng(0)
    xy = rng.uniform(0.0, 100.0, (landmarks, 2))
    nothing = np.zeros(landmarks, dtype=np.bool_)
    belief = Belief(xy, np.full(landmarks, 9.0), np.ones(landmarks), nothing, rng.gamma(2.0, 0.5, landmarks), 20.0)
    limits = Constraints(100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), max_step_m=10.0)
    names, headings, times = tuple(f"auv-{i:02d}" for i in range(vehicles)), np.full(vehicles, np.nan), []
    for k in range(1, STEPS + 1):
        now = Situation(k, 60, names, position, headings, belief, np.zeros((0, 2)), limits)
        begun = time.perf_counter()
        position = planner.propose(now, np.random.default_rng(k)).positions
        times.append(1e3 * (time.perf_counter() - begun))
    return float(np.median(times)), max(times)


def main() -> None:
    file = make_parser(__doc__, PLANNING).parse_args().write
    warm_up(RangeSensor())
    plan_ms(2, 1000, 100)
    table = Table("curve", "vehicles", "landmarks", "configurations", "median ms", "numpy ms", "of numpy")
    figures: dict[str, Any] = {}
    for curve, cases in CURVES.items():
        for case in cases:
            ours, plain = plan_ms(*case), numpy_ms(*case)
            vehicles, landmarks, candidates = case
            figures[f"{curve}: {vehicles} vehicles, {landmarks} landmarks, {candidates} candidates"] = (
                f"{ours:.1f} ms, {ours / plain:.3f} of numpy's {plain:.0f} ms"
            )
            table.add_row(curve, *(str(x) for x in case), f"{ours:.1f}", f"{plain:.0f}", f"{ours / plain:.3f}")
    surveys = Table("bathymeter mission: vehicles", "nodes", "candidates per vehicle", "median ms", "worst ms")
    for case in ((2, 2500, 48), (2, 10_000, 48), (4, 2500, 48), (10, 2500, 48)):
        median, worst = survey_ms(*case)
        surveys.add_row(*(str(x) for x in case), f"{median:.1f}", f"{worst:.1f}")
    Console().print(table, surveys)
    write_section(file, PLANNING, "One step of CAO", figures)


if __name__ == "__main__":
    main()
