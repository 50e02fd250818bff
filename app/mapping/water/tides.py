"""Water levels from a table of high and low waters or of observed levels."""

from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from app.arrays import BoolArray, FloatArray

MAX_GAP_S = 24.0 * 3600.0
"""Where the sea has one tide a day its extremes are half a day apart; a larger gap is a hole in any table."""

OBSERVED_GAP_S = 2.0 * 3600.0
"""Entries that are no farther apart are levels of a gauge in a table whose entries are not all extremes. Where most are
so, a larger gap is a time in which the gauge told nothing."""

MISSING = 2.5
"""Times that two extremes usually are apart, between which at least one pair of extremes is missing."""

UNEVEN = 1.5
"""Where an entry is no extreme, the time on one of its sides that is so much longer than on the other is the one in
which an extreme is missing."""

SMALL = 0.5
"""Part of the usual rise or fall: what is less in so long a time leads from one high water to the next, or from one low
water."""

FLAWS, FLAWED = 4, 0.15
"""A table in which more entries than these, a number and a share, are no extremes is none of extremes at all: only what
lies between entries that are close together is told."""


@dataclass(frozen=True)
class TideTable:
    """High and low waters, or levels as a gauge observed them, in the order of time.

    Attributes
    ----------
    times_s
        Unix seconds, strictly ascending, shape (n,).
    levels_m
        Above the table's zero (chart datum), shape (n,).
    utc_assumed
        Whether the table states no zone for some of its times, which are taken for UTC.
    """

    name: str
    times_s: FloatArray
    levels_m: FloatArray
    digest: str
    utc_assumed: bool = False

    @property
    def first(self) -> datetime:
        """Return the time of the first entry."""
        return datetime.fromtimestamp(float(self.times_s[0]), UTC)

    @property
    def last(self) -> datetime:
        """Return the time of the last entry."""
        return datetime.fromtimestamp(float(self.times_s[-1]), UTC)

    def levels_at(self, time_s: ArrayLike) -> FloatArray:
        """Return the level at each time; NaN where the table says nothing.

        A half cosine leads from one extreme to the next; observed levels are joined by cubics whose slopes at an entry
        are those of the parabola through it and its neighbours. Nothing is said before the first entry, after the
        last, and in a hole: a time of more than ``OBSERVED_GAP_S`` among a gauge's levels, and among extremes one of
        more than ``MAX_GAP_S``, one of more than ``MISSING`` of their usual times, and one in which a low water is
        missing between two high waters, or a high water between two low ones.
        """
        times = np.asarray(time_s, float)
        after = np.clip(np.searchsorted(self.times_s, times, side="right"), 1, len(self.times_s) - 1)
        begin, end = self.times_s[after - 1], self.times_s[after]
        low, high = self.levels_m[after - 1], self.levels_m[after]
        phase = np.pi * (times - begin) / (end - begin)
        level = 0.5 * (low + high) + 0.5 * (low - high) * np.cos(phase)
        if not self._is_extreme.all():
            level = np.where(end - begin <= OBSERVED_GAP_S, self._cubic(times), level)
        known = (times >= self.times_s[0]) & (times <= self.times_s[-1])
        known &= ~self._holes[after - 1] | (times == begin) | (times == end)
        return np.where(known, level, np.nan)

    def hole_between(self, begin_s: float, end_s: float) -> str:
        """Return when the first hole of the table between two times begins and ends, for an operator; '' for none."""
        meets = self._holes & (self.times_s[1:] > begin_s) & (self.times_s[:-1] < end_s)
        if not meets.any():
            return ""
        at = int(np.argmax(meets))
        return f"{_minute(float(self.times_s[at]))} to {_minute(float(self.times_s[at + 1]))}"

    @cached_property
    def _is_extreme(self) -> BoolArray:
        """Which entries are high or low waters, (n,): levels rise on the one side and fall on the other."""
        rise = np.diff(self.levels_m)
        return np.concatenate([[True], rise[:-1] * rise[1:] < 0.0, [True]])

    @cached_property
    def _holes(self) -> BoolArray:
        """Which times from one entry to the next, (n - 1,), the table tells nothing of."""
        gap_s = np.diff(self.times_s)
        usual_s = float(np.median(gap_s))
        if usual_s <= OBSERVED_GAP_S:
            return np.asarray(gap_s > (MAX_GAP_S if self._is_extreme.all() else OBSERVED_GAP_S))
        rise_m = np.abs(np.diff(self.levels_m))
        if not rise_m.any():
            return np.asarray(gap_s > MAX_GAP_S)
        holes = gap_s > min(MAX_GAP_S, MISSING * usual_s)
        holes |= (gap_s > UNEVEN * usual_s) & (rise_m < SMALL * np.median(rise_m))
        # A half cosine is level at both ends: what leads past an entry that is no extreme is none.
        before_s, after_s = gap_s[:-1], gap_s[1:]
        none = ~self._is_extreme[1:-1]
        if none.sum() > max(FLAWS, FLAWED * len(none)):
            return np.asarray(holes | (gap_s > OBSERVED_GAP_S))
        holes[:-1] |= none & (before_s > OBSERVED_GAP_S) & (UNEVEN * before_s > after_s)
        holes[1:] |= none & (after_s > OBSERVED_GAP_S) & (UNEVEN * after_s > before_s)
        return np.asarray(holes)

    @cached_property
    def _cubic(self) -> CubicHermiteSpline:
        slopes: FloatArray = np.gradient(self.levels_m, self.times_s, edge_order=2)
        return CubicHermiteSpline(self.times_s, self.levels_m, slopes, extrapolate=False)

    def why_not(self, time_s: float) -> str:
        """Return why there is no level at a time, for an operator; empty when there is one."""
        if np.isfinite(self.levels_at(time_s)):
            return ""
        if self.times_s[0] <= time_s <= self.times_s[-1]:
            return f"the tide table {self.name!r} has a hole at {_minute(time_s)}"
        begin, end = (_minute(float(self.times_s[i])) for i in (0, -1))
        return f"{_minute(time_s)} is not within the tide table {self.name!r}, {begin} to {end}"


def _minute(time_s: float) -> str:
    try:
        return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M} UTC"
    except (OverflowError, ValueError, OSError):
        return f"{time_s:g} s"
