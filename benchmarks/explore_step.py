"""How long one planning step takes, over vehicles, landmarks and candidates: ``python benchmarks/explore_step.py``."""

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from app.estimation import RangeSensor, Sensor, SingleBeam
from app.exploration.constraints import Constraints
from app.exploration.options import PlannerOptions
from app.exploration.planners import create_planner, warm_up
from app.exploration.problem import Belief, Situation

STEPS = 30
SIDE_M = 100.0


def situation(vehicles: int, landmarks: int, position: np.ndarray, k: int) -> Situation:
    rng = np.random.default_rng(0)
    xy = rng.uniform(0.0, SIDE_M, (landmarks, 2))
    nothing = np.zeros(landmarks, dtype=np.bool_)
    belief = Belief(xy, np.full(landmarks, 9.0), np.ones(landmarks), nothing, rng.gamma(2.0, 0.5, landmarks), 20.0)
    area = SIDE_M * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    names = tuple(f"auv-{i:02d}" for i in range(vehicles))
    headings = np.full(vehicles, np.nan)
    return Situation(k, 60, names, position, headings, belief, np.zeros((0, 2)), Constraints(area, max_step_m=10.0))


def measure(sensor: Sensor, vehicles: int, landmarks: int, candidates: int) -> tuple[float, float]:
    """Return median and worst milliseconds; the worst is the first step, which lays out the backbone."""
    planner = create_planner("cao", PlannerOptions(candidates=candidates), sensor)
    position = np.column_stack([2.0 + 5.0 * np.arange(vehicles), np.full(vehicles, 2.0), np.full(vehicles, 2.0)])
    times = []
    for k in range(1, STEPS + 1):
        now = situation(vehicles, landmarks, position, k)
        begun = time.perf_counter()
        position = planner.propose(now, np.random.default_rng(k)).positions
        times.append(1e3 * (time.perf_counter() - begun))
    return float(np.median(times)), max(times)


def main() -> None:
    warm_up()
    table = Table("mission", "vehicles", "landmarks", "candidates per vehicle", "median ms", "worst ms")
    cases = [(2, 2500, 48), (2, 10000, 48), (2, 2500, 200), (4, 2500, 48), (10, 2500, 48)]
    for name, sensor in (("bathymeter", SingleBeam()), ("landmarks", RangeSensor(visibility_m=20.0))):
        for vehicles, landmarks, candidates in cases:
            median, worst = measure(sensor, vehicles, landmarks, candidates)
            table.add_row(name, str(vehicles), str(landmarks), str(candidates), f"{median:.1f}", f"{worst:.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
