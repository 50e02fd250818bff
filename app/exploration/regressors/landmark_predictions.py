"""What many team configurations close to the present one would show of the landmarks, compiled.

A vehicle moves little in one step, so only the landmarks around where it is now can matter to it: they are listed once
per step, and every candidate is judged on these short lists. Exact, and linear in vehicles, landmarks and candidates.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

FAR = 1e300
WORKERS = min(4, os.cpu_count() or 1)
WORTH_SHARING = 1_000_000
"""Pairs of candidate and listed landmark from which on several threads share the candidates; below, starting them costs
more than it saves. Each candidate is judged by itself, so the result is the same."""


@njit(cache=True, nogil=True)
def within_reach(
    positions: FloatArray, points: FloatArray, reach: FloatArray, visibility: float
) -> tuple[NDArray[np.int64], IntArray]:
    """List, vehicle by vehicle, the landmarks it may see after its move, and always the one then closest to it.

    Parameters
    ----------
    positions : (n_vehicles, 3)
        Where the vehicles are.
    points : (n, 3)
        Landmarks.
    reach : (n_vehicles,)
        Longest move of each.
    visibility : float
        Distance within which a landmark is seen.

    Returns
    -------
    starts : (n_vehicles + 1,)
        Where each vehicle's list starts.
    index : (starts[-1],)
        Rows of ``points``.
    """
    n, m = len(positions), len(points)
    starts = np.zeros(n + 1, dtype=np.int64)
    index = np.empty(n * m, dtype=np.int32)
    squared = np.empty(m)
    filled = 0
    for i in range(n):
        least = np.inf
        for k in range(m):
            dx = positions[i, 0] - points[k, 0]
            dy = positions[i, 1] - points[k, 1]
            dz = positions[i, 2] - points[k, 2]
            squared[k] = dx * dx + dy * dy + dz * dz
            least = min(least, squared[k])
        radius = (max(visibility, np.sqrt(least) + reach[i]) + reach[i]) * (1.0 + 1e-9)
        for k in range(m):
            if squared[k] <= radius * radius:
                index[filled] = k
                filled += 1
        starts[i + 1] = filled
    return starts, index[:filled].copy()


def predict(
    candidates: FloatArray,
    near: FloatArray,
    index: IntArray,
    starts: NDArray[np.int64],
    needed: FloatArray,
    goals: FloatArray,
    visibility: float,
    noise: float,
    step: float,
) -> FloatArray:
    """Return, for each configuration, expected progress, newly accurate landmarks, and minus the distance left, (c, 3).

    Parameters
    ----------
    candidates : (c, n_vehicles, 3)
        Configurations.
    near : (k, 3)
        The landmarks of the lists.
    index, starts
        As returned by :func:`within_reach`.
    needed : (n,)
        Information (inverse variance) that each landmark lacks.
    goals : (g, 3)
        Where the vehicles are drawn: a single common goal, or all landmarks, of which each vehicle takes the closest.
    visibility, noise : float
        Of the range sensor.
    step : float
        Unit of distance.
    """
    members, slot = np.unique(index, return_inverse=True)
    unit = 1.0 / (noise * noise * needed[members])
    x, y, z = (np.ascontiguousarray(near[:, d]) for d in range(3))
    arguments = (x, y, z, unit[slot], slot.astype(np.int32), len(members), starts, goals, visibility, step)
    if len(candidates) * len(index) < WORTH_SHARING:
        return _predict(candidates, *arguments)
    parts = np.array_split(candidates, WORKERS)
    return np.concatenate(list(_pool().map(lambda part: _predict(part, *arguments), parts)))


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(WORKERS, thread_name_prefix="predict")


@njit(cache=True, nogil=True)
def _predict(
    candidates: FloatArray,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    weight: FloatArray,
    slot: IntArray,
    members: int,
    starts: NDArray[np.int64],
    goals: FloatArray,
    visibility: float,
    step: float,
) -> FloatArray:
    c, n, _ = candidates.shape
    v2 = visibility * visibility
    common = len(goals) == 1
    out = np.zeros((c, 3))
    progress = np.zeros(members)
    gained = np.empty(len(x))
    for k in range(c):
        progress[:] = 0.0
        for i in range(n):
            px, py, pz = candidates[k, i, 0], candidates[k, i, 1], candidates[k, i, 2]
            first, last = starts[i], starts[i + 1]
            least = FAR
            for e in range(first, last):
                dx, dy, dz = px - x[e], py - y[e], z[e] - pz
                dz2 = dz * dz
                r2 = dx * dx + dy * dy + dz2
                least = min(least, r2)
                gained[e] = weight[e] * dz2 / (r2 * r2 + 1e-12) if r2 < v2 else 0.0
            for e in range(first, last):
                progress[slot[e]] += gained[e]
            if common:
                least = 0.0
                for d in range(3):
                    least += (candidates[k, i, d] - goals[0, d]) ** 2
            out[k, 2] -= np.sqrt(least) / step
        total, done = 0.0, 0
        for e in range(members):
            part = progress[e]
            total += part if part < 1.0 else 1.0
            done += 1 if part >= 1.0 else 0
        out[k, 0], out[k, 1] = total, done
    return out
