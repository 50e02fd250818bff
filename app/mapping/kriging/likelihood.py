"""Hyperparameters of the Gaussian process by restricted maximum likelihood on a bounded subset."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numba import njit
from scipy import linalg, optimize
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.mapping.kriging.conditionals import conditional_terms
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName, correlation_matrices
from app.mapping.kriging.neighbours import nearest
from app.mapping.kriging.scales import LocalScales

LN_NOISE_SCALE_SD = 0.7
"""Prior spread of ln(noise scale): how far the stated sounding errors are trusted (a factor of two or so)."""

LN_LENGTH_SD = 1.2
"""Prior spread of ln(length): keeps the length within reason while the soundings are few."""

LN_AMPLITUDE_SD = 2.0
"""Prior spread of ln(amplitude), about the spread of the depths."""

SLOPE_SD = 0.1
"""Prior standard deviation of the overall slope (m/m); settles what one straight track leaves open."""

MAX_ITERATIONS = 25

MANY_TO_CHOOSE_FROM = 4000
CLUSTER = 16  # neighbours taken with each of some points, where there are many to choose from


@dataclass(frozen=True)
class Hyperparameters:
    """Length (m), amplitude (standard deviation about the trend, m), factor on the noise variances."""

    length_m: float
    amplitude_m: float
    noise_scale: float


@dataclass(frozen=True)
class Trend:
    """A plane ``intercept + slope . (x - centre)`` with the covariance of its three coefficients."""

    centre_m: FloatArray
    coefficients: FloatArray
    covariance: FloatArray

    def basis(self, points: FloatArray) -> FloatArray:
        """Trend functions at ``points`` (n, 2): shape (n, 3)."""
        return np.column_stack([np.ones(len(points)), points - self.centre_m])

    def __call__(self, points: FloatArray) -> FloatArray:
        """Depth of the plane at ``points`` (n, 2), metres."""
        return np.asarray(self.basis(points) @ self.coefficients)


def scaled_distances(points: FloatArray, metric: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Split the Paciorek kernel of the length matrices ``l^2 * metric`` into parts that do not depend on ``l``.

    ``points`` is (..., n, 2), ``metric`` (..., n, 4).

    Returns
    -------
    distance : (..., n, n)
        To be divided by ``l``.
    prefactor : (..., n, n)
        ``|A|^(1/4) |B|^(1/4) |(A + B) / 2|^(-1/2)``.
    """
    n, groups = points.shape[-2], math.prod(points.shape[:-2])
    distance, prefactor = np.empty((groups, n, n)), np.empty((groups, n, n))
    _scaled_distances(points.reshape(groups, n, 2), metric.reshape(groups, n, 4), distance, prefactor)
    shape = (*points.shape[:-1], n)
    return distance.reshape(shape), prefactor.reshape(shape)


@njit(cache=True, nogil=True)
def _scaled_distances(points: FloatArray, metric: FloatArray, distance: FloatArray, prefactor: FloatArray) -> None:
    """Write :func:`scaled_distances` for groups of points, (k, n, 2); quicker than whole arrays that numpy makes."""
    for g in range(len(points)):
        for i in range(points.shape[1]):
            for j in range(i + 1):
                dx = points[g, i, 0] - points[g, j, 0]
                dy = points[g, i, 1] - points[g, j, 1]
                xx = 0.5 * (metric[g, i, 0] + metric[g, j, 0])
                xy = 0.5 * (metric[g, i, 1] + metric[g, j, 1])
                yy = 0.5 * (metric[g, i, 2] + metric[g, j, 2])
                det = xx * yy - xy * xy
                squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det
                distance[g, i, j] = distance[g, j, i] = np.sqrt(squared)
                prefactor[g, i, j] = prefactor[g, j, i] = metric[g, i, 3] * metric[g, j, 3] / np.sqrt(det)


