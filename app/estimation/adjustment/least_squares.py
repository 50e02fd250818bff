"""Errors of nodes by ties, fixes and how positions drift: one sparse least-squares problem, and several weighed."""

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU, splu

from app.arrays import FloatArray, IntArray
from app.estimation.adjustment.drift import DriftModel, DriftNodes, prior_rows
from app.estimation.adjustment.ties import Outcome, Tie
from app.estimation.adjustment.tracks import Fixes

COLUMNS_AT_ONCE = 256
LEAST_SHARE = 0.01
"""Models that are less probable than this share of the most probable one are left out."""


@dataclass(frozen=True)
class WeighedTies:
    """Ties with what each compares to (k, 2) and how much it counts (k,)."""

    ties: list[Tie]
    targets_m: FloatArray
    weights: FloatArray

    @classmethod
    def none(cls) -> "WeighedTies":
        """Return no ties."""
        return cls([], np.zeros((0, 2)), np.zeros(0))


@dataclass(frozen=True)
class Solution:
    """Errors of nodes (m, 2) with what determines them.

    Attributes
    ----------
    offset_m
    normal, factors
        The normal matrix (2 u, 2 u), and its factors.
    ties
    log_evidence
        Logarithm of how probable what was measured is by the drift model, less what is the same for all models.
    """

    offset_m: FloatArray
    normal: sparse.csc_array
    factors: SuperLU
    ties: WeighedTies
    log_evidence: float


class LeastSquares:
    """The least-squares problem: unknowns are those of :func:`prior_rows`, east first, then north."""

    def __init__(self, nodes: DriftNodes, fixes: Fixes, model: DriftModel) -> None:
        self._m = len(nodes)
        self.model = model
        self._normal, self._right = _normal(nodes, fixes, model)
        self._each = len(self._right) // 2
        self._log_prior = _half_log_det(_factors(_normal(nodes, Fixes.none(), model)[0]))

    def solve(self, ties: WeighedTies) -> Solution:
        """Return the solution under ties."""
        normal, right = self._normal, self._right.copy()
        rows: list[IntArray] = []
        cols: list[IntArray] = []
        values: list[FloatArray] = []
        for tie, target, weight in zip(ties.ties, ties.targets_m, ties.weights, strict=True):
            if tie.outcome != Outcome.USED or weight <= 0.0:
                continue
            squares = np.outer(tie.weights, tie.weights)
            for i in range(2):
                for j in range(2):
                    value = weight * tie.information[i, j]
                    at = np.broadcast_to((i * self._each + tie.nodes)[:, None], squares.shape)
                    rows.append(at.ravel())
                    cols.append(np.broadcast_to(j * self._each + tie.nodes, squares.shape).ravel())
                    values.append((value * squares).ravel())
                    right[i * self._each + tie.nodes] += tie.weights * value * target[j]
        if rows:
            added = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
            normal = normal + sparse.csc_array(added, shape=normal.shape)
        factors = _factors(normal)
        found = factors.solve(right)
        offset = np.column_stack([found[: self._m], found[self._each : self._each + self._m]])
        log_evidence = self._log_prior - _half_log_det(factors) + 0.5 * float(right @ found)
        return Solution(offset, normal, factors, ties, log_evidence)

    def covariances(self, solution: Solution, compared: sparse.csr_array) -> FloatArray:
        """Return the covariances (k, 2, 2) of combinations (k, m) of the nodes' errors."""
        k = compared.shape[0]
        found = np.zeros((k, 2, 2))
        for begin in range(0, k, COLUMNS_AT_ONCE):
            piece = compared[begin : begin + COLUMNS_AT_ONCE].toarray()
            for i in range(2):
                wide = np.zeros((2 * self._each, len(piece)))
                wide[i * self._each : i * self._each + self._m] = piece.T
                solved = solution.factors.solve(wide)
                for j in range(2):
                    part = solved[j * self._each : j * self._each + self._m]
                    found[begin : begin + len(piece), i, j] = np.einsum("km,mk->k", piece, part)
        return 0.5 * (found + found.transpose(0, 2, 1))

    def deviations(self, solution: Solution) -> FloatArray:
        """Return the standard deviations (m, 2) of the nodes' errors.

        Nodes that nothing connects, as those of vehicles without ties, have a column of the inverse in common.
        """
        _, part = connected_components(solution.normal, directed=False)
        variance = np.zeros((self._m, 2))
        for i in range(2):
            unknown = i * self._each + np.arange(self._m)
            order = np.argsort(part[unknown], kind="stable")
            _, first, size = np.unique(part[unknown][order], return_index=True, return_counts=True)
            column = np.empty(self._m, dtype=np.int64)
            column[order] = np.arange(self._m) - np.repeat(first, size)
            for begin in range(0, int(size.max()), COLUMNS_AT_ONCE):
                here = np.flatnonzero((column >= begin) & (column < begin + COLUMNS_AT_ONCE))
                wide = np.zeros((2 * self._each, int(column[here].max()) - begin + 1))
                wide[unknown[here], column[here] - begin] = 1.0
                variance[here, i] = solution.factors.solve(wide)[unknown[here], column[here] - begin]
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


