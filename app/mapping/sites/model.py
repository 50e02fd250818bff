"""A site's model: the depths of all its surveys together, each weighted by how certain it is by now."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.sites.survey import Survey
from app.mapping.types import Grid

YEAR_S = 365.25 * 86_400.0

CHANGED = 1.96
"""Deviations by which a survey differs from all before it where the floor has changed: beyond 95 % of chance."""

NONE = -1
"""In ``SiteModel.newest``: no survey."""


@dataclass(frozen=True)
class SiteModel:
    """What is known of a site; every layer has shape (rows, cols).

    Attributes
    ----------
    depth_m, sd_m
        Depth, positive down, and its standard deviation at ``at_s``; NaN where no survey was.
    sounded
        Where one of the surveys that count sounded.
    newest
        Number of the newest survey that counts, in the order in which they were given; ``NONE`` without one.
    surveys
        How many surveys count.
    """

    grid: Grid
    depth_m: FloatArray
    sd_m: FloatArray
    sounded: BoolArray
    newest: IntArray
    surveys: IntArray
    at_s: float

    @property
    def known(self) -> BoolArray:
        """Return where something is known, (rows, cols)."""
        return self.newest != NONE


def fuse_surveys(grid: Grid, surveys: Sequence[Survey], yearly_change_m: float, at_s: float) -> SiteModel:
    """Return the model of surveys on one grid, as of a time.

    A floor that changes at random has, after each year, another independent change of the deviation
    ``yearly_change_m``: the variance of what was known grows by its square a year. So a Kalman filter of one state a
    cell takes the surveys in the order of their times; that is the mean of all, weighted by their precision, where
    nothing ever changes. Where a survey differs from what was foretold by more than ``CHANGED`` deviations, the floor
    is not the one that was surveyed before: the newer survey counts alone.

    Parameters
    ----------
    surveys
        All on ``grid``; those after ``at_s`` count as made then.
    """
    for survey in surveys:
        if survey.grid != grid:
            raise ValueError(f"a survey is on {survey.grid}, the model on {grid}: resample it first")
    shape = (grid.rows, grid.cols)
    depth, variance = np.full(shape, np.nan), np.full(shape, np.nan)
    sounded = np.zeros(shape, dtype=bool)
    newest, number = np.full(shape, NONE), np.zeros(shape, dtype=np.int64)
    yearly_m2 = yearly_change_m**2
    before_s = -np.inf
    for index in sorted(range(len(surveys)), key=lambda i: surveys[i].time_s):
        survey = surveys[index]
        time_s = min(survey.time_s, at_s)
        if np.isfinite(before_s):
            variance += yearly_m2 * (time_s - before_s) / YEAR_S
        before_s = time_s
        there, noise = survey.known, survey.variance_m2
        both = there & (number > 0)
        off = np.where(both, survey.depth_m - depth, 0.0)
        total = np.where(both, variance + noise, 1.0)
        joined = both & (off**2 <= CHANGED**2 * total)
        alone = there & ~joined
        gain = np.where(joined, variance / total, 0.0)
        depth = np.where(alone, survey.depth_m, np.where(joined, depth + gain * off, depth))
        variance = np.where(alone, noise, np.where(joined, gain * noise, variance))
        sounded = np.where(alone, survey.sounded, sounded | (joined & survey.sounded))
        number = np.where(alone, 1, number + joined)
        newest = np.where(there, index, newest)
    if np.isfinite(before_s):
        variance += yearly_m2 * max(at_s - before_s, 0.0) / YEAR_S
    return SiteModel(grid, depth, np.sqrt(variance), sounded, newest, number, at_s)
