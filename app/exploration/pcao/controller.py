"""The P-controller of PCAO18: u = -B' M_z(x) P z(x) with z = (sqrt(beta_1) x, ..., sqrt(beta_L) x) (eq. 13-16).

P is block-diagonal over the mixing signals, over the vehicles (the same block for each, which is what makes one
controller serve any team) and over the horizontal and vertical part of the state. In the plane a block acts on both
coordinates alike (P x I_2), so that no direction of the compass is special. B leads a move into every horizontal
displacement and into the height. The mixing signals depend on what is left only, which a move does not change at once
(B has zero rows there): their derivatives in M_z meet zeros of B, and u = -sum_l beta_l B' P_l x.
"""

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.exploration.pcao.state import N_FIGURES, N_VECTORS

L = 3
"""Mixing signals: plenty left here; little left here, but much elsewhere; little left anywhere."""

BLOCKS = tuple(size for _ in range(L) for size in (N_VECTORS, N_FIGURES))
"""Sizes of the blocks of P: for every mixing signal the horizontal and the vertical one."""

SIZE = sum(size * (size + 1) // 2 for size in BLOCKS)
"""Free entries of P: the upper triangles of its blocks, row by row."""

E1, E2 = 0.01, 10.0
"""Bounds on the eigenvalues of P."""


@njit(cache=True, nogil=True)
def mixing(here: float, left: float) -> tuple[float, float, float]:
    """Return beta_1 to beta_3 from the share left here and the share left of the whole; they add up to 1."""
    plenty = 1.0 / (1.0 + np.exp(-(here - 0.25) / 0.06))
    much = 1.0 / (1.0 + np.exp(-(left - 0.2) / 0.06))
    return plenty, (1.0 - plenty) * much, (1.0 - plenty) * (1.0 - much)


@njit(cache=True, nogil=True)
def control(
    vectors: FloatArray, figures: FloatArray, schedule: FloatArray, horizontal: FloatArray, vertical: FloatArray
) -> FloatArray:
    """Return u for every vehicle, (n, 3): east, north, down, before it is cut to what a vehicle can do.

    Parameters
    ----------
    vectors, figures, schedule
        The states, as :func:`app.exploration.pcao.state.reduced_state` returns them.
    horizontal, vertical : (L, 7), (L, 4)
        The rows B'P_l of :func:`gains`.
    """
    n = len(vectors)
    u = np.zeros((n, 3))
    for v in range(n):
        beta = mixing(schedule[v, 0], schedule[v, 1])
        for m in range(3):
            for k in range(vectors.shape[1]):
                u[v, 0] -= beta[m] * horizontal[m, k] * vectors[v, k, 0]
                u[v, 1] -= beta[m] * horizontal[m, k] * vectors[v, k, 1]
            for k in range(figures.shape[1]):
                u[v, 2] += beta[m] * vertical[m, k] * figures[v, k]  # a height shrinks as the depth grows
    return u


@njit(cache=True, nogil=True)
def within_step(u: FloatArray, step: float, each_direction: bool) -> FloatArray:
    """Return the moves (n, 3) for u (n, 3), in largest steps, shortened to what is allowed.

    Each direction is limited by itself (PCAO18 eq. 1; the course is kept), or the whole move.
    """
    moves = u * step
    for v in range(len(u)):
        x, y = abs(u[v, 0]), abs(u[v, 1])
        flat = max(x, y) if each_direction else np.hypot(x, y)
        if flat > 1.0:
            moves[v, 0] /= flat
            moves[v, 1] /= flat
        moves[v, 2] = min(step, max(-step, moves[v, 2]))
        if not each_direction:
            size = np.sqrt(moves[v, 0] ** 2 + moves[v, 1] ** 2 + moves[v, 2] ** 2)
            if size > step:
                moves[v] *= step / size
    return moves


def blocks(parameters: FloatArray) -> list[FloatArray]:
    """Return the blocks of P, each (size, size), from its free entries (SIZE,)."""
    result, at = [], 0
    for size in BLOCKS:
        count = size * (size + 1) // 2
        block = np.zeros((size, size))
        block[np.triu_indices(size)] = parameters[at : at + count]
        result.append(block + np.triu(block, 1).T)
        at += count
    return result


def entries(of: list[FloatArray]) -> FloatArray:
    """Return the free entries (SIZE,) of blocks; the inverse of :func:`blocks`."""
    return np.concatenate([block[np.triu_indices(len(block))] for block in of])


def within_bounds(parameters: FloatArray, e1: float = E1, e2: float = E2) -> FloatArray:
    """Return the nearest P (SIZE,) with e1 I <= P <= e2 I, in the Frobenius norm."""
    result = []
    for block in blocks(parameters):
        values, axes = np.linalg.eigh(block)
        result.append((axes * np.clip(values, e1, e2)) @ axes.T)
    return entries(result)


def gains(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return B'P_l for every mixing signal: horizontal (L, 7) and vertical (L, 4)."""
    of = blocks(parameters)
    horizontal = np.array([block.sum(axis=0) for block in of[0::2]])
    vertical = np.array([block[0] for block in of[1::2]])
    return horizontal, vertical


def random_parameters(rng: np.random.Generator, count: int = 1, e1: float = E1, e2: float = E2) -> FloatArray:
    """Return random P (count, SIZE) within the bounds: random axes, eigenvalues even in their logarithm."""
    result = []
    for size in BLOCKS:
        axes, _ = np.linalg.qr(rng.standard_normal((count, size, size)))
        values = np.exp(rng.uniform(np.log(e1), np.log(e2), (count, 1, size)))
        of = (axes * values) @ axes.transpose(0, 2, 1)
        result.append(of[(slice(None), *np.triu_indices(size))])
    return np.concatenate(result, axis=1)
