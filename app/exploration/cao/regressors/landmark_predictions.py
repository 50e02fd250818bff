"""What many team configurations close to the present one would show of the landmarks, compiled.

A vehicle moves little in one step, so only the landmarks around where it is now can matter to it: they are listed once
per step, and every candidate is judged on these short lists. None is left out, and the time is linear in
vehicles, landmarks and candidates.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import FloatArray

Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int32]

FAR = np.float32(1e30)
WORKERS = min(4, os.cpu_count() or 1)
WORTH_SHARING = 1_000_000
"""Pairs of candidate and listed landmark from which on several threads share the candidates; below, starting them costs
more than it saves. Each candidate is judged by itself, so the result is the same."""


@njit(cache=True, nogil=True)
def within_reach(
    positions: FloatArray, points: FloatArray, reach: FloatArray, visibility: float
) -> tuple[NDArray[np.int64], IntArray]:
    """List, vehicle by vehicle, the landmarks that may be closest to it after its move, then others it may then see.

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
    starts : (2 * n_vehicles + 1,)
        Where each vehicle's list starts, and where in it those end that may be closest.
    index : (starts[-1],)
        Rows of ``points``.
    """
    n, m = len(positions), len(points)
    starts = np.zeros(2 * n + 1, dtype=np.int64)
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
        close = ((np.sqrt(least) + 2.0 * reach[i]) * (1.0 + 1e-6)) ** 2
        seen = ((visibility + reach[i]) * (1.0 + 1e-6)) ** 2
        for k in range(m):
            if squared[k] <= close:
                index[filled] = k
                filled += 1
        starts[2 * i + 1] = filled
        for k in range(m):
            if close < squared[k] <= seen:
                index[filled] = k
                filled += 1
        starts[2 * i + 2] = filled
    return starts, index[:filled].copy()


class Listed(NamedTuple):
    """Landmarks as they are listed for the vehicles, k entries in all.

    Attributes
    ----------
    points : (k, 3)
        Where they are.
    rows : (k,), starts : (2 * n_vehicles + 1,)
        As returned by :func:`within_reach`.
    needed : (n,)
        Information (inverse variance) that each landmark lacks, one entry for each landmark that there is.
    direction : (k, 3) or None
        Along which each is to be known; None: all of them are depths.
    """

    points: FloatArray
    rows: IntArray
    starts: NDArray[np.int64]
    needed: FloatArray
    direction: FloatArray | None = None


def predict(
    positions: FloatArray,
    candidates: FloatArray,
    listed: Listed,
    goals: FloatArray | None,
    visibility: float,
    noise: float,
    step: float,
) -> FloatArray:
    """Return, for each configuration, expected progress, newly accurate landmarks, and minus the distance left, (c, 3).

    Parameters
    ----------
    positions : (n_vehicles, 3)
        Where the vehicles are.
    candidates : (c, n_vehicles, 3)
        Configurations close to it.
    listed
        The landmarks around each vehicle.
    goals : (n_vehicles, 3) or None
        Where each vehicle is drawn; None: to the landmark that is closest to it.
    visibility, noise : float
        Of the range sensor.
    step : float
        Unit of distance.
    """
    near, rows, starts, needed, direction = listed
    members, slot = np.unique(rows, return_inverse=True)
    unit = 1.0 / (noise * noise * needed[members])
    owner = np.repeat(np.arange(len(positions)), np.diff(starts[::2]))
    # Single precision, relative to where each vehicle is now: twice as many at once, and to a millionth of the range.
    offsets = np.ascontiguousarray((near - positions[owner]).T, dtype=np.float32)
    arguments = (
        *offsets,
        unit[slot].astype(np.float32),
        slot.astype(np.int32),
        len(members),
        starts,
        np.float32(visibility * visibility),
        np.zeros((3, 0), dtype=np.float32)
        if direction is None
        else np.ascontiguousarray(direction.T, dtype=np.float32),
    )
    moves = (candidates - positions).astype(np.float32)
    parts = np.array_split(moves, WORKERS) if len(moves) * len(rows) >= WORTH_SHARING else [moves]
    done = (
        _pool().map(lambda part: _predict(part, *arguments), parts) if len(parts) > 1 else [_predict(moves, *arguments)]
    )
    progress, completed, squared = (np.concatenate(rows) for rows in zip(*done, strict=True))
    if goals is not None:
        squared = ((candidates - goals) ** 2).sum(axis=2)
    return np.column_stack([progress, completed, -np.sqrt(squared).sum(axis=1) / step])


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(WORKERS, thread_name_prefix="predict")


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _look(
    px: float,
    py: float,
    pz: float,
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    weight: Float32Array,
    v2: np.float32,
    near: int,
    gained: Float32Array,
) -> np.float32:
    """Write what is gained from each landmark of a list; return the least squared distance to the first ``near``.

    Two loops, because the compiler does the first one many at a time only if nothing else happens in it.
    """
    for e in range(len(x)):
        dx, dy, dz = px - x[e], py - y[e], z[e] - pz
        dz2 = dz * dz
        r2 = dx * dx + dy * dy + dz2
        value = weight[e] * dz2 / (r2 * r2 + np.float32(1e-12))
        gained[e] = value if r2 < v2 else np.float32(0.0)
    least = FAR
    for e in range(near):
        dx, dy, dz = px - x[e], py - y[e], z[e] - pz
        r2 = dx * dx + dy * dy + dz * dz
        least = r2 if r2 < least else least
    return least


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _look_along(
    px: float,
    py: float,
    pz: float,
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    weight: Float32Array,
    v2: np.float32,
    direction: Float32Array,
    gained: Float32Array,
) -> None:
    """Write what is gained along the tasks' directions."""
    for e in range(len(x)):
        dx, dy, dz = px - x[e], py - y[e], pz - z[e]
        r2 = dx * dx + dy * dy + dz * dz
        along = direction[0, e] * dx + direction[1, e] * dy + direction[2, e] * dz
        value = weight[e] * along * along / (r2 * r2 + np.float32(1e-12))
        gained[e] = value if r2 < v2 else np.float32(0.0)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _predict(
    moves: Float32Array,
    x: Float32Array,
    y: Float32Array,
    z: Float32Array,
    weight: Float32Array,
    slot: IntArray,
    members: int,
    starts: NDArray[np.int64],
    v2: np.float32,
    direction: Float32Array,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return progress (c,), completed landmarks (c,) and squared distances to the closest landmark (c, n_vehicles)."""
    c, n, _ = moves.shape
    one, none = np.float32(1.0), np.float32(0.0)
    expected, completed, closest = np.empty(c), np.empty(c), np.empty((c, n))
    progress = np.zeros(members, dtype=np.float32)
    gained = np.empty(len(x), dtype=np.float32)
    for k in range(c):
        progress[:] = none
        for i in range(n):
            px, py, pz = moves[k, i, 0], moves[k, i, 1], moves[k, i, 2]
            first, near, last = starts[2 * i], starts[2 * i + 1], starts[2 * i + 2]
            closest[k, i] = _look(
                px, py, pz, x[first:last], y[first:last], z[first:last], weight[first:last], v2,
                near - first, gained[first:last],
            )  # fmt: skip
            if direction.shape[1]:
                _look_along(
                    px, py, pz, x[first:last], y[first:last], z[first:last], weight[first:last], v2,
                    direction[:, first:last], gained[first:last],
                )  # fmt: skip
            for e in range(first, last):
                progress[slot[e]] += gained[e]
        total, done = none, 0
        for e in range(members):
            part = progress[e]
            total += part if part < one else one
            done += 1 if part >= one else 0
        expected[k], completed[k] = total, done
    return expected, completed, closest
