"""Where lines of soundings cross, and what their depths are there.

The figures are those of GMT's ``x2sys_cross`` (Wessel 2010, Computers & Geosciences 36, 348-354) with linear
interpolation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import shapely
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.quality.tracks import Lines, Tracks, cut

PIECE = 32
"""Segments whose surrounding rectangle is looked up at once."""

PIECES_AT_ONCE, PAIRS_AT_ONCE = 4096, 1024

AWAY_M = 0.5
"""A way crosses itself where a vehicle comes back after it was farther away than this; less is the scatter of its
positions."""

MOST = 200_000
"""More crossings are not looked for: memory is bounded, and statistics do not become better."""


@dataclass(frozen=True)
class Crossings:
    """Places where ways cross, k of them.

    Of two ways of one vehicle the later is the first; of two vehicles that of the one whose name comes first.

    Attributes
    ----------
    east_m, north_m : (k,)
        Local frame.
    line : (k, 2)
    time_s, depth_m, sd_m : (k, 2)
        On either line, linear between the two soundings beside the crossing.
    angle_rad : (k,)
        Between the lines there, 0 to pi / 2.
    """

    east_m: FloatArray
    north_m: FloatArray
    line: IntArray
    time_s: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray
    angle_rad: FloatArray

    def __len__(self) -> int:
        return len(self.east_m)

    @property
    def difference_m(self) -> FloatArray:
        """Depth on the first line minus that on the second, (k,)."""
        return self.depth_m[:, 0] - self.depth_m[:, 1]

    @property
    def mean_depth_m(self) -> FloatArray:
        """Of both lines, (k,)."""
        return np.asarray(self.depth_m.mean(axis=1))

    @property
    def predicted_sd_m(self) -> FloatArray:
        """Standard deviation of the difference as those of the soundings predict it, (k,)."""
        return np.asarray(np.hypot(self.sd_m[:, 0], self.sd_m[:, 1]))

    def take(self, rows: IntArray | BoolArray) -> "Crossings":
        """Return some of them."""
        return Crossings(
            self.east_m[rows],
            self.north_m[rows],
            self.line[rows],
            self.time_s[rows],
            self.depth_m[rows],
            self.sd_m[rows],
            self.angle_rad[rows],
        )


def crossings(tracks: Tracks, lines: Lines) -> Crossings:
    """Return where ways cross, in the order of their soundings; at most ``MOST``."""
    found: list[IntArray] = []
    count = 0
    first = np.arange(0, len(tracks), PIECE)
    last = np.minimum(first + PIECE, len(tracks) - 1)
    stretch = _stretches(tracks.vehicle, tracks.east_m, tracks.north_m)
    buffer = np.empty((PAIRS_AT_ONCE * PIECE**2, 2), dtype=np.int64)
    for pairs in _near(tracks, first, last):
        hits = _crossed(pairs, first, last, tracks.east_m, tracks.north_m, lines.joined, stretch, buffer)
        found.append(buffer[:hits].copy())
        count += hits
        if count >= MOST:
            break
    segments = np.concatenate(found)[:MOST] if found else np.zeros((0, 2), dtype=np.int64)
    return _described(tracks, lines, segments)


def _near(tracks: Tracks, first: IntArray, last: IntArray) -> Iterator[IntArray]:
    """Yield pairs of pieces, (p, 2), whose rectangles meet."""
    if not len(first):
        return
    bounds = []
    for values in (tracks.east_m, tracks.north_m):
        ends = values[last]
        bounds.append(np.minimum(np.minimum.reduceat(values, first), ends))
        bounds.append(np.maximum(np.maximum.reduceat(values, first), ends))
    west, east, south, north = bounds
    boxes = shapely.box(west, south, east, north)
    tree = shapely.STRtree(boxes)
    for begin in range(0, len(boxes), PIECES_AT_ONCE):
        one, other = tree.query(boxes[begin : begin + PIECES_AT_ONCE])
        one = one + begin
        pairs = np.column_stack([one, other])[other >= one]
        for at in range(0, len(pairs), PAIRS_AT_ONCE):
            yield pairs[at : at + PAIRS_AT_ONCE]


@njit(cache=True, nogil=True)
def _stretches(vehicle: IntArray, east: FloatArray, north: FloatArray) -> IntArray:
    """Number stretches of the ways, (n,): one ends where the vehicle is farther than ``AWAY_M`` from its begin.

    Numbers of neighbouring stretches differ by one, those of different vehicles by two at least.
    """
    number = np.zeros(len(east), dtype=np.int64)
    begin = 0
    for i in range(1, len(east)):
        number[i] = number[i - 1]
        if vehicle[i] != vehicle[i - 1]:
            number[i] += 2
            begin = i
        elif np.hypot(east[i] - east[begin], north[i] - north[begin]) > AWAY_M:
            number[i] += 1
            begin = i
    return number


@njit(cache=True, nogil=True)
def _side(e0: float, n0: float, e1: float, n1: float, e: float, n: float) -> float:
    """Twice the area of the triangle of a segment and a point: positive on its left."""
    return (e1 - e0) * (n - n0) - (n1 - n0) * (e - e0)


@njit(cache=True, nogil=True)
def _crossed(
    pairs: IntArray,
    first: IntArray,
    last: IntArray,
    east: FloatArray,
    north: FloatArray,
    joined: BoolArray,
    stretch: IntArray,
    found: IntArray,
) -> int:
    """Write the segments of pieces that cross each other to ``found``; returns how many pairs.

    A sounding on the other segment counts as left of it. The same numbers give the same answer for both segments that
    share the sounding, so a crossing at a sounding is found once.
    """
    count = 0
    for p in range(len(pairs)):
        a, b = pairs[p]
        for i in range(first[a], last[a]):
            if not joined[i]:
                continue
            e0, n0, e1, n1 = east[i], north[i], east[i + 1], north[i + 1]
            low_e, high_e = min(e0, e1), max(e0, e1)
            low_n, high_n = min(n0, n1), max(n0, n1)
            for j in range(max(first[b], i + 2), last[b]):
                if not joined[j] or stretch[j] - stretch[i] <= 1:
                    continue
                e2, n2, e3, n3 = east[j], north[j], east[j + 1], north[j + 1]
                if min(e2, e3) > high_e or max(e2, e3) < low_e or min(n2, n3) > high_n or max(n2, n3) < low_n:
                    continue
                left2 = _side(e0, n0, e1, n1, e2, n2) >= 0.0
                left3 = _side(e0, n0, e1, n1, e3, n3) >= 0.0
                if left2 == left3:
                    continue
                left0 = _side(e2, n2, e3, n3, e0, n0) >= 0.0
                left1 = _side(e2, n2, e3, n3, e1, n1) >= 0.0
                if left0 != left1:
                    found[count, 0], found[count, 1] = i, j
                    count += 1
    return count


def _described(tracks: Tracks, lines: Lines, segments: IntArray) -> Crossings:
    """Return the crossings of pairs of segments, (k, 2)."""
    same = tracks.vehicle[segments[:, 0]] == tracks.vehicle[segments[:, 1]]
    segments = np.where(same[:, None], segments[:, ::-1], segments)
    at = np.column_stack([tracks.east_m, tracks.north_m])
    begin, way = at[segments], at[segments + 1] - at[segments]
    one, other = way[:, 0], way[:, 1]
    apart = begin[:, 1] - begin[:, 0]
    turned = _cross(one, other)
    share = np.column_stack([_cross(apart, other), _cross(apart, one)]) / turned[:, None]
    share = np.clip(share, 0.0, 1.0)

    def along(values: FloatArray) -> FloatArray:
        low, high = values[segments], values[segments + 1]
        return np.asarray(low + share * (high - low))

    place = begin[:, 0] + share[:, :1] * one
    return Crossings(
        east_m=place[:, 0],
        north_m=place[:, 1],
        line=lines.line[segments],
        time_s=along(tracks.time_s),
        depth_m=along(tracks.depth_m),
        sd_m=along(tracks.sd_m),
        angle_rad=np.arctan2(np.abs(turned), np.abs((one * other).sum(axis=1))),
    )


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


@cache
def warm_up() -> None:
    """Compile what looks for crossings (or load it from the cache), so that no request waits for it."""
    way = np.arange(3.0)
    still = np.ones(3)
    tracks = Tracks.of(
        {"a": np.column_stack([way, way, still, still, still]), "b": np.column_stack([way, still, way, still, still])}
    )
    crossings(tracks, cut(tracks))
