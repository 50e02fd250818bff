"""How variable the sea floor is, place by place: learned from predicting soundings across holes."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.mapping.kriging.kriging import krige_holes
from app.mapping.kriging.neighbours import nearest

HOLE_NEIGHBOURS = 24
SMOOTHING_NEIGHBOURS = 30
SMOOTHING_BANDWIDTH = 0.6  # of the distance to the farthest smoothing neighbour
TYPICAL_FLOOR = 0.05
PRIOR_WEIGHT = 4.0
RATIO_RANGE = (0.02, 30.0)
SCORE_RANGE = (-3.0, 15.0)


@dataclass(frozen=True)
class HoleErrors:
    """Cross-validation across holes: squared error over what the model expects, and how much that tells.

    Attributes
    ----------
    points_m : (h, 2)
    score : (h,)
        (squared error - noise part) / model part, clipped to ``SCORE_RANGE``; 1 on average if the model
        holds.
    weight : (h,)
        (model part / (model part + noise part))^2: small where noise hides the relief.
    """

    points_m: FloatArray
    score: FloatArray
    weight: FloatArray


def neighbours_beyond(tree: cKDTree, rows: IntArray, radius_m: float, k: int) -> IntArray:
    """Return the ``k`` points of ``tree`` nearest to each of ``rows`` at ``radius_m`` or more: (h, k), -1 for none."""
    points = np.asarray(tree.data)
    northward = np.argsort(points[:, 1], kind="stable")
    return _neighbours_beyond(np.ascontiguousarray(points[northward]), northward, rows, radius_m, k)


@njit(cache=True, nogil=True)
def _neighbours_beyond(points: FloatArray, number: IntArray, rows: IntArray, radius_m: float, k: int) -> IntArray:
    """Search from each point's own northing to both sides, as far as any nearer one may be.

    ``points`` (n, 2) ascend in northing, ``number`` (n,) is what each is called.
    """
    n = len(points)
    place = np.empty(n, np.int64)
    for i in range(n):
        place[number[i]] = i
    result = np.full((len(rows), k), -1, np.int64)
    squared = np.empty(k)
    for t in range(len(rows)):
        begin = place[rows[t]]
        east, north = points[begin, 0], points[begin, 1]
        found = 0
        for side in (-1, 1):
            i = begin if side < 0 else begin + 1
            while 0 <= i < n:
                dy = points[i, 1] - north
                if found == k and dy * dy >= squared[k - 1]:
                    break
                dx = points[i, 0] - east
                d2 = dx * dx + dy * dy
                if (found < k or d2 < squared[k - 1]) and np.sqrt(d2) >= radius_m:
                    j = min(found, k - 1)
                    while j > 0 and squared[j - 1] > d2:
                        squared[j] = squared[j - 1]
                        result[t, j] = result[t, j - 1]
                        j -= 1
                    squared[j] = d2
                    result[t, j] = number[i]
                    found = min(found + 1, k)
                i += side
    return result


def hole_errors(
    kind: int,
    tree: cKDTree,
    residual: FloatArray,
    noise: FloatArray,
    metric: FloatArray,
    amplitude: FloatArray,
    rows: IntArray,
    radius_m: float,
) -> HoleErrors:
    """Predict the soundings ``rows`` from those at distance ``radius_m`` or more and compare."""
    points = np.asarray(tree.data)
    neighbours = neighbours_beyond(tree, rows, radius_m, HOLE_NEIGHBOURS)
    error, noise_part, model_part = krige_holes(kind, points, residual, noise, metric, amplitude, rows, neighbours)
    known = np.isfinite(error)
    error, noise_part, model_part = error[known], noise_part[known], model_part[known]
    return HoleErrors(
        points_m=points[rows[known]],
        score=np.clip((error**2 - noise_part) / model_part, *SCORE_RANGE),
        weight=(model_part / (model_part + noise_part)) ** 2,
    )


def local_ratio(errors: HoleErrors, at: FloatArray, reach_m: float, apart_m: float = 0.0) -> FloatArray:
    """Smooth the scores at the positions ``at`` (m, 2), relative to the whole area: (m,), about 1 on average.

    A mean of the nearest scores with Gaussian weights, shrunk towards the mean of all scores as if
    ``PRIOR_WEIGHT`` further soundings had scored that. Beyond ``reach_m`` soundings say little, so the ratio
    returns to 1 where there are none. Those nearer than ``apart_m`` say nothing.
    """
    if len(errors.score) == 0:
        return np.ones(len(at))
    typical = max(float(np.average(errors.score, weights=errors.weight)), TYPICAL_FLOOR)
    distance, index = nearest(cKDTree(errors.points_m), at, SMOOTHING_NEIGHBOURS)
    bandwidth = np.clip(SMOOTHING_BANDWIDTH * distance[:, -1:], 1e-9, reach_m)
    weight = errors.weight[index] * np.exp(-0.5 * (distance / bandwidth) ** 2) * (distance >= apart_m)
    total = PRIOR_WEIGHT * typical + (weight * errors.score[index]).sum(axis=1)
    return np.asarray(np.clip(total / (PRIOR_WEIGHT + weight.sum(axis=1)) / typical, *RATIO_RANGE))
