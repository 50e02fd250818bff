"""The lines of one vehicle, by its course and time, and which of its pings belong to them."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.quality.tracks import Tracks, cut

LEAST_M = 10.0
"""Shorter lines are turns."""

ASTRAY_RAD = np.radians(15.0)
"""Pings of a vehicle that heads farther from what is usual on its line belong to a turn."""


@dataclass(frozen=True)
class Passes:
    """Straight lines of one vehicle, m of them, in the order of their times.

    Attributes
    ----------
    start_s, end_s : (m,)
        The vehicle's clock.
    heading_rad : (m,)
        Of the vehicle on it, clockwise from north, 0 to 2 pi.
    speed_mps : (m,)
        Over ground.
    """

    start_s: FloatArray
    end_s: FloatArray
    heading_rad: FloatArray
    speed_mps: FloatArray

    def __len__(self) -> int:
        return len(self.start_s)

    def of(self, time_s: FloatArray, heading_rad: FloatArray) -> IntArray:
        """Return the line of each ping (n,); -1: it is on none, or turns."""
        if not len(self):
            return np.full(len(time_s), -1, dtype=np.int64)
        line = np.maximum(np.searchsorted(self.start_s, time_s, side="right") - 1, 0)
        off = (heading_rad - self.heading_rad[line] + np.pi) % (2.0 * np.pi) - np.pi
        on_it = (time_s >= self.start_s[line]) & (time_s <= self.end_s[line]) & (np.abs(off) <= ASTRAY_RAD)
        return np.where(on_it, line, -1).astype(np.int64)


def passes_of(time_s: FloatArray, en_m: FloatArray, heading_rad: FloatArray) -> Passes:
    """Return the lines that a vehicle flew.

    Parameters
    ----------
    time_s : (n,)
        Ascending; the vehicle's clock was not set back.
    en_m : (n, 2)
        East and north.
    heading_rad : (n,)
    """
    table = np.column_stack([time_s, en_m, np.zeros((len(time_s), 2))])
    lines = cut(Tracks.of({"": table}))
    kept = np.flatnonzero((lines.length_m >= LEAST_M) & (lines.end_s > lines.start_s))
    kept = kept[np.argsort(lines.start_s[kept], kind="stable")]
    start_s, end_s = lines.start_s[kept], lines.end_s[kept]
    first, last = np.searchsorted(time_s, start_s, side="left"), np.searchsorted(time_s, end_s, side="right")
    heading = np.array([_middle(heading_rad[a:b]) for a, b in zip(first.tolist(), last.tolist(), strict=True)])
    return Passes(start_s, end_s, heading.reshape(-1), lines.length_m[kept] / (end_s - start_s))


def _middle(heading_rad: FloatArray) -> float:
    """Return the median of directions about their mean, 0 to 2 pi."""
    mean = np.arctan2(np.sin(heading_rad).mean(), np.cos(heading_rad).mean())
    off = (heading_rad - mean + np.pi) % (2.0 * np.pi) - np.pi
    return float((mean + np.median(off)) % (2.0 * np.pi))
