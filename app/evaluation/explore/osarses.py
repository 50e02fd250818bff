"""OSARSES (AURO15 algorithm 1): really try C random feasible moves in simulation, take the best. A yardstick only."""

import numpy as np

from app.arrays import FloatArray
from app.evaluation.explore.oracles import MoveOracle
from app.evaluation.explore.world import World
from app.exploration.core.bottom import Bottom
from app.exploration.core.objective import Terms
from app.exploration.core.problem import Proposal, Situation

DRAWS = 64
"""Random moves drawn at once; those that are not feasible do not count as tries."""

MAX_DRAWS = 20_000
SPREAD = 0.5
"""Standard deviation of a move per coordinate, as a fraction of the largest step; longer moves are shortened to it."""


class Osarses(MoveOracle):
    """Takes the best of ``tries`` random feasible moves and of staying; 0 tries are one random feasible move.

    That the team may stay is what makes plain J a deadlock: where no vehicle can gain, no move is better than none.
    """

    def __init__(self, world: World, tries: int, rng: np.random.Generator, terms: Terms = "full") -> None:
        super().__init__(world, rng, terms)
        self._tries = tries

    def _decide(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        moves = self._feasible(situation, max(1, self._tries), rng)
        if self._tries == 0:
            return Proposal(moves[0], 0.0)
        candidates = [situation.positions, *moves]
        outcomes = [self._try(positions) for positions in candidates]
        self.real_tries -= 1  # to stay is not to try a move
        best = int(np.argmax([outcome.total for outcome in outcomes]))
        return Proposal(candidates[best], outcomes[best].total, outcomes[best].terms)

    def _feasible(self, situation: Situation, wanted: int, rng: np.random.Generator) -> FloatArray:
        origin, constraints = situation.positions, situation.constraints
        bottom = Bottom.from_landmarks(situation.belief.xy_m, situation.belief.depth_m)
        step = constraints.max_step_m * (1 - 1e-9)
        found: list[FloatArray] = []
        for _ in range(MAX_DRAWS // DRAWS):
            move = SPREAD * step * rng.standard_normal((DRAWS, *origin.shape))
            move *= np.minimum(1.0, step / np.linalg.norm(move, axis=2, keepdims=True))
            moves = origin + move
            found.extend(moves[constraints.feasible(origin, moves, bottom)])
            if len(found) >= wanted:
                break
        return np.array(found[:wanted]) if found else origin[None]
