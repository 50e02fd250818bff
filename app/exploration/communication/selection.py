"""Which vehicles and which landmark entries a message is for (AURO15 sec. 3.4)."""

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray


def reachable(positions: FloatArray, visible_by: BoolArray, xy_m: FloatArray, travel_m: float) -> BoolArray:
    """Return the reachable exploration areas: element (j, k) says that vehicle k is in that of j.

    That is so when, of the landmarks visible to j, the one closest to k in the plane lies within the distance that k
    can travel in one step. No vehicle is in its own.

    Parameters
    ----------
    positions : (n_vehicles, 3)
        Where the vehicles are.
    visible_by : (n_vehicles, n_landmarks)
        ``V_j``.
    xy_m : (n_landmarks, 2)
        Where the landmarks are.
    travel_m : float
        Largest step.
    """
    return np.asarray(
        _reachable(np.ascontiguousarray(positions), visible_by, np.ascontiguousarray(xy_m), travel_m), dtype=np.bool_
    )


@njit(cache=True, nogil=True)
def _reachable(positions: FloatArray, visible_by: BoolArray, xy: FloatArray, travel: float) -> BoolArray:
    n = len(positions)
    result = np.zeros((n, n), dtype=np.bool_)
    for j in range(n):
        for k in range(n):
            if j == k:
                continue
            for m in range(len(xy)):
                if visible_by[j, m]:
                    dx = xy[m, 0] - positions[k, 0]
                    dy = xy[m, 1] - positions[k, 1]
                    if dx * dx + dy * dy <= travel * travel:
                        result[j, k] = True
                        break
    return result


def distance_to_receivers(xy_m: FloatArray, receivers_xy_m: FloatArray) -> FloatArray:
    """Return the distance in the plane of each landmark (n, 2) to the closest receiver (k, 2), (n,)."""
    offsets = xy_m[:, None, :] - receivers_xy_m[None, :, :]
    return np.asarray(np.sqrt((offsets**2).sum(axis=2).min(axis=1)), dtype=np.float64)


def fill(order: IntArray, xy_m: FloatArray, capacity: int, apart_m: float) -> IntArray:
    """Return what goes into a message: the first ``capacity`` landmarks of ``order`` that are no near-duplicates.

    A landmark within ``apart_m`` of one already taken waits; beyond the paper, which drops it, it takes a place that
    would stay free, because nothing else informs the receiver that this landmark is done.

    Parameters
    ----------
    order : (k,)
        Indices of landmarks, the most wanted first.
    xy_m : (n, 2)
        Where all landmarks are.
    """
    return np.asarray(_fill(order, xy_m, capacity, apart_m), dtype=np.int64)


@njit(cache=True, nogil=True)
def _fill(order: IntArray, xy: FloatArray, capacity: int, apart: float) -> IntArray:
    room = min(capacity, len(order))
    taken = np.empty(room, dtype=np.int64)
    used = np.zeros(len(order), dtype=np.bool_)
    count = 0
    for k in range(len(order)):
        if count == room:
            break
        near = False
        for c in range(count):
            dx = xy[order[k], 0] - xy[taken[c], 0]
            dy = xy[order[k], 1] - xy[taken[c], 1]
            if dx * dx + dy * dy < apart * apart:
                near = True
                break
        if not near:
            taken[count] = order[k]
            used[k] = True
            count += 1
    for k in range(len(order)):
        if count == room:
            break
        if not used[k]:
            taken[count] = order[k]
            count += 1
    return taken[:count]
