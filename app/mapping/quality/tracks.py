"""Soundings along the vehicles' ways, cut into lines; which of these are crosslines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.quality.clock_sessions import FASTEST_MPS, UNCERTAIN_M, sessions

GAP_S, GAP_M, GAP_OF_USUAL = 30.0, 25.0, 5.0
"""Nothing is known between two soundings that lie farther apart than one of the first two and than so many times what
is usual in their track."""

LONGEST_GAP_M = 100.0
"""Nor between two that are farther apart than this, whatever is usual."""

LEAST_STEP_M = 0.01
"""A sounding that is nearer to the one before it says nothing of the way."""

TURN_RAD, COURSE_TOLERANCE_M = np.radians(30.0), 2.0
"""A line ends where the course leaves its direction by more than the angle; deviations of up to so many metres, as from
uncertain positions, are no change of course."""

LEAST_WAY_M = 10.0
"""A course is told from a way of at least this length."""

CROSS_RAD = np.radians(45.0)
"""Crosslines differ at least so much from the dominant direction."""

SPREAD_RAD = np.radians(20.0)
"""Lines that differ less than this count for one direction."""

CROSSLINE_OF_LONGEST = 0.1
"""A crossline is at least so long as this share of the longest main line: ways between lines are shorter."""


@dataclass(frozen=True)
class Tracks:
    """Soundings of several vehicles, each array of shape (n,), sorted by vehicle, session of its clock, and time.

    Attributes
    ----------
    names
        Of the vehicles.
    vehicle
        Index in ``names``.
    time_s
        The vehicle's clock, Unix seconds.
    east_m, north_m, depth_m, sd_m
        Local frame; corrected depth, positive down, and its standard deviation.
    """

    names: tuple[str, ...]
    vehicle: IntArray
    time_s: FloatArray
    east_m: FloatArray
    north_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray

    @classmethod
    def of(cls, tables: dict[str, FloatArray]) -> "Tracks":
        """Return tracks of tables (k, 5), one per vehicle: time, east, north, depth, standard deviation.

        Rows are in the order of arrival; where a vehicle's clock was set back a session begins. Soundings of the same
        time, as of a DVL's four beams, become one in their middle.
        """
        names = tuple(sorted(tables))
        parts = [_along(tables[name]) for name in names]
        vehicle = np.repeat(np.arange(len(names)), [len(part) for part in parts])
        table = np.concatenate(parts) if parts else np.zeros((0, 5))
        return cls(names, vehicle, *np.ascontiguousarray(table.T))

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True)
class Lines:
    """Tracks cut into m lines, which are numbered in the order of their soundings.

    Attributes
    ----------
    line : (n,)
        Line of the segment that begins at each sounding.
    joined : (n,)
        Whether a segment leads from each sounding to the next.
    vehicle : (m,)
        Index of the vehicle's name.
    number : (m,)
        Among the vehicle's lines, from 1.
    start_s, end_s : (m,)
        The vehicle's clock.
    length_m : (m,)
        Along the way.
    heading_rad : (m,)
        From its begin to its end, clockwise from north.
    first, last : (m,)
        Index of its first and its last sounding.
    """

    line: IntArray
    joined: BoolArray
    vehicle: IntArray
    number: IntArray
    start_s: FloatArray
    end_s: FloatArray
    length_m: FloatArray
    heading_rad: FloatArray
    first: IntArray
    last: IntArray

    def __len__(self) -> int:
        return len(self.vehicle)


def _along(table: FloatArray) -> FloatArray:
    """Return a vehicle's soundings (k, 5) by session and time, one for each time and place."""
    table = _one_per_time(table)
    parts = [_one_per_time(table[rows]) for rows in sessions(*table[:, :3].T)]
    table = np.concatenate([np.zeros((0, 5)), *parts])
    step = np.hypot(*np.diff(table[:, 1:3], axis=0).T)
    moved = np.concatenate([[True], (step >= LEAST_STEP_M) | (np.diff(table[:, 0]) < 0.0)])
    return np.asarray(table[moved[: len(table)]])


def _one_per_time(table: FloatArray) -> FloatArray:
    """Return soundings (k, 5) of which those of the same time, one after the other, are one in their middle."""
    first = np.flatnonzero(np.diff(table[:, 0], prepend=np.nan) != 0.0)
    if len(first) < len(table):
        size = np.diff(first, append=len(table))
        variance = np.add.reduceat(table[:, 4] ** 2, first) / size**2
        table = np.add.reduceat(table, first) / size[:, None]
        table[:, 4] = np.sqrt(variance)
    return table


def cut(tracks: Tracks) -> Lines:
    """Cut tracks into lines: one ends at a gap or where the course turns."""
    count = len(tracks)
    joined = _joined(tracks)
    line = np.zeros(count, dtype=np.int64)
    begins = np.zeros(count, dtype=bool)
    begins[:1] = True
    begins[1:] = ~joined[:-1]
    begins[_turns(tracks, begins)] = True
    # A sounding that no segment leads from ends the line before it, if one leads there.
    begins[1:] &= joined[1:] | ~joined[:-1]
    line = np.cumsum(begins) - 1
    # Single soundings between gaps are no lines.
    alone = begins & ~joined
    numbers = np.cumsum(begins & ~alone) - 1
    first = np.flatnonzero(begins & ~alone)
    line = np.where(alone, -1, numbers)
    last = np.zeros(len(first), dtype=np.int64)
    last[line[joined]] = np.flatnonzero(joined) + 1
    step = np.hypot(np.diff(tracks.east_m, append=0.0), np.diff(tracks.north_m, append=0.0))
    length: FloatArray = np.bincount(line[joined], step[joined], len(first)).astype(np.float64)
    vehicle = tracks.vehicle[first]
    number = np.arange(len(first)) - np.searchsorted(vehicle, vehicle) + 1
    heading = np.arctan2(
        tracks.east_m[last] - tracks.east_m[first],
        tracks.north_m[last] - tracks.north_m[first],
    ) % (2 * np.pi)
    return Lines(line, joined, vehicle, number, tracks.time_s[first], tracks.time_s[last], length, heading, first, last)


