"""Gross errors among the soundings (fish, multiple echoes): found by two looks that must agree."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.mapping.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging import krige_holes
from app.mapping.likelihood import Hyperparameters, RestrictedLikelihood, Trend, spread_subset
from app.mapping.neighbours import nearest
from app.mapping.scales import uniform_scales
from app.mapping.supersoundings import merge_soundings
from app.mapping.threads import each
from app.mapping.types import BoolArray, FloatArray, IntArray, Soundings

PLANE_NEIGHBOURS = 16
KRIGING_NEIGHBOURS = 24
SUSPICION = 4.0
"""Robust standard deviations from a local plane that make a sounding suspect."""

CONVICTION = 5.0
"""Standard deviations from what its unsuspected neighbours predict that make a suspect an outlier."""

LEARNING_POINTS = 200
EXCUSE_POINTS = 600
EXCUSE_NEIGHBOURS = 12
EXCUSE_PRIOR_WEIGHT = 2.0
NORMAL_99 = 2.576
CHUNK = 30_000
"""Planes are fitted to so many soundings at a time: bounds the memory, and threads share the chunks."""


@dataclass(frozen=True)
class OutlierReport:
    """Which soundings were rejected and why.

    Attributes
    ----------
    rejected : (n,)
    predicted_m : (n,)
        What the neighbours say; NaN for soundings never suspected.
    deviations : (n,)
        Distance from the prediction in standard deviations; NaN for soundings never suspected.
    reasons
        One line per sounding, empty where accepted.
    hyperparameters
        The stationary model behind the verdicts.
    """

    rejected: BoolArray
    predicted_m: FloatArray
    deviations: FloatArray
    reasons: tuple[str, ...]
    hyperparameters: Hyperparameters


def flag_outliers(
    soundings: Soundings,
    *,
    kernel: KernelName = "matern32",
    hyperparameters: Hyperparameters | None = None,
) -> OutlierReport:
    """Find gross outliers.

    First look: a sounding is suspect when it lies more than ``SUSPICION`` robust standard deviations from a
    plane through its neighbours (the neighbours' own scatter about their planes sets the scale, so that
    steep or rough places do not raise suspicion). Second look: a suspect is rejected when it also lies more
    than ``CONVICTION`` standard deviations from what kriging predicts from unsuspected neighbours. How well
    leave-one-out prediction works nearby, and how heavy the tail of its errors is, scale the standard
    deviation.

    Parameters
    ----------
    hyperparameters
        Stationary model for the second look; learned from the unsuspected soundings when not given.

    Raises
    ------
    ValueError
        When there is no sounding, or one that is not finite or has no positive standard deviation.
    """
    soundings.check()
    n = len(soundings)
    if n == 0:
        raise ValueError("soundings is empty; there is nothing to judge")
    points = np.column_stack([soundings.east_m, soundings.north_m])
    suspect = _suspects(points, soundings)
    trusted = np.flatnonzero(~suspect)
    if len(trusted) == 0:
        trusted = np.arange(n)
        suspect = np.zeros(n, np.bool_)
    extent = max(float(np.ptp(points, axis=0).max()), 1e-3)
    merged, _ = merge_soundings(soundings.take(trusted), extent / 100.0)
    merged_points = np.column_stack([merged.east_m, merged.north_m])
    subset = spread_subset(merged_points, LEARNING_POINTS)
    likelihood = RestrictedLikelihood(
        kernel,
        merged_points[subset],
        merged.depth_m[subset],
        merged.sd_m[subset] ** 2,
        uniform_scales(len(subset)),
    )
    if hyperparameters is None:
        hyperparameters, _ = likelihood.maximise(None)

    predicted = np.full(n, np.nan)
    deviations = np.full(n, np.nan)
    rows = np.flatnonzero(suspect)
    if len(rows):
        trend = likelihood.trend(hyperparameters)
        _, near = nearest(cKDTree(merged_points), points[rows], KRIGING_NEIGHBOURS)
        # suspects go behind the trusted ones, so that one call predicts them from those
        m = len(merged_points)
        variance = np.concatenate([merged.sd_m, soundings.sd_m[rows]]) ** 2 * hyperparameters.noise_scale
        everywhere = np.concatenate([merged_points, points[rows]])
        depth = np.concatenate([merged.depth_m, soundings.depth_m[rows]])
        error, noise_part, model_part = krige_holes(
            KERNEL_CODES[kernel],
            everywhere,
            depth - trend(everywhere),
            variance,
            uniform_scales(len(everywhere)).scaled_metric(hyperparameters.length_m),
            np.full(len(everywhere), hyperparameters.amplitude_m),
            np.arange(m, m + len(rows)),
            near,
        )
        predicted[rows] = soundings.depth_m[rows] - error
        deviations[rows] = np.abs(error) / np.sqrt(noise_part + model_part)
        deviations[rows] /= _excuse(kernel, hyperparameters, merged_points, merged, trend, points[rows])
    rejected = np.nan_to_num(deviations) > CONVICTION
    reasons = [""] * n
    for i in np.flatnonzero(rejected):
        reasons[i] = (
            f"depth {soundings.depth_m[i]:.2f} m is {deviations[i]:.1f} standard deviations from the "
            f"{predicted[i]:.2f} m that its neighbours predict"
        )
    return OutlierReport(rejected, predicted, deviations, tuple(reasons), hyperparameters)


def _excuse(
    kernel: KernelName,
    hyper: Hyperparameters,
    points: FloatArray,
    merged: Soundings,
    trend: Trend,
    at: FloatArray,
) -> FloatArray:
    """By how much the model understates misses at the positions ``at`` (m, 2): rugged ground excuses them.

    The local root mean square of leave-one-out deviations, times the excess of their tail over the normal
    one.
    """
    n = len(points)
    rows = np.unique(np.linspace(0, n - 1, min(n, EXCUSE_POINTS)).astype(np.int64))
    _, near = nearest(cKDTree(points), points[rows], KRIGING_NEIGHBOURS + 1)
    near[near == rows[:, None]] = -1
    error, noise_part, model_part = krige_holes(
        KERNEL_CODES[kernel],
        points,
        merged.depth_m - trend(points),
        merged.sd_m**2 * hyper.noise_scale,
        uniform_scales(n).scaled_metric(hyper.length_m),
        np.full(n, hyper.amplitude_m),
        rows,
        near,
    )
    square = error**2 / (noise_part + model_part)
    known = np.isfinite(square)
    if known.sum() <= EXCUSE_NEIGHBOURS:
        return np.ones(len(at))
    square, places = square[known], points[rows[known]]
    tree = cKDTree(places)

    def local(near: IntArray) -> FloatArray:
        total = EXCUSE_PRIOR_WEIGHT * square.mean() + square[near].sum(axis=1)
        return np.asarray(np.sqrt(total / (EXCUSE_PRIOR_WEIGHT + near.shape[1])))

    others = nearest(tree, places, EXCUSE_NEIGHBOURS + 1)[1][:, 1:]
    tail = float(np.percentile(np.sqrt(square) / local(others), 99.0)) / NORMAL_99
    return max(1.0, tail) * local(nearest(tree, at, EXCUSE_NEIGHBOURS)[1])


def _suspects(points: FloatArray, soundings: Soundings) -> BoolArray:
    n = len(points)
    if n < 8:  # too few neighbours to tell an outlier from the sea floor
        return np.zeros(n, np.bool_)
    tree = cKDTree(points)
    chunks = [slice(i, min(i + CHUNK, n)) for i in range(0, n, CHUNK)]
    residual = np.empty(n)
    near = np.empty((n, min(PLANE_NEIGHBOURS + 1, n)), np.int32)

    def fit_planes(chunk: slice) -> None:
        index = nearest(tree, points[chunk], PLANE_NEIGHBOURS + 1)[1]
        near[chunk] = index
        residual[chunk] = _plane_residuals(points, soundings.depth_m, chunk.start, index)

    each(fit_planes, chunks)
    suspect = np.empty(n, np.bool_)

    def judge(chunk: slice) -> None:
        around = np.abs(residual[near[chunk]])
        scale = np.maximum(1.4826 * np.median(around, axis=1), soundings.sd_m[chunk])
        suspect[chunk] = np.abs(residual[chunk]) > SUSPICION * scale

    each(judge, chunks)
    return suspect


@njit(cache=True, nogil=True)
def _plane_residuals(points: FloatArray, depth: FloatArray, first: int, near: IntArray) -> FloatArray:
    """Depth minus a robust plane through the neighbours (Huber; slopes damped for collinear tracks).

    Row i of ``near`` holds the neighbours of point ``first + i``.
    """
    n, k = near.shape
    result = np.zeros(n)
    z = np.empty(k)
    weight = np.empty(k)
    size = np.empty(k)
    for t in range(n):
        i = first + t
        m = 0
        radius2 = 1e-12
        for c in range(k):
            j = near[t, c]
            if j != i:
                z[m] = depth[j]
                dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                radius2 = max(radius2, dx * dx + dy * dy)
                m += 1
        centre = np.median(z[:m])
        slope_e = slope_n = 0.0
        for _ in range(8):
            c = 0
            for q in range(k):
                j = near[t, q]
                if j != i:
                    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                    size[c] = abs(z[c] - centre - slope_e * dx - slope_n * dy)
                    c += 1
            bound = 1.345 * 1.4826 * np.median(size[:m]) + 1e-9
            for c in range(m):
                weight[c] = 1.0 if size[c] <= bound else bound / size[c]
            a = np.zeros((3, 3))
            b = np.zeros(3)
            c = 0
            for q in range(k):
                j = near[t, q]
                if j != i:
                    w = weight[c]
                    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                    a[0, 0] += w
                    a[0, 1] += w * dx
                    a[0, 2] += w * dy
                    a[1, 1] += w * dx * dx
                    a[1, 2] += w * dx * dy
                    a[2, 2] += w * dy * dy
                    b[0] += w * z[c]
                    b[1] += w * z[c] * dx
                    b[2] += w * z[c] * dy
                    c += 1
            a[1, 1] += 0.05 * radius2
            a[2, 2] += 0.05 * radius2
            a[1, 0], a[2, 0], a[2, 1] = a[0, 1], a[0, 2], a[1, 2]
            solution = np.linalg.solve(a, b)
            centre, slope_e, slope_n = solution[0], solution[1], solution[2]
        result[t] = depth[i] - centre
    return result
