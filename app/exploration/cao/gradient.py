"""SPSA and FDSA (Spall 1992; the baselines of ACCESS13 and PCAO18): up the gradient, from perturbed evaluations.

In the papers the perturbations are really flown, which takes 3 (SPSA) or 1 + 6 N_R (FDSA) times as long. A planner may
not try anything really, so these evaluate the perturbed team configurations on the current map: what CAO's ``map``
regressors predict, weighted by their prior. The literal reading, with real tries: ``app.evaluation.explore.oracles``.
"""

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np

from app.arrays import FloatArray
from app.estimation import Sensor
from app.exploration.cao.regressors.landmarks import LandmarkRegressors
from app.exploration.cao.regressors.survey import SurveyRegressors
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.base import PlannerBase, settle, vehicle_rng
from app.exploration.planner.options import PlannerOptions

Method = Literal["spsa", "fdsa"]
Value = Callable[[FloatArray], FloatArray]
"""From configurations (c, n_vehicles, 3) to their values (c,)."""

PERTURBATION = 0.5
DECAY = 0.101
"""Spall's exponent for perturbations. His other one, for the moves, would let the team come to rest long before the map
is done: what is climbed here changes with every step, so every move is a whole step."""


def perturbation(step: float, t: int) -> float:
    """Return how far a coordinate is perturbed at the t-th step when ``step`` is the largest move."""
    return PERTURBATION * step * float((1.0 + t) ** -DECAY)


def spsa_directions(seed: int, vehicles: tuple[str, ...], dims: int) -> FloatArray:
    """Return one random direction (1, n_vehicles, dims) of all coordinates at once, each +1 or -1."""
    signs = [vehicle_rng(seed, name).integers(0, 2, dims) * 2.0 - 1.0 for name in vehicles]
    return np.array(signs)[None]


def fdsa_directions(vehicles: tuple[str, ...], dims: int) -> FloatArray:
    """Return each coordinate's own direction, (n_vehicles * dims, n_vehicles, dims)."""
    size = len(vehicles) * dims
    return np.eye(size).reshape(size, len(vehicles), dims)


def directions(method: Method, seed: int, vehicles: tuple[str, ...], dims: int) -> FloatArray:
    """Return along which directions (k, n_vehicles, dims) the method perturbs."""
    return spsa_directions(seed, vehicles, dims) if method == "spsa" else fdsa_directions(vehicles, dims)


def gradient(value: Value, origin: FloatArray, directions: FloatArray, size: float) -> FloatArray:
    """Return the gradient (n_vehicles, dims) estimated by two-sided differences along directions of +1, 0 and -1.

    ``value`` sees both perturbed configurations of each direction, all in one call.
    """
    dims = directions.shape[2]
    offsets = np.zeros((len(directions), *origin.shape))
    offsets[..., :dims] = size * directions
    values = value(np.concatenate([origin + offsets, origin - offsets]))
    slopes = (values[: len(directions)] - values[len(directions) :]) / (2.0 * size)
    return np.asarray(np.tensordot(slopes, directions, axes=1))


def ascent(slope: FloatArray, otherwise: FloatArray, length: float) -> FloatArray:
    """Return a move up the gradient whose longest vehicle leg has the given length; on level ground ``otherwise``."""
    longest = float(np.linalg.norm(slope, axis=1).max(initial=0.0))
    if not longest > 0.0:
        slope, longest = otherwise, float(np.linalg.norm(otherwise, axis=1).max(initial=1e-12))
    return length / longest * slope


class GradientPlanner(PlannerBase):
    """Climbs the value that the current map predicts; the methods differ in how they perturb."""

    method: ClassVar[Method]

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        super().__init__(options, sensor)
        self._model: LandmarkRegressors | SurveyRegressors = (
            SurveyRegressors(options, self._at_cruise, every_step=True)
            if self._surveys
            else LandmarkRegressors(options, sensor)
        )
        self._steps = 0

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        self._model.begin(team, bottom, seed)
        theta, _ = self._model.prior(team)
        dims, step = (2 if self._surveys else 3), team.constraints.max_step_m * (1 - 1e-9)

        def value(candidates: FloatArray) -> FloatArray:
            if self._surveys:
                candidates = self._at_cruise(team, bottom, candidates[..., :2])
            return self._model.regressors(candidates) @ theta

        size = perturbation(step, self._steps)
        self._steps += 1
        slope = gradient(value, team.positions, directions(self.method, seed, team.vehicles, dims), size)
        move = ascent(slope, spsa_directions(seed, team.vehicles, dims)[0], step)
        wishes = team.positions[:, :dims] + np.array([1.0, -1.0])[:, None, None] * move
        if self._surveys:
            wishes = self._at_cruise(team, bottom, wishes)
        positions, _ = settle(team, bottom, wishes)
        self._model.chosen(positions)
        return Proposal(positions, float(value(positions[None])[0]))

    def _remember(self) -> dict[str, Any]:
        return {"model": self._model.remember(), "steps": self._steps}

    def _recall(self, state: dict[str, Any]) -> None:
        self._model.recall(state["model"])
        self._steps = int(state["steps"])


class SpsaPlanner(GradientPlanner):
    """Simultaneous perturbation: one random direction of the whole team, two evaluations on the current map."""

    name: ClassVar[str] = "spsa"
    own_options: ClassVar[frozenset[str]] = frozenset({"search", "accuracy_sd_m"})
    method: ClassVar[Method] = "spsa"


class FdsaPlanner(GradientPlanner):
    """Finite differences: coordinate by coordinate, two evaluations each on the current map."""

    name: ClassVar[str] = "fdsa"
    own_options: ClassVar[frozenset[str]] = frozenset({"search", "accuracy_sd_m"})
    method: ClassVar[Method] = "fdsa"
