"""Likelihood of single soundings given their neighbours: what a small, spread subset cannot tell.

A subset of a few hundred soundings says how the sea floor varies over long distances, but hardly holds two that are
close, which tell noise from fine relief. Vecchia (1988) wrote a joint density as a product of conditional ones, each
given a few neighbours only; a sample of such terms is cheap however many soundings there are.
"""

import math

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.mapping.kriging.kernels import FAST, cholesky_in_place, correlation_and_slope, solve_lower_in_place
from app.mapping.kriging.neighbours import nearest

RANKS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 13, 17, 23, 31, 42, 57, 76)
"""Which of its neighbours, counted by distance, a sounding is predicted from: mostly near ones, some farther off."""


def families(tree: cKDTree, count: int) -> IntArray | None:
    """Choose at most ``count`` soundings, every so-manieth, each with the neighbours that it is predicted from.

    Returns their rows (k, m + 1), the predicted one first; None where there are too few.
    """
    n = tree.n
    ranks = [rank for rank in RANKS if rank < n]
    if len(ranks) < 3:
        return None
    first = np.unique(((np.arange(count) + 0.5) * (n / count)).astype(np.int64))
    _, near = nearest(tree, tree.data[first], ranks[-1] + 1)
    near = np.where(near == first[:, None], near[:, :1], near)  # of two at one place either may be found first
    return np.column_stack([first, near[:, ranks]])


@njit(cache=True, nogil=True, fastmath=FAST)
def conditional_terms(
    kind: int,
    distance: FloatArray,
    prefactor: FloatArray,
    noise: FloatArray,
    residual: FloatArray,
    theta: FloatArray,
) -> tuple[float, FloatArray]:
    """Return minus the sum of log densities of first members given the others, and its gradient, (3,).

    Parameters
    ----------
    distance, prefactor : (k, m + 1, m + 1)
        As from :func:`app.mapping.kriging.likelihood.scaled_distances`, the prefactor times both local amplitudes.
    noise, residual : (k, m + 1)
        Stated noise variances; depths minus the trend.
    theta : (3,)
        ln length, ln amplitude, ln noise scale.
    """
    count, size = residual.shape
    m = size - 1
    shrink = math.exp(-theta[0])
    variance = math.exp(2.0 * theta[1])
    factor = math.exp(theta[2])
    total = 0.0
    gradient = np.zeros(3)
    signal = np.empty((size, size))
    slope = np.empty((size, size))
    lower = np.empty((m, m))
    w = np.empty(m)
    alpha = np.empty(m)
    for f in range(count):
        for i in range(size):
            for j in range(i + 1):
                r = distance[f, i, j] * shrink
                s = variance * prefactor[f, i, j]
                value, change = correlation_and_slope(kind, r)
                signal[i, j] = signal[j, i] = s * value
                slope[i, j] = slope[j, i] = s * change
        for i in range(m):
            for j in range(i + 1):
                lower[i, j] = signal[i + 1, j + 1]
            lower[i, i] += factor * noise[f, i + 1] + 1e-9 * signal[i + 1, i + 1]
            w[i] = signal[0, i + 1]
            alpha[i] = residual[f, i + 1]
        if not cholesky_in_place(lower, m):
            return 1e25, np.zeros(3)
        _solve(lower, m, w)
        _solve(lower, m, alpha)
        mean = 0.0
        explained = 0.0
        own = factor * noise[f, 0]
        noise_mean = 0.0
        noise_spread = 0.0
        length_mean = 0.0
        length_spread = 0.0
        for i in range(m):
            mean += signal[0, i + 1] * alpha[i]
            explained += signal[0, i + 1] * w[i]
            along = factor * noise[f, i + 1] * w[i]
            noise_mean += along * alpha[i]
            noise_spread += along * w[i]
            length_mean += slope[0, i + 1] * alpha[i]
            length_spread -= 2.0 * slope[0, i + 1] * w[i]
            by_alpha = 0.0
            by_w = 0.0
            for j in range(m):
                by_alpha += slope[i + 1, j + 1] * alpha[j]
                by_w += slope[i + 1, j + 1] * w[j]
            length_mean -= w[i] * by_alpha
            length_spread += w[i] * by_w
        spread = signal[0, 0] * (1.0 + 1e-9) + own - explained
        # what grows with the amplitude is all but the noise
        d_mean = (length_mean, 2.0 * noise_mean, -noise_mean)
        d_spread = (length_spread, 2.0 * (signal[0, 0] - explained - noise_spread), own + noise_spread)
        if spread <= 0.0:
            return 1e25, np.zeros(3)
        off = residual[f, 0] - mean
        total += 0.5 * (math.log(2.0 * math.pi * spread) + off * off / spread)
        for p in range(3):
            gradient[p] += 0.5 * d_spread[p] / spread * (1.0 - off * off / spread) - off * d_mean[p] / spread
    return total, gradient


@njit(cache=True, nogil=True, fastmath=FAST)
def _solve(lower: FloatArray, n: int, b: FloatArray) -> None:
    """Replace ``b`` by ``(L L')^-1 b``."""
    solve_lower_in_place(lower, n, b)
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= lower[k, i] * b[k]
        b[i] = s / lower[i, i]
