"""What changed between two surveys: by how much, how certainly, and how much ground came or went."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtri

from app.arrays import BoolArray, FloatArray
from app.mapping.sites.survey import Survey
from app.mapping.types import Grid

REACH = 4.0
"""Errors farther apart than so many correlation lengths do not belong together."""

BLOCKS = 8
"""Cells that are nearer to each other than this part of the correlation length count as one place."""


@dataclass(frozen=True)
class Volume:
    """A volume and its standard deviation, cubic metres."""

    m3: float
    sd_m3: float


@dataclass(frozen=True)
class Change:
    """A later survey less an earlier one; every layer has shape (rows, cols), NaN where one of them knows nothing.

    Attributes
    ----------
    difference_m
        Later depth less earlier depth: positive where the floor is deeper now.
    sd_m
        Of the difference, what each survey shares included.
    significance
        |difference| / sd.
    significant
        Where that is more than chance makes of an unchanged floor in a share ``confidence`` of the cells.
    gained, lost
        Volumes in significant cells that are shoaler and deeper now, both positive.
    net
        Gained less lost, over all cells that both surveys know, significant or not.
    """

    grid: Grid
    difference_m: FloatArray
    sd_m: FloatArray
    significance: FloatArray
    significant: BoolArray
    confidence: float
    gained: Volume
    lost: Volume
    net: Volume

    @property
    def compared(self) -> BoolArray:
        """Return which cells both surveys know, (rows, cols)."""
        return np.isfinite(self.difference_m)

    @property
    def significant_pct(self) -> float:
        """Return the share of the compared cells that changed significantly; 0 without any."""
        cells = int(self.compared.sum())
        return 100.0 * float(self.significant.sum()) / cells if cells else 0.0


def compare(earlier: Survey, later: Survey, confidence: float = 0.95) -> Change:
    """Return what changed between two surveys on one grid.

    Significance is that of a difference of two independent depths, as DEMs of difference are judged (Lane, Westaway
    and Hicks 2003, equation 7; Brasington, Langham and Rumsby 2003). Errors of neighbouring cells belong together by a
    Gaussian of each survey's correlation length, and what a survey shares is the same in all its cells: both widen
    the deviations of volumes.

    Parameters
    ----------
    confidence
        Within (0, 1).
    """
    if earlier.grid != later.grid:
        raise ValueError(f"one survey is on {earlier.grid}, the other on {later.grid}: resample one first")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}; it must lie within (0, 1)")
    difference = later.depth_m - earlier.depth_m
    sd = np.sqrt(earlier.variance_m2 + later.variance_m2)
    sd = np.where(np.isfinite(difference), sd, np.nan)
    significance = np.abs(difference) / sd
    significant = np.nan_to_num(significance, nan=0.0) > float(ndtri(0.5 + 0.5 * confidence))

    def volume(of: BoolArray, sign: float) -> Volume:
        area_m2 = earlier.grid.cell_m**2
        m3 = area_m2 * sign * float(difference[of].sum())
        variance = sum(_summed_variance(survey, of) for survey in (earlier, later))
        return Volume(m3 + 0.0, area_m2 * float(np.sqrt(variance)))

    return Change(
        grid=earlier.grid,
        difference_m=difference,
        sd_m=sd,
        significance=significance,
        significant=significant,
        confidence=confidence,
        gained=volume(significant & (difference < 0.0), -1.0),
        lost=volume(significant & (difference > 0.0), 1.0),
        net=volume(np.isfinite(difference), -1.0),
    )


def _summed_variance(survey: Survey, of: BoolArray) -> float:
    """Return the variance of the sum of a survey's depths in some cells, square metres."""
    if not of.any():
        return 0.0
    sd = np.where(of, survey.sd_m, 0.0)
    length = survey.correlation_length_m / survey.grid.cell_m
    shared = (survey.shared_sd_m * float(of.sum())) ** 2
    if length <= 0.0:
        return float((sd**2).sum()) + shared
    side = max(1, int(length / BLOCKS))
    sd, length = _block_sums(sd, side), length / side
    alike = gaussian_filter(sd, length, mode="constant", truncate=REACH)
    # It weighs by a Gaussian whose sum is 1; a correlation is 1 at no distance.
    offsets = np.arange(-int(REACH * length + 0.5), int(REACH * length + 0.5) + 1)
    return float((sd * alike).sum() * np.exp(-0.5 * (offsets / length) ** 2).sum() ** 2) + shared


def _block_sums(values: FloatArray, side: int) -> FloatArray:
    """Return the sums of blocks of so many times so many cells."""
    rows, cols = (-(-length // side) * side for length in values.shape)
    padded = np.pad(values, ((0, rows - values.shape[0]), (0, cols - values.shape[1])))
    return np.asarray(padded.reshape(rows // side, side, cols // side, side).sum(axis=(1, 3)))
