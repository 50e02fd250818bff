"""How badly a section of track fits the bottom that others tell, shifted by this and by that."""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.estimation.adjustment.surface import CellWeights, Surface

WIDE = 3.0
"""Residuals beyond so many deviations count as if they grew linearly."""


class SectionSoundings(NamedTuple):
    """The soundings of a section of track, on the raster of the bottom around it.

    Attributes
    ----------
    x, y : (n,)
        Places in cells of the raster, from its first centre.
    depth, variance : (n,)
        Metres, and squares of such.
    """

    x: FloatArray
    y: FloatArray
    depth: FloatArray
    variance: FloatArray


class Usual(NamedTuple):
    """What is known of the depth where nothing else is: metres, and its variance."""

    depth: float
    variance: float


@njit(cache=True, nogil=True)
def _at(raster: FloatArray, x: float, y: float) -> float:
    """Return a raster's value between the centres of four cells, in cells from the first centre; NaN beyond."""
    rows, cols = raster.shape
    if not (0.0 <= x <= cols - 1.0 and 0.0 <= y <= rows - 1.0):
        return np.nan
    j, i = min(int(x), cols - 2), min(int(y), rows - 2)
    u, v = x - j, y - i
    south = raster[i, j] * (1.0 - u) + raster[i, j + 1] * u
    north = raster[i + 1, j] * (1.0 - u) + raster[i + 1, j + 1] * u
    found: float = south * (1.0 - v) + north * v
    return found


@njit(cache=True, nogil=True)
def misfit(
    section: SectionSoundings,
    bottom: Surface,
    shift_x: FloatArray,
    shift_y: FloatArray,
    usual: Usual,
    offset_variance: float,
    grain: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return minus twice the logarithm of the likelihood of a section's depths at shifted places.

    Parameters
    ----------
    section
        Of n soundings.
    bottom
        As others tell it.
    shift_x, shift_y : (k,)
        In cells: the section is looked at where it minus the shift is.
    usual
        Counts where the others tell less.
    offset_variance
        Of a depth that all of the section may be off by.
    grain
        Metres between neighbouring soundings of the section: those that are predicted from afar share their errors.

    Returns
    -------
    The misfit, the share of the section that others tell of, and the mean square of its residuals over their variances,
    each (k,).
    """
    x, y, depth, variance = section
    value, doubt, nearest = bottom
    background, background_variance = usual
    n, many = len(x), len(shift_x)
    total, seen, square = np.zeros(many), np.zeros(many), np.zeros(many)
    off, var, weight = np.empty(n), np.empty(n), np.empty(n)
    for s in range(many):
        a = b = c = 0.0
        for k in range(n):
            u, v = x[k] - shift_x[s], y[k] - shift_y[s]
            z = _at(value, u, v)
            doubtful = _at(doubt, u, v)
            if np.isnan(z) or np.isnan(doubtful) or doubtful >= background_variance:
                off[k], var[k] = depth[k] - background, background_variance + variance[k]
                weight[k] = 0.25
            else:
                away = _at(nearest, u, v)
                off[k], var[k] = depth[k] - z, doubtful + variance[k]
                weight[k] = grain / (grain + away)
                seen[s] += 1.0
            w = weight[k] / var[k]
            a += w
            b += w * off[k]
        # The offset that all share is integrated out, by its most likely value first.
        mean = b / (a + 1.0 / offset_variance)
        of_known = 0.0
        for k in range(n):
            t = abs(off[k] - mean) / np.sqrt(var[k])
            rho = t * t if t <= WIDE else WIDE * (2.0 * t - WIDE)
            c += weight[k] * (rho + np.log(var[k]))
            square[s] += weight[k] * min(t * t, WIDE * WIDE)
            of_known += weight[k]
        total[s] = c + mean * mean / offset_variance + np.log(1.0 + a * offset_variance)
        square[s] /= max(of_known, 1e-9)
        seen[s] /= n
    return total, seen, square


@njit(cache=True, nogil=True)
def residuals(section: SectionSoundings, bottom: Surface, within: float) -> FloatArray:
    """Return depths (n,) minus what others tell there; NaN where none of theirs is ``within`` so many metres."""
    x, y = section.x, section.y
    off = np.full(len(x), np.nan)
    for k in range(len(x)):
        away = _at(bottom.nearest, x[k], y[k])
        if away <= within:
            off[k] = section.depth[k] - _at(bottom.value, x[k], y[k])
    return off


@njit(cache=True, nogil=True)
def influence(
    section: SectionSoundings, bottom: Surface, shares: CellWeights, own: FloatArray, others: FloatArray
) -> None:
    """Add to each of the section's soundings (n,) and of the others' (m,) how much a tie depends on where it is.

    That is the squared slope of the bottom over the variance.
    """
    x, y, variance = section.x, section.y, section.variance
    value, doubt = bottom.value, bottom.doubt
    who, share = shares
    rows, cols = value.shape
    for k in range(len(x)):
        j, i = int(np.floor(x[k] + 0.5)), int(np.floor(y[k] + 0.5))
        if not (1 <= i < rows - 1 and 1 <= j < cols - 1):
            continue
        slope = (value[i, j + 1] - value[i, j - 1]) ** 2 + (value[i + 1, j] - value[i - 1, j]) ** 2
        if np.isnan(slope) or np.isnan(doubt[i, j]):
            continue
        w = (slope + 1e-9) / (doubt[i, j] + variance[k])
        own[k] += w
        positive = 0.0
        for q in range(who.shape[2]):
            if who[i, j, q] >= 0 and share[i, j, q] > 0.0:
                positive += share[i, j, q]
        if positive > 0.0:
            for q in range(who.shape[2]):
                if who[i, j, q] >= 0 and share[i, j, q] > 0.0:
                    others[who[i, j, q]] += w * share[i, j, q] / positive
