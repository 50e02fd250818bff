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
        Number of the newest survey that counts, by time; ``NONE`` without one.
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
        return np.asarray(self.newest != NONE)


class SiteFusion:
    """Takes surveys in, one after the other in the order of their times, and holds none of them.

    A floor that changes at random has, after each year, another independent change of the deviation
    ``yearly_change_m``: the variance of what was known grows by its square a year. So a Kalman filter of one state a
    cell takes the surveys in; that gives the mean of all, weighted by precision, where nothing ever changes. Where
    a survey differs from what was foretold by more than ``CHANGED`` deviations, the floor is not the one that was
    surveyed before: the newer survey counts alone.
    """

    def __init__(self, grid: Grid, yearly_change_m: float) -> None:
        self.grid = grid
        self._yearly_m2 = yearly_change_m**2
        shape = (grid.rows, grid.cols)
        self._depth, self._variance = np.full(shape, np.nan), np.full(shape, np.nan)
        self._sounded = np.zeros(shape, dtype=bool)
        self._newest, self._number = np.full(shape, NONE), np.zeros(shape, dtype=np.int64)
        self._taken = 0
        self._at_s = -np.inf

    def add(self, survey: Survey) -> float:
        """Take in a survey, not older than the last one; returns the share of what was known that it found changed.

        NaN where it is of nothing that was known. Raises ValueError for one on another grid or out of turn.
        """
        if survey.grid != self.grid:
            raise ValueError(f"a survey is on {survey.grid}, the model on {self.grid}: resample it first")
        if survey.time_s < self._at_s:
            raise ValueError(f"a survey is of {survey.time_s}, the one before it of {self._at_s}: add older ones first")
        variance = self._variance + self._grown_m2(survey.time_s)
        self._at_s = survey.time_s
        there, noise = survey.known, survey.variance_m2
        both = there & (self._number > 0)
        off = np.where(both, survey.depth_m - self._depth, 0.0)
        total = np.where(both, variance + noise, 1.0)
        joined = both & (off**2 <= CHANGED**2 * total)
        alone = there & ~joined
        gain = np.where(joined, variance / total, 0.0)
        self._depth = np.where(alone, survey.depth_m, np.where(joined, self._depth + gain * off, self._depth))
        self._variance = np.where(alone, noise, np.where(joined, gain * noise, variance))
        self._sounded = np.where(alone, survey.sounded, self._sounded | (joined & survey.sounded))
        self._number = np.where(alone, 1, self._number + joined)
        self._newest = np.where(there, self._taken, self._newest)
        self._taken += 1
        return 1.0 - float(joined.sum()) / float(both.sum()) if both.any() else float("nan")

    def model(self, at_s: float) -> SiteModel:
        """Return the model as of a time; of one before the last survey's it is that survey's."""
        at_s = max(at_s, self._at_s)
        sd = np.sqrt(self._variance + self._grown_m2(at_s))
        return SiteModel(self.grid, self._depth, sd, self._sounded, self._newest, self._number, at_s)

    def _grown_m2(self, to_s: float) -> float:
        return self._yearly_m2 * (to_s - self._at_s) / YEAR_S if np.isfinite(self._at_s) else 0.0


def fuse_surveys(grid: Grid, surveys: Sequence[Survey], yearly_change_m: float, at_s: float) -> SiteModel:
    """Return the model of surveys on one grid, in whatever order, as of a time; see :class:`SiteFusion`.

    ``SiteModel.newest`` is the number of a survey by time.
    """
    fusion = SiteFusion(grid, yearly_change_m)
    for survey in sorted(surveys, key=lambda survey: survey.time_s):
        fusion.add(survey)
    return fusion.model(at_s)
