"""Gross errors among the soundings (fish, multiple echoes): found by two looks that must agree."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.cell_index import cell_by_cell
from app.mapping.gross_errors.planes import LEAST_COMPANY, SUSPICION, judge_squares, plane_residuals
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging.kriging import krige_holes
from app.mapping.kriging.likelihood import Hyperparameters, RestrictedLikelihood, Trend, spread_subset
from app.mapping.kriging.neighbours import nearest
from app.mapping.kriging.scales import uniform_scales
from app.mapping.kriging.supersoundings import merge_soundings, squares
from app.mapping.kriging.threads import each
from app.mapping.types import Soundings

PLANE_NEIGHBOURS = 16
KRIGING_NEIGHBOURS = 24
WITNESSES = 4
ALIKE = 0.7
NEXT_TO = 1.5
"""Two soundings are next to each other when none is nearer, or not by more than this factor."""

CONVICTION = 5.0
"""Standard deviations from what its unsuspected neighbours predict that make a suspect an outlier."""

LEARNING_POINTS = 200
EXCUSE_POINTS = 600
EXCUSE_NEIGHBOURS = 12
EXCUSE_PRIOR_WEIGHT = 2.0
LEAST_EXCUSE = 1e-4
NORMAL_99 = 2.576
CHUNK = 30_000
"""Planes are fitted to at most so many soundings at a time: bounds the memory, and threads share the chunks."""

MANY = 50_000
"""From so many soundings on, those of one square share a plane: each a plane of its own would take minutes."""

PER_SQUARE = 24


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
    depth_m : (n,)
        What was judged.
    hyperparameters
        The stationary model behind the verdicts.
    """

    rejected: BoolArray
    predicted_m: FloatArray
    deviations: FloatArray
    depth_m: FloatArray
    hyperparameters: Hyperparameters

    def reason(self, i: int) -> str:
        """Say why a sounding was rejected; empty where it was accepted."""
        if not self.rejected[i]:
            return ""
        return (
            f"depth {self.depth_m[i]:.2f} m is {self.deviations[i]:.1f} standard deviations from the "
            f"{self.predicted_m[i]:.2f} m that its neighbours predict"
        )

    @property
    def reasons(self) -> tuple[str, ...]:
        """One line per sounding."""
        return tuple(map(self.reason, range(len(self.rejected))))


