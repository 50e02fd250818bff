"""ACCESS13's own planners: CAO and SPSA on its two criteria, with its switch and its supervisor (section IV)."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from app.arrays import FloatArray
from app.estimation import Sensor
from app.exploration.cao.estimator import Estimator
from app.exploration.core.search_task import SearchTask
from app.exploration.planner.base import vehicle_rng
from app.exploration.planner.options import PlannerOptions
from app.exploration.site_search.base import SearchPlanner, hold
from app.exploration.site_search.criteria import Standstill, Supervisor, Weights, terms
from app.exploration.site_search.gains import gains
from app.exploration.site_search.scene import Scene

WINDOW = 30
"""Steps to which theta is fitted unless the options say otherwise (``L + T_h`` of eq. 19)."""
STIFFNESS = 10.0
"""Observations that the weights of the criteria are worth as a prior of theta."""
SWITCH_WINDOW, SWITCH_PERCENT, SWITCH_LEAST = 60, 0.1, 0.7
"""``T_n``, ``T_f2`` and ``T_m`` of the switch to ``CF_2``."""


@dataclass
class Criterion:
    """Which of the two criteria counts (eq. 11, 12), and alpha (eq. 13)."""

    homewards: bool = False
    switch: Standstill = field(default_factory=lambda: Standstill(SWITCH_WINDOW, SWITCH_PERCENT, SWITCH_LEAST))
    supervisor: Supervisor = field(default_factory=Supervisor)

    def next(self, task: SearchTask) -> int:
        """Take up what is explored now; return alpha in steps."""
        still = self.switch.now(task.explored_goal_part)
        self.homewards = self.homewards or still
        return self.supervisor.next(task.explored_part)

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        return {"homewards": self.homewards, "switch": self.switch.values, "supervisor": self.supervisor.remember()}

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self.homewards = bool(state["homewards"])
        self.switch.values = [float(x) for x in state["switch"]]
        self.supervisor.recall(state["supervisor"])


class CriterionSearch(SearchPlanner):
    """What follows ``CF_1`` and ``CF_2``."""

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        super().__init__(options, sensor)
        self._criterion = Criterion()

    @property
    def _homewards(self) -> bool:
        return self._criterion.homewards

    def _objective(self, scene: Scene, positions: FloatArray) -> float:
        return float(self._terms(scene, positions[None, :, :2])[0].sum())

    def _terms(self, scene: Scene, en_m: FloatArray) -> FloatArray:
        """Return the addends (c, 3) of the criterion for teams (c, n, 2), with what each is expected to explore.

        Cells that several vehicles would see count for each of them.
        """
        task, homewards = scene.task, self._criterion.homewards
        now = terms(task, en_m, homewards=homewards, weights=Weights())
        open_ = ~task.grid.blueprint
        places = scene.ground.places(en_m.reshape(-1, 2))
        every = gains(task, np.ones(open_.shape), places).reshape(en_m.shape[:2]).sum(axis=1)
        gained = np.zeros_like(now)
        gained[:, 0] = Weights().explore * every / open_.sum()
        if not homewards:
            goal = gains(task, task.in_goal.astype(np.float64), places).reshape(en_m.shape[:2]).sum(axis=1)
            gained[:, 1] = Weights().goal * goal / max(1, int((open_ & task.in_goal).sum()))
        return np.asarray(now + gained)

    def _free(self, scene: Scene, row: int, ends_m: FloatArray) -> FloatArray:
        """Return those of places (k, 2) to which the vehicle has a clear leg, and where it stands."""
        here = scene.team.positions[row, :2]
        return np.vstack([ends_m[scene.ground.clear(here, ends_m)], here])

    def _remember(self) -> dict[str, Any]:
        return {"criterion": self._criterion.remember()}

    def _recall(self, state: dict[str, Any]) -> None:
        self._criterion.recall(state["criterion"])


class CaoSearch(CriterionSearch):
    """ACCESS13's method: random candidates on a circle of radius alpha, the best by an estimator that learns.

    The regressors are the addends of the criterion as predicted from the map; theta learns how far each is true.
    """

    name: ClassVar[str] = "cao"
    own_options: ClassVar[frozenset[str]] = frozenset({"candidates", "window"})

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        super().__init__(options, sensor)
        self._history: list[Any] = []
        self._last: list[float] | None = None

    def _seek(self, scene: Scene, seed: int) -> FloatArray:
        homewards = self._criterion.homewards
        alpha = self._criterion.next(scene.task)
        if homewards != self._criterion.homewards:
            self._history, self._last = [], None
        estimator = Estimator(np.ones(3), STIFFNESS, self.options.window or WINDOW)
        estimator.recall(self._history)
        if self._last is not None:
            J = terms(scene.task, hold(scene), homewards=self._criterion.homewards, weights=Weights()).sum()
            estimator.observe(np.array(self._last), float(J))
        self._history = estimator.remember()
        radius = min(alpha * scene.step_m, scene.longest_m)
        candidates = self._candidates(scene, radius, seed)
        if bool((candidates == scene.team.positions[:, :2]).all()):
            self._criterion.supervisor.alpha = 0  # no line of sight is that long: begin again
        phi = self._terms(scene, candidates)
        best = int(np.argmax(phi @ np.clip(estimator.theta, 0.2, 5.0)))
        self._last = [float(x) for x in phi[best]]
        return np.asarray(candidates[best])

    def _candidates(self, scene: Scene, radius_m: float, seed: int) -> FloatArray:
        """Return teams (c, n, 2): every vehicle on its circle where a clear leg leads; where none does, where it is."""
        here, n = scene.team.positions[:, :2], self.options.candidates
        teams = np.empty((n, len(here), 2))
        for i, name in enumerate(scene.team.vehicles):
            rng = vehicle_rng(seed, name)
            bearing = rng.uniform(0.0, 2.0 * np.pi, n)
            ends = here[i] + radius_m * np.column_stack([np.sin(bearing), np.cos(bearing)])
            free = self._free(scene, i, ends)
            free = free[:-1] if len(free) > 1 else free
            teams[:, i] = free[rng.integers(0, len(free), n)] if len(here) > 1 else free[np.arange(n) % len(free)]
        return teams

    def _remember(self) -> dict[str, Any]:
        return {**super()._remember(), "history": self._history, "last": self._last}

    def _recall(self, state: dict[str, Any]) -> None:
        super()._recall(state)
        self._history = list(state["history"])
        self._last = None if state["last"] is None else [float(x) for x in state["last"]]


class SpsaSearch(CriterionSearch):
    """ACCESS13's baseline: one random direction, two perturbed places, a step up the slope between them.

    A step that is not clear is not taken; that is how it gets stuck.
    """

    name: ClassVar[str] = "spsa"
    own_options: ClassVar[frozenset[str]] = frozenset()

    def _seek(self, scene: Scene, seed: int) -> FloatArray:
        self._criterion.next(scene.task)
        here = hold(scene)
        signs = np.array([vehicle_rng(seed, name).integers(0, 2, 2) * 2.0 - 1.0 for name in scene.team.vehicles])
        move = signs / np.sqrt(2.0) * scene.step_m
        values = self._terms(scene, np.stack([here + move, here - move])).sum(axis=1)
        wishes = here + (move if values[0] >= values[1] else -move)
        for i in range(len(here)):
            wishes[i] = self._free(scene, i, wishes[i : i + 1])[0]
        return np.asarray(wishes)
