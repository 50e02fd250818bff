"""Cognitive Adaptive Optimization (AURO15 algorithm 2, eq. 20-23).

The objective of the next step is approximated by ``J_hat(X) = theta' phi(X)``; theta follows by least squares from the
objective measured at the last steps; of many random candidates the feasible one with the best ``J_hat`` is taken. The
paper leaves the regressors ``phi`` open. ``map`` uses predictions from the current map, so that theta learns how far
each prediction deserves trust; ``polynomial`` uses powers of the raw positions, the literal reading.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np

from app.arrays import FloatArray
from app.estimation import Sensor
from app.exploration.cao.estimator import Estimator, MoveSize
from app.exploration.cao.regressors.landmarks import LandmarkRegressors
from app.exploration.cao.regressors.polynomial import PolynomialRegressors
from app.exploration.cao.regressors.survey import SurveyRegressors
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.base import PlannerBase, settle
from app.exploration.planner.options import OF_CAO, PlannerOptions

WINDOW = 30
POLYNOMIAL_WINDOW = 15
"""Steps to which theta is fitted unless the options say otherwise: a polynomial only holds close by."""


class Regressors(Protocol):
    """What CAO's estimator is linear in, with the candidates that it makes sense to ask about."""

    def begin(self, team: Situation, bottom: Bottom, seed: int) -> float | FloatArray:
        """Take up a new situation; return the objective measured for the last choice (NaN when there was none).

        Where the options say so, each vehicle's contribution to it instead, (n_vehicles,).
        """
        ...

    def prior(self, team: Situation) -> tuple[FloatArray, float]:
        """Return the prior theta (L,) and its stiffness."""
        ...

    def candidates(self, alpha: float) -> FloatArray:
        """Return candidate team configurations (c, n_vehicles, 3)."""
        ...

    def regressors(self, candidates: FloatArray) -> FloatArray:
        """Return phi for each candidate, (c, L)."""
        ...

    def trusted(self, theta: FloatArray) -> FloatArray:
        """Return theta within the bounds that the regressors' meaning sets."""
        ...

    def chosen(self, positions: FloatArray) -> None:
        """Learn which configuration (n_vehicles, 3) was taken."""
        ...

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        ...

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        ...


class CaoPlanner(PlannerBase):
    """CAO with the regressors that the options and the sensor call for."""

    name: ClassVar[str] = "cao"
    own_options: ClassVar[frozenset[str]] = OF_CAO

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        super().__init__(options, sensor)
        self._model = self._regressors()
        self._history: list[Any] = []
        self._last: list[list[float]] = []
        self._by_vehicle = options.contribution == "vehicle" and not self._surveys
        surveys = isinstance(self._model, SurveyRegressors)
        self.plans_for_all = self.decides_apart = self.flies_lines = surveys
        self._size = MoveSize(options.alpha, options.alpha_decay, options.alpha_floor)

    def _regressors(self) -> Regressors:
        if self.options.regressors == "polynomial":
            return PolynomialRegressors(self.options, self.sensor, self._at_cruise if self._surveys else None)
        if self._surveys:
            return SurveyRegressors(self.options, self._at_cruise)
        return LandmarkRegressors(self.options, self.sensor)

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        measured = np.atleast_1d(self._model.begin(team, bottom, seed))
        prior, stiffness = self._model.prior(team)
        default = POLYNOMIAL_WINDOW if self.options.regressors == "polynomial" else WINDOW
        window = self.options.window or default
        rows = len(team.vehicles) if self._by_vehicle else 1
        estimator = Estimator(prior, stiffness, max(rows * window, len(prior) + 5))
        estimator.recall([row for row in self._history if len(row[0]) == len(prior)])
        if len(self._last) == len(measured):
            for row, J in zip(self._last, measured, strict=True):
                if len(row) == len(prior):
                    estimator.observe(np.array(row), float(J))
        theta = self._model.trusted(estimator.theta)

        candidates = self._model.candidates(self._size.next(gained=not measured.sum() <= 0.0))
        feasible = candidates[team.constraints.feasible(team.positions, candidates, bottom)]
        if len(feasible) == 0:
            positions, _ = settle(team, bottom, candidates)
            feasible = positions[None]
        phi = self._model.regressors(feasible)
        J_hat = phi @ theta
        best = int(np.argmax(J_hat))

        self._model.chosen(feasible[best])
        self._history = estimator.remember()
        self._last = self._explained(team, feasible[best], phi[best]).tolist()
        terms = {f"theta_{k}": float(x) for k, x in enumerate(theta)} if len(theta) <= 8 else {}
        return Proposal(feasible[best], float(J_hat[best]), {"feasible": float(len(feasible)), **terms})

    def _explained(self, team: Situation, chosen: FloatArray, phi: FloatArray) -> FloatArray:
        """Return the regressors (k, L) of the figures (k,) that will be measured after this choice.

        For contributions these are the differences that the vehicles' moves make to phi, as the estimator is linear.
        """
        if not self._by_vehicle:
            return phi[None]
        left_behind = np.repeat(chosen[None], len(chosen), axis=0)
        each = np.arange(len(chosen))
        left_behind[each, each] = team.positions
        return phi - self._model.regressors(left_behind)

    def take_back(self, legs: Mapping[str, int]) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.take_back`; in surveys only."""
        return isinstance(self._model, SurveyRegressors) and self._model.take_back(legs)

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """See :meth:`app.exploration.planner.base.PlannerBase.put_back`; in surveys only."""
        if isinstance(self._model, SurveyRegressors):
            self._model.put_back(vehicle, ends_m, resume_at_m)

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.skip_line`; in surveys only."""
        return isinstance(self._model, SurveyRegressors) and self._model.skip_line(vehicle, begin_m, here_m)

    def leave_out(self, vehicle: str, count: int, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.leave_out`; in surveys only."""
        return isinstance(self._model, SurveyRegressors) and self._model.leave_out(vehicle, count, here_m)

    def ways_ahead_m(self) -> dict[str, FloatArray]:
        """See :meth:`app.exploration.planner.base.PlannerBase.ways_ahead_m`; in surveys only."""
        return self._model.ways_ahead_m() if isinstance(self._model, SurveyRegressors) else {}

    def _remember(self) -> dict[str, Any]:
        return {
            "model": self._model.remember(),
            "history": self._history,
            "last": self._last,
            "size": [self._size.t, self._size.raised],
        }

    def _recall(self, state: dict[str, Any]) -> None:
        self._model.recall(state["model"])
        self._history = list(state["history"])
        self._last = [[float(x) for x in row] for row in state["last"]]
        self._size.t, self._size.raised = (int(k) for k in state["size"])
