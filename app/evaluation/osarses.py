"""OSARSES (AURO15 algorithm 1): really try C random feasible moves in simulation, take the best. A yardstick only."""

import numpy as np

from app.evaluation.cube_world import World
from app.exploration.bottom import Bottom
from app.exploration.objective import ObjectiveWeights, VehicleProgress
from app.exploration.problem import Proposal, Situation

DRAWS = 64
"""Random moves drawn at once; those that are not feasible do not count as tries."""

MAX_DRAWS = 20_000


class Osarses:
    """Stands where a planner stands, but looks into the simulated world, which no planner can.

    ``tries`` = 0 is one random feasible move per step; ``weights`` switch terms of the objective off (AURO15 fig. 2).
    """

    def __init__(
        self,
        world: World,
        tries: int,
        rng: np.random.Generator,
        weights: ObjectiveWeights = ObjectiveWeights(),  # noqa: B008 - frozen
    ) -> None:
        self._world = world
        self._tries = tries
        self._noise = rng
        self._weights = weights
        self._progress: list[VehicleProgress] = []
        self._names: tuple[str, ...] = ()

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return the best of the configurations tried."""
        if situation.vehicles != self._names:  # progress is told per vehicle
            self._progress, self._names = [], situation.vehicles
        wanted = max(1, self._tries)
        candidates = self._feasible(situation, wanted, rng)
        if self._tries == 0:
            return Proposal(candidates[0], 0.0)
        world, before = self._world, int(self._world.landmarks.accurate.sum())
        outcomes = []
        for positions in candidates:
            cleared = world.clear(positions)
            landmarks = world.measure(cleared, world.landmarks, self._noise)
            outcomes.append(world.evaluate(cleared, landmarks, before, self._progress, self._weights))
        best = int(np.argmax([outcome.total for outcome in outcomes]))
        self._progress = [*self._progress[-1:], outcomes[best].progress]
        return Proposal(candidates[best], outcomes[best].total, outcomes[best].terms)

    def _feasible(self, situation: Situation, wanted: int, rng: np.random.Generator) -> np.ndarray:
        origin, constraints = situation.positions, situation.constraints
        bottom = Bottom.from_landmarks(situation.belief.xy_m, situation.belief.depth_m)
        found: list[np.ndarray] = []
        for _ in range(MAX_DRAWS // DRAWS):
            direction = rng.standard_normal((DRAWS, *origin.shape))
            direction /= np.linalg.norm(direction, axis=2, keepdims=True)
            length = constraints.max_step_m * (1 - 1e-9) * rng.random((DRAWS, len(origin), 1)) ** (1 / 3)
            moves = origin + direction * length
            found.extend(moves[constraints.feasible(origin, moves, bottom)])
            if len(found) >= wanted:
                break
        return np.array(found[:wanted]) if found else origin[None]
