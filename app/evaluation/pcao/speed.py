"""How fast simulation and controller are, measured in processor time so that other work beside does not count."""

import time

import numpy as np

from app.evaluation.pcao.experiments import FlightJob
from app.evaluation.pcao.simulation.world import LANDMARKS, ROBOTS, STEPS, UNIT
from app.evaluation.pcao.terrains import sea_floor
from app.exploration.pcao.controller import control, within_step
from app.exploration.pcao.model import PcaoModel
from app.exploration.pcao.state import reduced_state

RUNS = 5
DECISIONS = 400


def speed_lines(rng: np.random.Generator, model: PcaoModel) -> list[str]:
    """Return the report's section on speed."""
    job = FlightJob(sea_floor("harbour:1"), "pcao", 100, model.parameters)
    job.run(lambda step: None)
    seconds = sum(job.run(lambda step: None)["cpu_s"] for _ in range(RUNS))
    horizontal, vertical = model.gains
    xy = rng.uniform(-1.0, 1.0, (LANDMARKS, 2))
    taken = []
    for _ in range(DECISIONS):
        positions = np.column_stack([rng.uniform(-1.0, 1.0, (ROBOTS, 2)), np.full(ROBOTS, 0.3)])
        left = (rng.random(LANDMARKS) < 0.5).astype(np.float64)
        began = time.thread_time()
        state = reduced_state(
            positions, np.zeros((ROBOTS, 2)), np.full(ROBOTS, 0.15), xy, np.full(LANDMARKS, 0.5), left, 275.0, UNIT
        )
        within_step(control(*state, horizontal, vertical), 0.05, True)
        taken.append(time.thread_time() - began)
    return [
        f"- training simulation: {RUNS * STEPS * ROBOTS / seconds:,.0f} vehicle-steps per second of one core",
        f"- a decision (state and controller, {ROBOTS} vehicles, {LANDMARKS} landmarks): "
        f"{1e3 * float(np.median(taken)):.3f} ms, 99 % below {1e3 * float(np.quantile(taken, 0.99)):.3f} ms",
    ]
