"""ACCESS13's two criteria, the switch between them and the supervisor that notices a local minimum."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.search_task import SearchTask


@dataclass(frozen=True)
class Weights:
    """``w_1`` to ``w_3`` of eq. (9).

    The paper leaves them to the operator. Its tables fit a ``w_2`` of about 20 beside small other terms: ``CF_1`` over
    the explored part of the goal area is 17.3 to 19.9 in fifteen of their sixteen entries (21 in the one of 0.14 %).
    """

    explore: float = 5.0
    goal: float = 20.0
    approach: float = 0.05


def nearness(en_m: FloatArray, place_m: FloatArray, farthest_m: float) -> FloatArray:
    """``F_3`` and ``F_4`` (eq. 7, 8) of positions (..., 2): 1 at the place, 1/e at the farthest corner."""
    away = en_m - place_m
    return np.asarray(np.exp(-np.hypot(away[..., 0], away[..., 1]) / farthest_m))


def in_contact(en_m: FloatArray, task: SearchTask) -> FloatArray:
    """Return the sigmoid of eq. (9), (10) for positions (..., 2): 1 close to the transmitter, 0 out of its range."""
    away = en_m - task.transmitter_m
    beyond = np.hypot(away[..., 0], away[..., 1]) - task.com_range_m
    return np.asarray(1.0 / (1.0 + np.exp(np.clip(beyond, -50.0, 50.0))))


def farthest_m(task: SearchTask, place_m: FloatArray) -> float:
    """Return the largest distance of any corner of the site from a place: ``max |D|`` of eq. (7), (8)."""
    grid = task.grid
    rows, cols = grid.blueprint.shape
    low = np.array([grid.west_m, grid.south_m])
    high = low + grid.cell_m * np.array([cols, rows])
    return max(1e-9, float(np.hypot(*np.maximum(np.abs(place_m - low), np.abs(high - place_m)))))


def terms(task: SearchTask, en_m: FloatArray, *, homewards: bool, weights: Weights) -> FloatArray:
    """Return the three addends of ``CF_1`` (or, ``homewards``, of ``CF_2``), (..., 3), for teams at (..., n, 2).

    With several vehicles F_3, F_4 and the sigmoid are means over them. The explored parts are those of now.
    ``w_1 / w_3`` of ``CF_2`` falls with the time that is left.
    """
    contact = in_contact(en_m, task).mean(axis=-1)
    place = task.entry_m if homewards else task.goal_m
    near = nearness(en_m, place, farthest_m(task, place)).mean(axis=-1)
    left = float(np.clip(task.left_m / task.window_m, 0.0, 1.0))
    goal = 0.0 if homewards else weights.goal * task.explored_goal_part
    approach = weights.approach * ((1.0 - left) ** 2 if homewards else 1.0)
    parts = [np.full(near.shape, weights.explore * task.explored_part), np.full(near.shape, goal), approach * near]
    return np.asarray(np.stack(parts, axis=-1) * contact[..., None])


@dataclass
class Standstill:
    """Whether a growing figure stands still: the common left side of eq. (11), (12) and (13).

    Attributes
    ----------
    window : int
        ``T_n`` or ``T_g``: values that count.
    percent : float
        ``T_f2`` or ``T_f1``.
    least : float
        ``T_m``: nothing stands still before the mean is larger.
    """

    window: int
    percent: float
    least: float = 0.0
    values: list[float] = field(default_factory=list)

    def now(self, value: float) -> bool:
        """Take the next value; return whether it differs by less than the percentage from the mean of those before."""
        full = len(self.values) == self.window
        mean = sum(self.values) / max(1, len(self.values))
        self.values.append(value)
        del self.values[: -self.window]
        return full and mean > self.least and abs(mean - value) < mean * self.percent / 100.0


@dataclass
class Supervisor:
    """Raises alpha by one while a local minimum lasts (eq. 13), looking every ``every`` (``T_l``) steps."""

    every: int = 1
    alpha: int = 1
    steps: int = 0
    standstill: Standstill = field(default_factory=lambda: Standstill(10, 0.3))

    def next(self, explored_part: float) -> int:
        """Return alpha for this step, in first steps."""
        stuck = self.standstill.now(explored_part)
        self.steps += 1
        if not stuck:
            self.alpha = 1
        elif self.steps % self.every == 0:
            self.alpha += 1
        return self.alpha

    def remember(self) -> list[Any]:
        """Return the memory as plain lists."""
        return [self.alpha, self.steps, self.standstill.values]

    def recall(self, state: list[Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self.alpha, self.steps = int(state[0]), int(state[1])
        self.standstill.values = [float(x) for x in state[2]]
