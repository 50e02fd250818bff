"""Deviations that say how far the map really is off: checked on soundings held out with all around them."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from scipy.special import ndtri

from app.arrays import FloatArray, IntArray
from app.mapping.gaussian_process.roughness import SCORE_RANGE, HoleErrors
from app.mapping.kriging.fields import Field
from app.mapping.kriging.kernels import KERNEL_CODES
from app.mapping.kriging.kriging import Conditioned, krige_holes
from app.mapping.kriging.levels import TwoLevels
from app.mapping.kriging.neighbours import nearest
from app.mapping.types import Grid

STEEPNESS_EXPONENT = 0.25
"""Variance grows with this power of the squared slope: a process that is right on average errs at edges."""

STEEPNESS_FLOOR = 0.1
"""Of the mean squared slope, added to the local one."""

COMMON_ERROR = 0.06
"""Part of a sounding's standard deviation that its neighbours share, so that it does not average out. What all
soundings of a survey share (tide, sound speed) is counted where the map is used."""

FINE_RELIEF = 0.25
"""Part of the noise beyond the stated one that is relief too fine to be resolved: no sounding errs by it, every cell
does."""

CELL_EXCESS = 0.1
"""Logarithm of how much farther off cells are than soundings held out: these lie where the survey went."""

NEUTRAL_WEIGHT = 100.0
"""The factor on deviations starts from 1 as if so many held-out soundings had asked for that."""

WIDER = 3.0
"""Deviations are checked across the survey's gaps, and across holes so many times as wide: along a line a hole as wide
as the gap beside it tells little of what lies between the lines."""

APART_UNITS = 2.0
"""Squares of single soundings; misses nearer than that to a held-out sounding are not counted for it, since they are
its own."""

MISSES_RANGE = (0.2, 5.0)
"""Of the factor on the variance that misses nearby make."""

PROBABILITIES = (0.68, 0.95)
SCALE_RANGE = (0.2, 5.0)
GAP_CELLS = 64  # along each side of the lattice on which gaps between soundings are measured
GOLDEN = 0.6180339887498949
LEAST_BEYOND = 6  # soundings that the ground beyond a survey is predicted from, to learn how well that works


@dataclass(frozen=True)
class Calibration:
    """From the process's variance to the map's deviation.

    Attributes
    ----------
    field
        Two quantities: the logarithm of the factor on the variance, high where the sea floor is steep, about 0 on
        average; and the deviation in metres of the nearest sounding.
    support
        How far soundings surround places, see :mod:`app.mapping.gaussian_process.support`.
    misses
        Logarithm of the factor on the variance that soundings held out near a place make; 0 on average.
    log_scale, log_scale_beyond
        Logarithm of the factor on the deviation where soundings surround a place, and where they do not.
    noise_scale
        Factor on the stated variance of soundings that the process found.
    """

    field: Field
    support: Field
    misses: Field
    log_scale: float = 0.0
    log_scale_beyond: float = 0.0
    noise_scale: float = 1.0

    def steepness_factor(self, points: FloatArray) -> FloatArray:
        """Factor on the variance at ``points`` (m, 2) that steepness makes: (m,)."""
        return np.asarray(np.exp(self.field.at(points)[0]))

    def variance_factor(self, points: FloatArray) -> FloatArray:
        """Factor on the variance at ``points`` (m, 2) that steepness and misses nearby make: (m,)."""
        return np.asarray(np.exp(self.field.at(points)[0] + self.misses.at(points)[0]))

    def deviations(self, grid: Grid, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviation in metres on ``grid``, where the process has ``variance``, both (rows, cols).

        The second is without the misses nearby: they change as soundings come in, and what is claimed must last.
        """
        log_steepness, sounding_sd = self.field.over(grid)
        log_scale = self.log_scale_beyond + (self.log_scale - self.log_scale_beyond) * self.support.over(grid)[0]
        even = variance * np.exp(log_steepness + 2.0 * log_scale)
        own = (COMMON_ERROR**2 + FINE_RELIEF * max(self.noise_scale - 1.0, 0.0)) * sounding_sd**2
        return np.sqrt(even * np.exp(self.misses.over(grid)[0]) + own), np.sqrt(even + own)