def flag_outliers(
    soundings: Soundings,
    *,
    kernel: KernelName = "matern32",
    hyperparameters: Hyperparameters | None = None,
) -> OutlierReport:
    """Find gross outliers.

    First look: a sounding is suspect when it lies more than ``SUSPICION`` robust standard deviations from a
    plane through its neighbours (the neighbours' own scatter about their planes sets the scale, so that
    steep or rough places do not raise suspicion); of very many soundings those in one small square are
    neighbours. Second look: a suspect is rejected when it also lies more than ``CONVICTION`` standard
    deviations from what kriging predicts from unsuspected neighbours, and from these together with other suspects
    nearby: soundings that agree with each other show a rock. How well leave-one-out prediction works nearby, and how
    heavy the tail of its errors is, scale the standard deviation.

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
    extent = max(float(_extent(soundings).max()), 1e-3)
    merged, _ = merge_soundings(soundings.take(trusted), extent / max(100.0, 0.5 * np.sqrt(n)))
    merged_points = np.column_stack([merged.east_m, merged.north_m])
    tree = cKDTree(merged_points)
    subset = spread_subset(tree, LEARNING_POINTS)
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
        _, near = nearest(tree, points[rows], KRIGING_NEIGHBOURS)
        # suspects go behind the trusted ones, so that one call predicts them from those
        m = len(merged_points)
        variance = np.concatenate([merged.sd_m, soundings.sd_m[rows]]) ** 2 * hyperparameters.noise_scale
        everywhere = np.concatenate([merged_points, points[rows]])
        depth = np.concatenate([merged.depth_m, soundings.depth_m[rows]])
        excuse = _excuse(kernel, hyperparameters, tree, merged, trend, points[rows])

        def misses(some: IntArray, neighbours: IntArray) -> tuple[FloatArray, FloatArray]:
            error, noise_part, model_part = krige_holes(
                KERNEL_CODES[kernel],
                everywhere,
                depth - trend(everywhere),
                variance,
                uniform_scales(len(everywhere)).scaled_metric(hyperparameters.length_m),
                np.full(len(everywhere), hyperparameters.amplitude_m),
                m + some,
                neighbours,
            )
            return error, np.abs(error) / np.sqrt(noise_part + model_part) / excuse[some]

        error, deviations[rows] = misses(np.arange(len(rows)), near)
        predicted[rows] = soundings.depth_m[rows] - error
        accused = np.flatnonzero(deviations[rows] > CONVICTION)
        if len(accused) > 1:
            at = points[rows[accused]]
            distance, others = nearest(cKDTree(at), at, WITNESSES + 1)
            everyone = cKDTree(points, balanced_tree=False, compact_nodes=False)
            agrees = _agrees(error[accused], others, distance, nearest(everyone, at, 2)[0][:, 1:])
            witnesses = np.where(others == np.arange(len(accused))[:, None], -1, m + accused[others])
            _, heard = misses(accused, np.hstack([near[accused], witnesses]))
            deviations[rows[accused]] = np.where(agrees, 0.0, np.fmin(deviations[rows[accused]], heard))
    rejected = deviations > CONVICTION
    return OutlierReport(rejected, predicted, deviations, soundings.depth_m, hyperparameters)


def _agrees(error: FloatArray, others: IntArray, distance: FloatArray, closest: FloatArray) -> BoolArray:
    """Which of the accused are two soundings of one rock: next to another one that is off by much the same, (n,).

    Parameters
    ----------
    error : (n,)
        Measured minus predicted.
    others, distance : (n, k)
        The nearest accused, and how far off.
    closest : (n, 1)
        Distance to the nearest sounding of all.
    """
    ratio = error[others] / error[:, None]
    alike = (ratio >= ALIKE) & (ratio <= 1.0 / ALIKE) & (distance <= NEXT_TO * closest)
    return np.asarray((alike & (others != np.arange(len(error))[:, None])).any(axis=1))


def _excuse(
    kernel: KernelName,
    hyper: Hyperparameters,
    tree: cKDTree,
    merged: Soundings,
    trend: Trend,
    at: FloatArray,
) -> FloatArray:
    """By how much the model understates misses at the positions ``at`` (m, 2): rugged ground excuses them.

    The local root mean square of leave-one-out deviations, times the excess of their tail over the normal
    one.
    """
    points = np.asarray(tree.data)
    n = tree.n
    rows = np.unique(np.linspace(0, n - 1, min(n, EXCUSE_POINTS)).astype(np.int64))
    _, near = nearest(tree, points[rows], KRIGING_NEIGHBOURS + 1)
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
    sampled = cKDTree(places)

    def local(near: IntArray) -> FloatArray:
        total = EXCUSE_PRIOR_WEIGHT * square.mean() + square[near].sum(axis=1)
        # Depths that were rounded may agree exactly: that is no misprediction to compare others with.
        return np.asarray(np.sqrt(np.maximum(total / (EXCUSE_PRIOR_WEIGHT + near.shape[1]), LEAST_EXCUSE)))

    others = nearest(sampled, places, EXCUSE_NEIGHBOURS + 1)[1][:, 1:]
    tail = float(np.percentile(np.sqrt(square) / local(others), 99.0)) / NORMAL_99
    return max(1.0, tail) * local(nearest(sampled, at, EXCUSE_NEIGHBOURS)[1])


def _extent(soundings: Soundings) -> FloatArray:
    """How far soundings reach eastward and northward in m, (2,)."""
    return np.array([np.ptp(soundings.east_m), np.ptp(soundings.north_m)])


def _suspects(points: FloatArray, soundings: Soundings) -> BoolArray:
    n = len(points)
    if n <= MANY:
        return _suspects_by_neighbours(points, soundings)
    suspect, alone = _suspects_by_square(points, soundings)
    rows = np.flatnonzero(alone)
    if len(rows):
        suspect[rows] = _suspects_by_neighbours(points[rows], soundings.take(rows))
    return suspect


def _suspects_by_square(points: FloatArray, soundings: Soundings) -> tuple[BoolArray, BoolArray]:
    """Hold soundings against one robust plane per square; also return which have too few beside them, (n,) each."""
    n = len(points)
    extent = np.maximum(_extent(soundings), 1e-9)
    side = float(np.sqrt(extent.prod() * PER_SQUARE / n))
    side = max(side, float(extent.max()) / n)  # a straight track has no area
    columns, rows = (extent / side).astype(np.int64) + 1
    west, south = float(soundings.east_m.min()), float(soundings.north_m.min())
    square = squares(soundings.east_m, soundings.north_m, west, south, side, int(columns))
    order, first = cell_by_cell(square, int(columns * rows))
    suspect, alone = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    per_chunk = max(1, CHUNK // PER_SQUARE)
    parts = [first[i : i + per_chunk + 1] for i in range(0, len(first) - 1, per_chunk)]
    each(lambda part: judge_squares(points, soundings.depth_m, soundings.sd_m, order, part, suspect, alone), parts)
    return suspect, alone


def _suspects_by_neighbours(points: FloatArray, soundings: Soundings) -> BoolArray:
    """Hold each sounding against a robust plane through its neighbours, (n,)."""
    n = len(points)
    if n < LEAST_COMPANY:  # too few neighbours to tell an outlier from the sea floor
        return np.zeros(n, np.bool_)
    tree = cKDTree(points)
    chunks = [slice(i, min(i + CHUNK, n)) for i in range(0, n, CHUNK)]
    residual = np.empty(n)
    near = np.empty((n, min(PLANE_NEIGHBOURS + 1, n)), np.int32)

    def fit_planes(chunk: slice) -> None:
        index = nearest(tree, points[chunk], PLANE_NEIGHBOURS + 1)[1]
        near[chunk] = index
        residual[chunk] = plane_residuals(points, soundings.depth_m, chunk.start, index)

    each(fit_planes, chunks)
    suspect = np.empty(n, np.bool_)

    def judge(chunk: slice) -> None:
        around = np.abs(residual[near[chunk]])
        scale = np.maximum(1.4826 * np.median(around, axis=1), soundings.sd_m[chunk])
        suspect[chunk] = np.abs(residual[chunk]) > SUSPICION * scale

    each(judge, chunks)
    return suspect
