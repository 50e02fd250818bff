"""What a controller is trained for: sea floors, Monte-Carlo runs, and the score E(P) of eq. (6) and (17)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray, IntArray
from app.evaluation.pcao.simulation.kernel import fly
from app.evaluation.pcao.simulation.world import LANDMARKS, ROBOTS, STEPS, SeaFloor
from app.exploration.pcao.controller import gains

KAPPA = 10.0
"""Weight of what remains at the end; Omega'Omega of an unseen sea floor is 59."""
DT = 1.0


@dataclass(frozen=True, eq=False)
class TrainingTask:
    """Sea floors (N_s), seeds of the Monte-Carlo runs on each (N_e), and the missions that are flown.

    With ``visiting`` a controller that gets nowhere visits landmarks, as in missions
    (:mod:`app.exploration.pcao.visits`). A controller is trained without, so that it learns to do without.
    """

    floors: tuple[SeaFloor, ...]
    seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    robots: int = ROBOTS
    landmarks: int = LANDMARKS
    steps: int = STEPS
    kappa: float = KAPPA
    visiting: bool = False

    @property
    def cases(self) -> tuple[tuple[int, int], ...]:
        """Every run as (number of the sea floor, seed)."""
        return tuple((floor, seed) for seed in self.seeds for floor in range(len(self.floors)))

    def run(self, floor: SeaFloor, seed: int, parameters: FloatArray) -> tuple[IntArray, FloatArray]:
        """Fly one mission with a controller (SIZE,).

        Returns as :func:`app.evaluation.pcao.simulation.kernel.fly` does.
        """
        landmarks, start, headings = floor.draw(seed, self.robots, self.landmarks)
        rng = np.random.default_rng([seed, 1])
        horizontal, vertical = gains(parameters)
        how = (horizontal, vertical, self.steps, self.visiting, rng)
        return fly(floor.raster, floor.physics, landmarks, start, headings, *how)

    def cost(self, remaining: IntArray, error: FloatArray) -> float:
        """Return J of eq. (6) of one run, over N."""
        return float((error[:-1].sum() * DT + self.kappa * remaining[-1]) / self.steps)

    def costs(self, parameters: FloatArray, cases: Sequence[tuple[int, int]]) -> list[float]:
        """Return J / N of some of the runs; their sum over :attr:`cases` is the score of eq. (17)."""
        return [self.cost(*self.run(self.floors[floor], seed, parameters)) for floor, seed in cases]

    def score(self, costs: Sequence[float]) -> float:
        """Return E(P) of the costs of all runs, per run, so that numbers of sea floors and seeds can be compared."""
        return float(np.sum(costs)) / len(self.cases)
