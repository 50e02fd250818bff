"""What looks for the best P: algorithm 1 of PCAO18, random search (its yardstick), CMA-ES.

An optimiser proposes the next controllers and receives their scores. Its proposals follow from its seed and from
these scores, and from nothing else: given the same scores again it is in the same state.
"""

from abc import ABC, abstractmethod
from functools import cache
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.exploration.pcao.controller import BLOCKS, SIZE, entries, gains, random_parameters, within_bounds

CANDIDATES = 2 * SIZE
"""M: at least twice the number of variables (the paper's footnote 5)."""


class Optimiser(ABC):
    """Minimises a score over P (SIZE,) within its bounds."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self.best: FloatArray = identity()
        self.best_score = np.inf

    @abstractmethod
    def ask(self) -> list[FloatArray]:
        """Return the controllers to be scored next, all at once; ask again only after giving the scores."""

    def tell(self, asked: list[FloatArray], scores: list[float]) -> None:
        """Take in the scores of what was asked for."""
        for parameters, score in zip(asked, scores, strict=True):
            if score < self.best_score:
                self.best, self.best_score = parameters, score


class RandomOptimiser(Optimiser):
    """A random P every time (RS of the paper)."""

    def ask(self) -> list[FloatArray]:
        """Return one random controller."""
        return [random_parameters(self._rng)[0]]


class Pcao(Optimiser):
    """Algorithm 1: fit the score linearly in regressors phi(P), perturb the best P, fly what the fit likes best."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self._phi: list[FloatArray] = []
        self._scores: list[float] = []
        self._next = random_parameters(self._rng)[0]

    def ask(self) -> list[FloatArray]:
        """Return P(k)."""
        return [self._next]

    def tell(self, asked: list[FloatArray], scores: list[float]) -> None:
        """Do steps 2 to 5."""
        super().tell(asked, scores)
        self._phi += list(regressors(np.array(asked)))
        self._scores += scores
        theta = self._fit()
        a = step_size(len(self._scores))
        candidates = (1.0 - a) * self.best + a * random_parameters(self._rng, CANDIDATES)
        self._next = candidates[int(np.argmin(regressors(candidates) @ theta))]

    def _fit(self) -> FloatArray:
        """Return theta_best; of many equally good ones (few scores, many regressors) the smallest."""
        phi = np.array(self._phi)
        ridge = 1e-3 * np.eye(phi.shape[1])
        ridge[0, 0] = 1e-9
        # Scores of bad controllers are far off and say little about the neighbourhood of the best one.
        score = np.minimum(np.array(self._scores), 3.0 * self.best_score)
        return np.asarray(np.linalg.solve(phi.T @ phi + ridge, phi.T @ score))


class CmaEs(Optimiser):
    """CMA-ES (Hansen; package cma) over the entries of P, brought within the bounds before they are flown."""

    def __init__(self, seed: int, population: int | None = None) -> None:
        super().__init__(seed)
        import cma

        options: dict[str, Any] = {"seed": np.nan, "randn": lambda *shape: self._rng.standard_normal(shape)}
        options |= {"verbose": -9, "CMA_active": True, "maxiter": np.inf, "tolfun": 0, "tolx": 0, "tolfunhist": 0}
        options |= {"tolstagnation": np.inf, "tolflatfitness": np.inf}
        if population is not None:
            options["popsize"] = population
        self._es = cma.CMAEvolutionStrategy(identity(), 0.3, options)
        self._raw: list[FloatArray] = []

    def ask(self) -> list[FloatArray]:
        """Return a generation."""
        self._raw = self._es.ask()
        return [within_bounds(np.asarray(raw)) for raw in self._raw]

    def tell(self, asked: list[FloatArray], scores: list[float]) -> None:
        """Update mean, step size and covariance; what was moved far into the bounds costs a little."""
        super().tell(asked, scores)
        moved = [float(np.sum((np.asarray(raw) - p) ** 2)) for raw, p in zip(self._raw, asked, strict=True)]
        self._es.tell(self._raw, [score + 1e-3 * m for score, m in zip(scores, moved, strict=True)])


METHODS: dict[str, type[Optimiser]] = {"pcao": Pcao, "cma": CmaEs, "random": RandomOptimiser}
"""The optimisers by the names of ``bathyfleet train --method``."""


def identity() -> FloatArray:
    """Return P = I: every vector of the state draws alike."""
    return entries([np.eye(size) for size in BLOCKS])


def step_size(k: int) -> float:
    """Return a(k): to 0, its sum without bound, the sum of its squares finite."""
    return float(0.5 / (1.0 + k / 20.0) ** 0.6)


def regressors(parameters: FloatArray) -> FloatArray:
    """Return phi(P) of many P (k, SIZE): 1, the gains B'P (all that a controller does), their squares, in tens."""
    g = parameters @ _gains_of_entries().T / 10.0
    return np.hstack([np.ones((len(g), 1)), g, g**2])


@cache
def _gains_of_entries() -> FloatArray:
    """Return the matrix that makes all gains of the free entries: they are linear in them."""
    return np.array([np.concatenate([part.ravel() for part in gains(unit)]) for unit in np.eye(SIZE)]).T