class DriftModels:
    """The same problem by several models of drift, of which nobody knows which one holds.

    How fast positions drift is told by few fixes. Deviations of the one model that fits best would be too small: what
    several models give is averaged, weighed by how probable fixes make each (Bayesian model averaging). Ties do not
    weigh: their errors go together, and they count as a share of what they say, so that too little drift would do.
    """

    def __init__(self, nodes: DriftNodes, fixes: Fixes, model: DriftModel) -> None:
        variants = model.variants()
        self._problems = [LeastSquares(nodes, fixes, one) for one, _ in variants]
        self._nodes = nodes
        log = np.array([problem.solve(WeighedTies.none()).log_evidence for problem in self._problems])
        log += np.array([log_prior for _, log_prior in variants])
        chance = np.exp(log - log.max())
        self._chance = chance / chance.sum()

    def typical(self) -> DriftModel:
        """Return the mean of the models, as probable as they are by fixes alone."""
        models = [problem.model for problem in self._problems]
        walk, rate, rate_time_s = (
            float(np.exp(self._chance @ np.log([getattr(one, name) for one in models])))
            for name in ("walk_m", "rate_mph", "rate_time_s")
        )
        return replace(models[0], walk_m=walk, rate_mph=rate, rate_time_s=rate_time_s)

    def average(self, ties: WeighedTies, pool: Executor) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return errors of nodes (m, 2) under ties, their deviations, and those by no fix or tie, over all models."""
        kept = np.flatnonzero(self._chance >= LEAST_SHARE * self._chance.max())
        chance = self._chance[kept] / self._chance[kept].sum()

        def of_model(k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
            problem = self._problems[k]
            solution = problem.solve(ties)
            reckoned = LeastSquares(self._nodes, Fixes.none(), problem.model)
            before = reckoned.deviations(reckoned.solve(WeighedTies.none()))
            return solution.offset_m, problem.deviations(solution), before

        offsets, deviations, before = map(np.array, zip(*pool.map(of_model, kept.tolist()), strict=True))
        mean = np.einsum("h,hmi->mi", chance, offsets)
        variance = np.einsum("h,hmi->mi", chance, deviations**2 + (offsets - mean) ** 2)
        before_variance = np.einsum("h,hmi->mi", chance, before**2)
        return mean, np.sqrt(variance), np.sqrt(before_variance)


def _normal(nodes: DriftNodes, fixes: Fixes, model: DriftModel) -> tuple[sparse.csc_array, FloatArray]:
    """Return the normal matrix (2 u, 2 u) and its right side (2 u,) without ties."""
    matrix, right = prior_rows(nodes, fixes, model)
    normal = sparse.csc_array(matrix.conj().T @ matrix)
    both = sparse.block_array([[normal.real, -normal.imag], [normal.imag, normal.real]])
    share = np.arange(normal.shape[0]) >= 2 * len(nodes)
    precision = np.concatenate([share / model.scale_sd**2, share / model.heading_sd_rad**2])
    told = matrix.conj().T @ right
    return sparse.csc_array(both + sparse.diags_array(precision)), np.concatenate([told.real, told.imag])


def _factors(normal: sparse.csc_array) -> SuperLU:
    return splu(sparse.csc_matrix(normal), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})


def _half_log_det(factors: SuperLU) -> float:
    return 0.5 * float(np.log(np.abs(factors.U.diagonal())).sum())