def _joined(tracks: Tracks) -> BoolArray:
    joined = np.zeros(len(tracks), dtype=bool)
    for vehicle in range(len(tracks.names)):
        rows = np.flatnonzero(tracks.vehicle == vehicle)
        if len(rows) > 1:
            between_s = np.diff(tracks.time_s[rows])
            between_m = np.hypot(np.diff(tracks.east_m[rows]), np.diff(tracks.north_m[rows]))
            longest_s = max(GAP_S, GAP_OF_USUAL * float(np.median(between_s)))
            longest_m = np.minimum(
                min(max(GAP_M, GAP_OF_USUAL * float(np.median(between_m))), LONGEST_GAP_M),
                FASTEST_MPS * between_s + UNCERTAIN_M,
            )
            joined[rows[:-1]] = (between_s >= 0.0) & (between_s <= longest_s) & (between_m <= longest_m)
    return joined


def _turns(tracks: Tracks, begins: BoolArray) -> Sequence[int]:
    """Return the soundings where the course turns."""
    run = np.cumsum(begins) - 1
    long = np.bincount(run)[run] > 1 if len(run) else np.zeros(0, dtype=bool)
    rows = np.flatnonzero(long)
    if not len(rows):
        return []
    # The third coordinate goes through unchanged: it says which sounding this was.
    places = np.column_stack([tracks.east_m[rows], tracks.north_m[rows], rows.astype(float)])
    _, indices = np.unique(run[rows], return_inverse=True)
    ways = shapely.simplify(shapely.linestrings(places, indices=indices), COURSE_TOLERANCE_M, preserve_topology=False)
    corners, way = shapely.get_coordinates(ways, include_z=True, return_index=True)
    turns = []
    for begin, end in zip(*_runs(way), strict=True):
        start = begin
        for k in range(begin + 1, end - 1):
            so_far = corners[k, :2] - corners[start, :2]
            if np.hypot(*so_far) < LEAST_WAY_M:
                continue
            after = k + 1
            while after < end - 1 and np.hypot(*(corners[after, :2] - corners[k, :2])) < LEAST_WAY_M:
                after += 1
            ahead = corners[after, :2] - corners[k, :2]
            turned = np.arctan2(so_far[0] * ahead[1] - so_far[1] * ahead[0], so_far @ ahead)
            if abs(turned) > TURN_RAD:
                turns.append(int(corners[k, 2]))
                start = k
    return turns


def _runs(values: IntArray) -> tuple[list[int], list[int]]:
    """Return where runs of equal values begin and end."""
    first = np.flatnonzero(np.diff(values, prepend=-1))
    return first.tolist(), [*first[1:].tolist(), len(values)]


def dominant_rad(lines: Lines) -> float:
    """Return the direction in which most of the way was flown, 0 to pi from north; either way along it is the same."""
    candidates = np.radians(np.arange(180.0))
    near = np.maximum(0.0, 1.0 - between_rad(lines.heading_rad[:, None], candidates) / SPREAD_RAD)
    best = candidates[int(np.argmax(lines.length_m @ near))] if len(lines) else 0.0
    weight = lines.length_m * (between_rad(lines.heading_rad, best) <= SPREAD_RAD)
    twice = 2.0 * lines.heading_rad
    return float(0.5 * np.arctan2(weight @ np.sin(twice), weight @ np.cos(twice)) % np.pi)


def between_rad(one_rad: FloatArray, other_rad: FloatArray | float) -> FloatArray:
    """Return the angle between directions whose sense does not matter, 0 to pi / 2."""
    apart = np.abs(one_rad - other_rad) % np.pi
    return np.asarray(np.minimum(apart, np.pi - apart))


def crosslines(lines: Lines, crossed: IntArray) -> BoolArray:
    """Return which lines (m,) are crosslines.

    They run across the dominant direction and cross a main line that is not the one flown just before or after.

    Parameters
    ----------
    crossed : (k, 2)
        Lines that cross each other.
    """
    across = between_rad(lines.heading_rad, dominant_rad(lines)) >= CROSS_RAD
    longest_m = float(lines.length_m[~across].max(initial=0.0))
    pairs = np.concatenate([crossed, crossed[:, ::-1]])
    apart = (np.abs(pairs[:, 0] - pairs[:, 1]) > 1) | (lines.vehicle[pairs[:, 0]] != lines.vehicle[pairs[:, 1]])
    meets = np.zeros(len(lines), dtype=bool)
    meets[pairs[apart & ~across[pairs[:, 1]], 0]] = True
    return np.asarray(across & meets & (lines.length_m >= CROSSLINE_OF_LONGEST * longest_m))