class RestrictedLikelihood:
    """Log posterior of (ln length, ln amplitude, ln noise scale), the trend's coefficients integrated out.

    Parameters
    ----------
    kernel
        Correlation function.
    points : (n, 2), depth_m : (n,), noise_variance : (n,)
        The subset.
    scales
        Local amplitude and length of the subset's places.
    """

    def __init__(
        self,
        kernel: KernelName,
        points: FloatArray,
        depth_m: FloatArray,
        noise_variance: FloatArray,
        scales: LocalScales,
    ) -> None:
        self._kind = KERNEL_CODES[kernel]
        self._distance, prefactor = scaled_distances(points, scales.metric)
        self._prefactor = prefactor * scales.amplitude[:, None] * scales.amplitude[None, :]
        self._noise = noise_variance
        self._centre = points.mean(axis=0)
        self._basis = np.column_stack([np.ones(len(points)), points - self._centre])
        self._prior_precision = np.diag([0.0, SLOPE_SD**-2, SLOPE_SD**-2])
        self._reference = float(depth_m.mean())  # numbers near zero: the likelihood must not depend on the datum
        self._depth = depth_m - self._reference
        extent = float(np.ptp(points, axis=0).max())
        spread = float(np.std(depth_m))
        self._prior_mean = np.array(
            [
                math.log(max(extent, 1e-3) / 6.0),
                math.log(max(spread, float(np.sqrt(np.median(noise_variance))), 1e-6)),
                0.0,
            ]
        )
        self._prior_sd = np.array([LN_LENGTH_SD, LN_AMPLITUDE_SD, LN_NOISE_SCALE_SD])
        self._near: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None

    def also(
        self,
        members: IntArray,
        points: FloatArray,
        depth_m: FloatArray,
        noise_variance: FloatArray,
        scales: LocalScales,
    ) -> Self:
        """Let single soundings given their neighbours count too.

        ``members`` (k, m + 1) are rows of the arrays (n, ...), which hold all soundings.
        """
        metric, amplitude = scales.metric[members], scales.amplitude[members]
        distance, prefactor = scaled_distances(points[members], metric)
        prefactor *= amplitude[:, :, None] * amplitude[:, None, :]
        normal = self._basis.T @ self._basis + self._prior_precision * float(np.median(self._noise))
        plane = np.linalg.solve(normal, self._basis.T @ self._depth)
        trend = plane[0] + (points[members] - self._centre) @ plane[1:]
        residual = depth_m[members] - self._reference - trend
        self._near = distance, prefactor, noise_variance[members], residual
        return self

    @property
    def prior_mean(self) -> FloatArray:
        """Where the prior is highest, (3,)."""
        return self._prior_mean

    def _factor(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        value, slope = correlation_matrices(self._kind, self._distance / math.exp(theta[0]))
        signal = math.exp(2.0 * theta[1]) * self._prefactor
        value *= signal
        slope *= signal
        k = value.copy()
        k[np.diag_indices_from(k)] += math.exp(theta[2]) * self._noise + 1e-9 * np.diag(signal)
        return k, value, slope

    def value_and_gradient(self, theta: FloatArray) -> tuple[float, FloatArray]:
        """Minus the log posterior density and its gradient, (3,)."""
        k, value, slope = self._factor(theta)
        try:
            lower = linalg.cholesky(k, lower=True, overwrite_a=True, check_finite=False)
        except linalg.LinAlgError:
            return 1e25, np.zeros(3)
        n = len(k)
        ki_f = linalg.cho_solve((lower, True), self._basis, check_finite=False)
        a = self._basis.T @ ki_f + self._prior_precision
        a_factor = linalg.cho_factor(a, lower=True)
        beta = linalg.cho_solve(a_factor, ki_f.T @ self._depth)
        # P = K^-1 - K^-1 F A^-1 F' K^-1 takes the trend out
        alpha = linalg.cho_solve((lower, True), self._depth - self._basis @ beta, check_finite=False)
        trend_part = linalg.cho_solve(a_factor, ki_f.T).T
        nll = (
            0.5 * float(self._depth @ alpha)
            + float(np.log(np.diag(lower)).sum())
            + float(np.log(np.diag(a_factor[0])).sum())
            + 0.5 * n * math.log(2.0 * math.pi)
        )
        inverse, _ = linalg.lapack.dpotri(lower, lower=1, overwrite_c=1)  # its upper triangle is zero

        def trace(s: FloatArray) -> float:
            """Trace of (P - alpha alpha') S for a symmetric matrix."""
            whole = 2.0 * float(np.vdot(inverse, s)) - float(np.diag(inverse) @ np.diag(s))
            return whole - float(np.vdot(s @ ki_f, trend_part)) - float(alpha @ (s @ alpha))

        if self._near is not None:
            more, more_gradient = conditional_terms(self._kind, *self._near, theta)
            nll += more
        noise = math.exp(theta[2]) * self._noise
        diagonal = np.diag(inverse) - (ki_f * trend_part).sum(axis=1) - alpha**2
        gradient = 0.5 * np.array([trace(slope), 2.0 * trace(value), float(diagonal @ noise)])
        if self._near is not None:
            gradient += more_gradient
        z = (theta - self._prior_mean) / self._prior_sd
        return nll + 0.5 * float(z @ z), gradient + z / self._prior_sd

    def maximise(self, start: Hyperparameters | None) -> tuple[Hyperparameters, float]:
        """Return the most likely hyperparameters and minus their log posterior, found from ``start``."""
        theta = self._prior_mean if start is None else np.log([start.length_m, start.amplitude_m, start.noise_scale])
        low = self._prior_mean - np.array([4.0, 7.0, 4.0])
        high = self._prior_mean + np.array([3.0, 4.0, 4.0])
        result = optimize.minimize(
            self.value_and_gradient,
            np.clip(theta, low, high),
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)),
            options={"maxiter": MAX_ITERATIONS, "ftol": 1e-7},
        )
        length, amplitude, noise_scale = (float(x) for x in np.exp(result.x))
        return Hyperparameters(length, amplitude, noise_scale), float(result.fun)

    def trend(self, hyper: Hyperparameters) -> Trend:
        """Return the plane by generalised least squares."""
        k, _, _ = self._factor(np.log([hyper.length_m, hyper.amplitude_m, hyper.noise_scale]))
        factor = linalg.cho_factor(k, lower=True, overwrite_a=True, check_finite=False)
        ki_f = linalg.cho_solve(factor, self._basis)
        covariance = np.linalg.inv(self._basis.T @ ki_f + self._prior_precision)
        coefficients = covariance @ (ki_f.T @ self._depth)
        coefficients[0] += self._reference
        return Trend(self._centre, coefficients, covariance)


def spread_subset(tree: cKDTree, size: int) -> IntArray:
    """Choose at most ``size`` of the points of ``tree``, deterministically.

    Two thirds are every so-manieth in the given order (spatial order gives an even spread), one third the
    nearest neighbours of those: short distances tell noise and fine detail, long ones the large scales. Of very many
    points neighbours are too far from each other in such a choice to tell one from the other; then two thirds are
    clusters of neighbours.
    """
    n = tree.n
    if n <= size:
        return np.arange(n)
    many = n > MANY_TO_CHOOSE_FROM
    n_spread = size // 3 if many else (2 * size) // 3
    together = CLUSTER if many else 1
    spread = ((np.arange(n_spread) + 0.5) * (n / n_spread)).astype(np.int64)
    anchors = spread[:: max(1, -(-n_spread * together // (size - n_spread)))]
    _, near = nearest(tree, tree.data[anchors], together + 1)
    return np.union1d(spread, near[:, 1:])[:size]