def uncalibrated(grid: Grid, relief_m: FloatArray, tree: cKDTree, sd_m: FloatArray, surrounded: Field) -> Calibration:
    """Return the calibration before any check: steep places and the soundings' deviations.

    Parameters
    ----------
    grid, relief_m : (rows, cols)
        A coarse map, depth minus trend.
    tree
        Positions of the soundings.
    sd_m : (n,)
        Their stated deviations.
    surrounded
        How far soundings surround places.
    """
    d_north, d_east = np.gradient(relief_m, grid.cell_m)
    square = gaussian_filter(d_north**2 + d_east**2, 1.0, mode="nearest")
    typical = float(square.mean()) + 1e-30
    _, closest = nearest(tree, grid.centres_m, 1)
    relative = (square + STEEPNESS_FLOOR * typical) / (typical * (1.0 + STEEPNESS_FLOOR))
    sounding_sd = sd_m[closest[:, 0]].reshape(grid.rows, grid.cols)
    field = Field(grid, np.array([STEEPNESS_EXPONENT * np.log(relative), sounding_sd]))
    return Calibration(field, surrounded, Field(grid, np.zeros((1, grid.rows, grid.cols))))


@dataclass(frozen=True)
class HeldOutSoundings:
    """Soundings predicted as if nothing had been sounded around them; all (h,) but ``points_m``, (h, 2).

    Attributes
    ----------
    error_m
        Measured minus predicted.
    own_variance
        Of the sounding's own error.
    map_variance
        Of the prediction, according to the process.
    """

    points_m: FloatArray
    error_m: FloatArray
    own_variance: FloatArray
    map_variance: FloatArray


def gaps(tree: cKDTree) -> FloatArray:
    """Distance to the nearest point of ``tree`` from an even lattice of places over their rectangle, metres."""
    low, high = tree.mins, tree.maxes
    east, north = np.meshgrid(*(np.linspace(low[i], high[i], GAP_CELLS) for i in (0, 1)))
    return nearest(tree, np.column_stack([east.ravel(), north.ravel()]), 1)[0][:, 0]


def across_gaps(levels: TwoLevels, rows: IntArray, neighbours: tuple[int, int], widened_to_m: float = 0.0) -> IntArray:
    """Choose neighbours of the fine soundings ``rows`` across holes as wide as the survey's gaps: (h, k), -1 for none.

    With ``widened_to_m`` the holes are ``WIDER`` times as wide, as far as that makes none wider than this.
    """
    gap = np.quantile(gaps(levels.fine_tree), _evenly(len(rows)))
    radius = np.maximum(gap, np.minimum(WIDER * gap, widened_to_m))
    return levels.neighbours_beyond(levels.points[rows], np.maximum(radius, 1e-6), *neighbours)


def hold_out_beyond(
    process: Conditioned, rows: IntArray, neighbours: tuple[int, int], farthest_m: float
) -> HeldOutSoundings:
    """Predict the fine soundings ``rows`` as if the survey ended up to ``farthest_m`` before them."""
    even = _evenly(len(rows))
    course = 2.0 * np.pi * ((0.5 + np.sqrt(2.0) * np.arange(len(rows))) % 1.0)
    near = process.levels.neighbours_beyond(
        process.levels.points[rows], farthest_m * even, *neighbours, np.column_stack([np.cos(course), np.sin(course)])
    )
    enough = (near >= 0).sum(axis=1) >= LEAST_BEYOND
    return predicted_without(process, rows[enough], near[enough])


def _evenly(n: int) -> FloatArray:
    """Return (n,) numbers in [0, 1), steps of the golden ratio: even, and unrelated to the order of the soundings."""
    return np.asarray((0.5 + GOLDEN * np.arange(n)) % 1.0)


