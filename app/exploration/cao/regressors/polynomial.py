"""Powers of the raw positions: "a universal approximator" (AURO15 sec. 5.2) taken literally, kept for comparison."""

from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor
from app.exploration.cao.regressors.moves import team_moves
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Situation
from app.exploration.planner.measured import MeasuredObjective
from app.exploration.planner.options import PlannerOptions

AtCruise = Callable[[Situation, Bottom, FloatArray], FloatArray]


class PolynomialRegressors:
    """1 and all monomials of each vehicle's own coordinates up to ``options.degree``, scaled to [-1, 1] over the area.

    The objective is a sum over vehicles, so products of different vehicles' coordinates are left out: they would cost
    more parameters than a window of steps can determine.
    """

    def __init__(self, options: PlannerOptions, sensor: Sensor, at_cruise: AtCruise | None) -> None:
        """Move at cruise depth by ``at_cruise`` in bathymeter missions, in three dimensions without it."""
        self._options = options
        self._at_cruise = at_cruise
        self._measured = MeasuredObjective(sensor if isinstance(sensor, RangeSensor) else None, options)
        self._dims = 3 if at_cruise is None else 2
        self._monomials = [
            list(which)
            for k in range(1, options.degree + 1)
            for which in combinations_with_replacement(range(self._dims), k)
        ]

    def begin(self, team: Situation, bottom: Bottom, seed: int) -> FloatArray:
        """See :class:`app.exploration.cao.planner.Regressors`."""
        self._team, self._bottom, self._seed = team, bottom, seed
        return self._measured.update(team)

    def prior(self, team: Situation) -> tuple[FloatArray, float]:
        """Nothing is known beforehand; a trace of ridge keeps the least squares solvable."""
        return np.zeros(1 + len(self._monomials) * len(team.vehicles)), 1e-2

    def candidates(self, alpha: float) -> FloatArray:
        """Eq. (22): ``x + alpha zeta`` and whole steps; and the present configuration."""
        team, step = self._team, self._team.constraints.max_step_m * (1 - 1e-9)
        n = max(self._options.candidates * len(team.vehicles), 2 * self._dims * len(team.vehicles))
        moves = team_moves(self._seed, team.vehicles, n, self._dims, step, alpha)
        moves[-1] = 0.0
        if self._at_cruise is not None:
            return self._at_cruise(team, self._bottom, team.positions[:, :2] + moves)
        return team.positions + moves

    def regressors(self, candidates: FloatArray) -> FloatArray:
        """Return 1 and the monomials, vehicle by vehicle."""
        area = self._team.constraints.area
        middle, half = (area.max(axis=0) + area.min(axis=0)) / 2, np.ptp(area, axis=0) / 2
        x = (candidates[..., :2] - middle) / half
        if self._dims == 3:
            x = np.concatenate([x, candidates[..., 2:] / float(half.max())], axis=-1)
        powers = np.stack([x[..., which].prod(axis=-1) for which in self._monomials], axis=-1)
        return np.hstack([np.ones((len(x), 1)), powers.reshape(len(x), -1)])

    def trusted(self, theta: FloatArray) -> FloatArray:
        """Raw positions have no meaning that would bound theta."""
        return theta

    def chosen(self, positions: FloatArray) -> None:
        """Nothing to keep."""

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        return self._measured.remember()

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._measured.recall(state)
