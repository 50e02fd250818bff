"""Random feasible moves: the yardstick that every planner must beat (OSARSES(0))."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.base import PlannerBase, settle, vehicle_rng

TRIES = 64


class RandomPlanner(PlannerBase):
    """Sends every vehicle to a point drawn evenly from the ball of one step around it; the first feasible draw counts.

    In a bathymeter mission the vehicles stay at their cruise depths.
    """

    name: ClassVar[str] = "random"
    own_options: ClassVar[frozenset[str]] = frozenset()
    runs_errands: ClassVar[bool] = False
    decides_apart = True

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        step = team.constraints.max_step_m
        moves = np.stack([_ball(vehicle_rng(seed, name), TRIES) for name in team.vehicles], axis=1) * step
        wishes = team.positions + moves
        if self._surveys:
            wishes = self._at_cruise(team, bottom, wishes[..., :2])
        positions, _ = settle(team, bottom, wishes)
        return Proposal(positions, 0.0)


def _ball(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Return ``n`` points (n, 3) drawn evenly from the unit ball."""
    direction = rng.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.asarray(direction * rng.random((n, 1)) ** (1 / 3))