def predicted_without(process: Conditioned, rows: IntArray, neighbours: IntArray) -> HeldOutSoundings:
    """Predict the fine soundings ``rows`` from the given ones, (h, k), -1 for none."""
    points, metric, amplitude, _ = process.sounded
    error, noise_part, model_part = krige_holes(
        KERNEL_CODES[process.kernel],
        points,
        process.residual_m,
        process.noise_variance,
        metric,
        amplitude,
        rows,
        neighbours,
    )
    known = np.isfinite(error)
    own = process.noise_variance[rows]
    return HeldOutSoundings(points[rows[known]], error[known], own[known], (noise_part + model_part - own)[known])


def together(one: HeldOutSoundings, other: HeldOutSoundings) -> HeldOutSoundings:
    """Return the predictions of both."""
    return HeldOutSoundings(
        *(
            np.concatenate([getattr(one, name), getattr(other, name)])
            for name in ("points_m", "error_m", "own_variance", "map_variance")
        )
    )


def misses(held_out: HeldOutSoundings, factor: FloatArray) -> HoleErrors:
    """Return how predictions miss place by place, where the process has ``factor`` (h,) times its variance."""
    variance = held_out.map_variance * factor
    return HoleErrors(
        points_m=held_out.points_m,
        score=np.clip((held_out.error_m**2 - held_out.own_variance) / variance, *SCORE_RANGE),
        weight=(variance / (variance + held_out.own_variance)) ** 2,
    )


def error_ratio(refined: HeldOutSoundings, plain: HeldOutSoundings) -> float:
    """Root mean square error of one process over another's on the same soundings; 1 where there are none."""
    expected = plain.own_variance + plain.map_variance
    below = float(np.sum(plain.error_m**2 / expected))
    return math.sqrt(float(np.sum(refined.error_m**2 / expected)) / below) if below > 0.0 else 1.0


def mixed(refined: HeldOutSoundings, plain: HeldOutSoundings, weight: float) -> HeldOutSoundings:
    """Predictions averaged, ``weight`` on the refined ones; their disagreement adds to the variance."""
    own = weight * refined.own_variance + (1.0 - weight) * plain.own_variance
    apart = refined.error_m - plain.error_m
    return HeldOutSoundings(
        refined.points_m,
        plain.error_m + weight * apart,
        own,
        weight * refined.map_variance + (1.0 - weight) * plain.map_variance + weight * (1.0 - weight) * apart**2,
    )


def checked_log_scale(held_out: HeldOutSoundings, factor: FloatArray) -> float:
    """Find the logarithm of the factor on deviations where the process has ``factor`` (h,) times its variance.

    With it 68 and 95 % of the held-out soundings lie within their intervals, on average of the two. Soundings
    whose own error hides the map's count little; the fewer tell, the closer the answer to ``CELL_EXCESS``.
    """
    if len(held_out.error_m) == 0:
        return CELL_EXCESS
    variance = held_out.map_variance * factor
    weight = (variance / (variance + held_out.own_variance)) ** 2
    total = float(weight.sum())
    found = [
        _log_scale_for(probability, held_out.error_m, held_out.own_variance, variance, weight)
        for probability in PROBABILITIES
    ]
    return CELL_EXCESS + total * float(np.mean(found)) / (total + NEUTRAL_WEIGHT)


def _log_scale_for(
    probability: float, error: FloatArray, own: FloatArray, variance: FloatArray, weight: FloatArray
) -> float:
    half = float(ndtri(0.5 + 0.5 * probability))
    low, high = (math.log(x) for x in SCALE_RANGE)
    enough = probability * float(weight.sum())
    for _ in range(30):
        middle = 0.5 * (low + high)
        inside = np.abs(error) <= half * np.sqrt(own + math.exp(2.0 * middle) * variance)
        if float(weight[inside].sum()) < enough:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
