"""Correlation functions and the small dense linear algebra that local kriging needs, compiled."""

import math
from typing import Literal

import numpy as np
from numba import njit

from app.arrays import FloatArray

KernelName = Literal["matern32", "matern52", "exponential", "gaussian"]

MATERN32, MATERN52, EXPONENTIAL, GAUSSIAN = 0, 1, 2, 3
KERNEL_CODES: dict[str, int] = {
    "matern32": MATERN32,
    "matern52": MATERN52,
    "exponential": EXPONENTIAL,
    "gaussian": GAUSSIAN,
}

SQRT3 = math.sqrt(3.0)
SQRT5 = math.sqrt(5.0)

FAST = {"reassoc", "contract", "arcp", "nsz"}

LARGEST_EXPONENT = 60.0  # beyond it a correlation is zero for every purpose


@njit(cache=True, nogil=True, inline="always")
def exp_minus(t: float) -> float:
    """``exp(-t)`` for t >= 0 without a branch or a call, so that loops over it become vector instructions.

    Taylor's polynomial of exp(-t / 256), then squared eight times: relative error below 1e-12 for t < 10, 2e-6 at
    60, where it is held.
    """
    x = -min(t, LARGEST_EXPONENT) * (1.0 / 256.0)
    p = 1.0 + x * (1.0 + x * (1 / 2 + x * (1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720))))))
    p *= p
    p *= p
    p *= p
    p *= p
    p *= p
    p *= p
    p *= p
    p *= p
    return p


@njit(cache=True, nogil=True, fastmath=FAST)
def covariance_row(kind: int, uniform: bool, place: FloatArray, others: FloatArray, n: int, out: FloatArray) -> None:
    """Covariance between one place and the first ``n`` of ``others``, written to ``out``.

    Parameters
    ----------
    uniform
        Amplitude and length are the same everywhere, no direction is preferred.
    place : (7,), others : (7, m)
        East, north, amplitude, and the four numbers of the squared-length matrix as in ``paciorek``.
    """
    x, y, amplitude, a0, a1, a2, a3 = place[0], place[1], place[2], place[3], place[4], place[5], place[6]
    distance = np.empty(n)
    if uniform:
        shrink = 1.0 / math.sqrt(a0)
        for c in range(n):
            dx = others[0, c] - x
            dy = others[1, c] - y
            distance[c] = math.sqrt(dx * dx + dy * dy) * shrink
            out[c] = amplitude * amplitude
    for c in range(0 if uniform else n):
        dx = others[0, c] - x
        dy = others[1, c] - y
        xx = 0.5 * (others[3, c] + a0)
        xy = 0.5 * (others[4, c] + a1)
        yy = 0.5 * (others[5, c] + a2)
        det = xx * yy - xy * xy
        distance[c] = math.sqrt(abs(yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det)
        out[c] = amplitude * others[2, c] * a3 * others[6, c] / math.sqrt(det)
    if kind == MATERN32:
        for c in range(n):
            t = SQRT3 * distance[c]
            out[c] *= (1.0 + t) * exp_minus(t)
    elif kind == MATERN52:
        for c in range(n):
            t = SQRT5 * distance[c]
            out[c] *= (1.0 + t + t * t * (1 / 3)) * exp_minus(t)
    elif kind == EXPONENTIAL:
        for c in range(n):
            out[c] *= exp_minus(distance[c])
    else:
        for c in range(n):
            out[c] *= exp_minus(0.5 * distance[c] * distance[c])


@njit(cache=True, nogil=True, inline="always")
def correlation(kind: int, r: float) -> float:
    """Correlation at the scaled distance ``r = d / length``."""
    if kind == MATERN32:
        t = SQRT3 * r
        return (1.0 + t) * math.exp(-t)
    if kind == MATERN52:
        t = SQRT5 * r
        return (1.0 + t + t * t / 3.0) * math.exp(-t)
    if kind == EXPONENTIAL:
        return math.exp(-r)
    return math.exp(-0.5 * r * r)


@njit(cache=True, nogil=True, inline="always")
def correlation_and_slope(kind: int, r: float) -> tuple[float, float]:
    """Correlation at the scaled distance ``r = d / length`` and its derivative with respect to ln(length)."""
    if kind == MATERN32:
        t = SQRT3 * r
        e = math.exp(-t)
        return (1.0 + t) * e, t * t * e
    if kind == MATERN52:
        t = SQRT5 * r
        e = math.exp(-t)
        return (1.0 + t + t * t / 3.0) * e, t * t * (1.0 + t) * e / 3.0
    if kind == EXPONENTIAL:
        e = math.exp(-r)
        return e, r * e
    e = math.exp(-0.5 * r * r)
    return e, r * r * e


@njit(cache=True, nogil=True)
def correlation_matrices(kind: int, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Correlation and its derivative with respect to ln(length), elementwise; ``r`` is symmetric, (n, n)."""
    n = r.shape[0]
    value = np.empty((n, n))
    slope = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            v, s = correlation_and_slope(kind, r[i, j])
            value[i, j] = value[j, i] = v
            slope[i, j] = slope[j, i] = s
    return value, slope


@njit(cache=True, nogil=True, inline="always")
def paciorek(kind: int, dx: float, dy: float, a: FloatArray, b: FloatArray) -> float:
    """Nonstationary correlation in the plane (Paciorek and Schervish 2006).

    ``|A|^(1/4) |B|^(1/4) |M|^(-1/2) rho(sqrt(d' M^-1 d))``, ``M = (A + B) / 2``, with the squared-length
    matrices A and B of the two places, each given as ``(xx, xy, yy, |.|^(1/4))``.
    """
    xx = 0.5 * (a[0] + b[0])
    xy = 0.5 * (a[1] + b[1])
    yy = 0.5 * (a[2] + b[2])
    det = xx * yy - xy * xy
    d2 = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / det
    value: float = a[3] * b[3] / math.sqrt(det) * correlation(kind, math.sqrt(d2))
    return value


@njit(cache=True, nogil=True, fastmath=FAST)
def cholesky_in_place(a: FloatArray, n: int) -> bool:
    """Replace the lower triangle of the leading ``n`` rows by its Cholesky factor; False if impossible."""
    for i in range(n):
        for j in range(i + 1):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            if i == j:
                if s <= 0.0:
                    return False
                a[i, i] = math.sqrt(s)
            else:
                a[i, j] = s / a[j, j]
    return True


@njit(cache=True, nogil=True, fastmath=FAST)
def solve_lower_in_place(a: FloatArray, n: int, b: FloatArray) -> None:
    """Replace ``b`` by ``L^-1 b`` for the factor in the lower triangle of ``a``."""
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i]


@njit(cache=True, nogil=True, fastmath=FAST)
def solve_lower_columns_in_place(a: FloatArray, n: int, b: FloatArray, columns: int) -> None:
    """Replace the first ``columns`` columns of ``b`` (n or more rows) by ``L^-1 b``, all of them at once."""
    for i in range(n):
        for k in range(i):
            factor = a[i, k]
            for c in range(columns):
                b[i, c] -= factor * b[k, c]
        scale = 1.0 / a[i, i]
        for c in range(columns):
            b[i, c] *= scale
