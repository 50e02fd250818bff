"""Yardsticks that look into the simulated world, which no planner can: they judge moves by really trying them.

A try flies a configuration and measures there; its objective is kept, its measurements are not. A mission that tries C
configurations per step takes 1 + C times as long (PCAO18 table III).
"""

from abc import ABC, abstractmethod

import numpy as np

from app.arrays import FloatArray
from app.estimation import Landmarks, landmark_sets
from app.evaluation.explore.world import World
from app.exploration.cao.gradient import Method, ascent, directions, gradient, perturbation, spsa_directions
from app.exploration.core.bottom import Bottom
from app.exploration.core.objective import Objective, ObjectiveWeights, Terms, VehicleProgress, med13_objective
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.base import settle


class MoveOracle(ABC):
    """Stands where a planner stands. The switches of the objective follow what the team really achieved."""

    def __init__(self, world: World, rng: np.random.Generator, terms: Terms = "full") -> None:
        self._world = world
        self._noise = rng
        self._terms = terms
        self._progress: list[VehicleProgress] = []
        self._names: tuple[str, ...] = ()
        self.real_tries = 0

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return the next configuration."""
        if situation.vehicles != self._names:  # progress is counted per vehicle
            self._progress, self._names = [], situation.vehicles
        now = self._judge(situation.positions, self._world.landmarks)
        self._progress = [*self._progress[-1:], now.progress]
        return self._decide(situation, rng)

    @abstractmethod
    def _decide(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Decide after the team's progress was noted."""

    def _try(self, positions: FloatArray) -> Objective:
        """Return what a configuration (n_vehicles, 3) turns out to be worth when it is flown."""
        self.real_tries += 1
        cleared = self._world.clear(positions)
        return self._judge(cleared, self._world.measure(cleared, self._world.landmarks, self._noise))

    def _judge(self, positions: FloatArray, landmarks: Landmarks) -> Objective:
        world = self._world
        if self._terms == "med13":
            points = np.column_stack([landmarks.xy_m, landmarks.depth_m])
            return med13_objective(positions, points, landmark_sets(landmarks, world.visible(positions), world.team))
        before, weights = int(world.landmarks.accurate.sum()), ObjectiveWeights.of(self._terms)
        return world.evaluate(positions, landmarks, before, self._progress, weights)


class GradientOracle(MoveOracle):
    """SPSA or FDSA as the papers fly them: every perturbed configuration is really tried.

    A perturbed configuration that breaks a constraint is not flown; the team stays instead.
    """

    def __init__(self, method: Method, world: World, rng: np.random.Generator, terms: Terms = "full") -> None:
        super().__init__(world, rng, terms)
        self._method: Method = method
        self._steps = 0

    def _decide(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        constraints, origin = situation.constraints, situation.positions
        bottom = Bottom.from_landmarks(situation.belief.xy_m, situation.belief.depth_m)
        seed, step = int(rng.integers(2**63)), constraints.max_step_m * (1 - 1e-9)

        def value(perturbed: FloatArray) -> FloatArray:
            allowed = constraints.feasible(origin, perturbed, bottom)
            flown = np.where(allowed[:, None, None], perturbed, origin)
            return np.array([self._try(positions).total for positions in flown])

        along = directions(self._method, seed, situation.vehicles, 3)
        slope = gradient(value, origin, along, perturbation(step, self._steps))
        self._steps += 1
        move = ascent(slope, spsa_directions(seed, situation.vehicles, 3)[0], step)
        positions, _ = settle(situation, bottom, origin + np.array([1.0, -1.0])[:, None, None] * move)
        return Proposal(positions, 0.0)
