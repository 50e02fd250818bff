"""The log of survey lines: where each begins and ends, and how straight it was flown."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.quality.tracks import Lines, Tracks


@dataclass(frozen=True)
class LineLog:
    """Of each of m lines.

    Attributes
    ----------
    begin_m, end_m : (m, 2)
        East and north of its first and its last sounding.
    soundings : (m,)
        How many it has; those of the same time are one.
    off_line_rms_m, off_line_max_m : (m,)
        Distance of its soundings from the straight line between its ends.
    """

    begin_m: FloatArray
    end_m: FloatArray
    soundings: IntArray
    off_line_rms_m: FloatArray
    off_line_max_m: FloatArray

    @classmethod
    def of(cls, tracks: Tracks, lines: Lines) -> "LineLog":
        """Return the log of tracks that are cut into lines."""
        en_m = np.column_stack([tracks.east_m, tracks.north_m])
        begin_m, end_m = en_m[lines.first], en_m[lines.last]
        rows = np.flatnonzero(lines.line >= 0)
        line = lines.line[rows]
        way = end_m - begin_m
        along = way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        off = en_m[rows] - begin_m[line]
        off_m = np.abs(off[:, 0] * along[line, 1] - off[:, 1] * along[line, 0])
        # The last sounding of a line begins no segment of it, and lies on the straight line.
        count = lines.last - lines.first + 1
        largest = np.zeros(len(lines))
        np.maximum.at(largest, line, off_m)
        rms = np.sqrt(np.bincount(line, off_m**2, len(lines)) / np.maximum(count, 1))
        return cls(begin_m, end_m, count, rms, largest)
