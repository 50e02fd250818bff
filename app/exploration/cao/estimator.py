"""CAO's linear-in-parameters estimator and its schedule of random moves (AURO15 eq. 20-23; ACCESS13 eq. 13)."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.arrays import FloatArray


@dataclass
class Estimator:
    """``J_hat = theta' phi(X)``, theta by least squares over a window of past steps (eq. 20, 21).

    Attributes
    ----------
    prior : (L,)
        What theta is drawn to while there are few observations.
    stiffness : float
        How many observations the prior is worth, in units of the regressors' mean square.
    window : int
        Number of past steps that count.
    """

    prior: FloatArray
    stiffness: float
    window: int
    history: list[tuple[list[float], float]] = field(default_factory=list)

    def observe(self, regressors: FloatArray, J: float) -> None:
        """Remember that the configuration with these regressors (L,) was measured to give ``J``."""
        if np.isfinite(J) and np.isfinite(regressors).all():
            self.history.append(([float(x) for x in regressors], float(J)))
            del self.history[: -self.window]

    @property
    def theta(self) -> FloatArray:
        """The parameters (L,) fitted to the window."""
        if not self.history:
            return self.prior.copy()
        phi = np.array([row for row, _ in self.history])
        J = np.array([value for _, value in self.history])
        scale = np.sqrt(np.mean(phi**2, axis=0))
        scale = np.where(scale > 0.0, scale, 1.0)
        rows = np.vstack([phi / scale, np.sqrt(self.stiffness) * np.eye(len(self.prior))])
        goal = np.concatenate([J, np.sqrt(self.stiffness) * self.prior * scale])
        solution, *_ = np.linalg.lstsq(rows, goal, rcond=None)
        return np.asarray(solution / scale, dtype=np.float64)

    def remember(self) -> list[Any]:
        """Return the window as plain lists."""
        return [[row, value] for row, value in self.history]

    def recall(self, state: list[Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self.history = [([float(x) for x in row], float(value)) for row, value in state]


@dataclass
class MoveSize:
    """The sequence alpha_t of eq. (22), (23): ``alpha / (1 + t)^decay`` with a floor.

    While a local minimum lasts (nothing gained in a step) the supervisor adds one first alpha per step; the first gain
    ends that.
    """

    alpha: float
    decay: float
    floor: float
    t: int = 0
    raised: int = 0

    def next(self, *, gained: bool) -> float:
        """Return the size for this step."""
        self.raised = 0 if gained else self.raised + 1
        size = max(self.floor, self.alpha / (1.0 + self.t) ** self.decay) + self.alpha * max(0, self.raised - 1)
        self.t += 1
        return float(size)
