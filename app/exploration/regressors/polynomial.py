"""Powers of the raw positions: "a universal approximator" (AURO15 sec. 5.2) taken literally, kept for comparison."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.estimation import RangeSensor, Sensor
from app.exploration.bottom import Bottom
from app.exploration.measured import MeasuredObjective
from app.exploration.options import PlannerOptions
from app.exploration.planners.base import vehicle_rng
from app.exploration.problem import Situation

FloatArray = NDArray[np.float64]
AtCruise = Callable[[Situation, Bottom, FloatArray], FloatArray]


class PolynomialRegressors:
    """All monomials up to degree two of the team's coordinates, scaled to [-1, 1] over the area and the depth band."""

    def __init__(self, options: PlannerOptions, sensor: Sensor, at_cruise: AtCruise | None) -> None:
        """Move at cruise depth by ``at_cruise`` in bathymeter missions, in three dimensions without it."""
        self._options = options
        self._at_cruise = at_cruise
        self._measured = MeasuredObjective(sensor if isinstance(sensor, RangeSensor) else None)

    def begin(self, team: Situation, bottom: Bottom, seed: int) -> float:
        """See :class:`app.exploration.planners.cao.Regressors`."""
        self._team, self._bottom, self._seed = team, bottom, seed
        self._dims = 3 if self._at_cruise is None else 2
        return self._measured.update(team)

    def prior(self, team: Situation) -> tuple[FloatArray, float]:
        """Nothing is known beforehand; a trace of ridge keeps the least squares solvable."""
        d = self._dims * len(team.vehicles)
        return np.zeros(1 + d + d * (d + 1) // 2), 1e-6

    def candidates(self, alpha: float) -> FloatArray:
        """Eq. (22): ``x + alpha zeta`` for the whole team, moves longer than a step shortened to it."""
        team, step = self._team, self._team.constraints.max_step_m
        n = max(self._options.candidates * len(team.vehicles), 2 * self._dims * len(team.vehicles))
        zeta = np.stack([vehicle_rng(self._seed, v).standard_normal((n, self._dims)) for v in team.vehicles], axis=1)
        moves = alpha * step * zeta
        moves *= np.minimum(1.0, step * (1 - 1e-9) / np.maximum(np.linalg.norm(moves, axis=2, keepdims=True), 1e-12))
        moves[-1] = 0.0
        if self._at_cruise is not None:
            return self._at_cruise(team, self._bottom, team.positions[:, :2] + moves)
        return team.positions + moves

    def regressors(self, candidates: FloatArray) -> FloatArray:
        """Return 1, x_i and x_i x_k for i <= k."""
        area = self._team.constraints.area
        middle, half = (area.max(axis=0) + area.min(axis=0)) / 2, np.ptp(area, axis=0) / 2
        x = (candidates[..., :2] - middle) / half
        if self._dims == 3:
            scale = float(half.max())
            x = np.concatenate([x, candidates[..., 2:] / scale], axis=-1)
        x = x.reshape(len(candidates), -1)
        i, k = np.triu_indices(x.shape[1])
        return np.hstack([np.ones((len(x), 1)), x, x[:, i] * x[:, k]])

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
