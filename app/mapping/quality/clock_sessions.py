"""Stretches of a track within which the vehicle's clock went on: soundings come in the order in which they arrived."""

import math
from bisect import bisect_left, bisect_right
from itertools import pairwise

import numpy as np

from app.arrays import FloatArray, IntArray

ZIGZAG, TOLERANCE_M = 1.5, 2.0
"""Soundings that arrived late lie on the way that is known: with them it is no longer than so many times both ways, and
than so many metres more. Where two stretches have the same times by a clock that was set back, each sounding of one is
followed by one of the other somewhere else."""

SAME_MOMENT_M = 15.0
"""Beams of one moment, of which some arrived later, meet the bottom within so many metres of each other."""

FASTEST_MPS, UNCERTAIN_M = 10.0, 5.0
"""No vehicle goes faster, in whatever current, beside so many metres by which its position may change at a fix."""

LATE_S = 10.0
"""Soundings come out of order by so much, as of several beams: no clock is taken to have been set back by less."""

LEAST_S = 30.0

NEXT_OF_USUAL = 5.0
"""What comes no more than so many times the usual step after the end of a session, or before it, goes on from it."""

MOST = 50
"""So many stretches are looked at, the newest first, for that which late soundings belong to."""

PART = 256
"""Rows of a session are held in parts of so many to twice as many: late soundings are put into one of them."""


def sessions(time_s: FloatArray, east_m: FloatArray, north_m: FloatArray) -> list[IntArray]:
    """Return the rows of each session in the order of time; sessions are in the order of their first arrival.

    A clock that is set back, as by the first GPS time after a reboot, begins a session. Soundings that arrive late, as
    from a log, do not: they are put where they belong.

    Parameters
    ----------
    time_s : (n,)
        The vehicle's clock, in the order of arrival.
    east_m, north_m : (n,)
    """
    place = np.column_stack([east_m, north_m])
    found: list[_Session] = []
    for run in np.split(np.arange(len(time_s)), _set_back(time_s)):
        run = run[np.argsort(time_s[run], kind="stable")]
        for number in range(len(found) - 1, max(len(found) - MOST, 0) - 1, -1):
            if _continues(found[number], run, time_s, place, newest=number == len(found) - 1):
                found[number].add(run)
                break
        else:
            if len(run):
                found.append(_Session(run, time_s, place))
    return [session.rows for session in found]


class _Session:
    """Rows in the order of time, in parts, so that what comes late and alone moves few others."""

    def __init__(self, rows: IntArray, time_s: FloatArray, place_m: FloatArray) -> None:
        self._time_s, self._place_m = time_s, place_m
        self._parts, self._begin_s, self._end_s = list[IntArray](), list[float](), list[float]()
        # Ways within each part, and from its last row to the first of the next.
        self._way_m, self._link_m = list[float](), list[float]()
        self._put(0, 0, rows)

    @property
    def rows(self) -> IntArray:
        return np.concatenate(self._parts)

    @property
    def first_s(self) -> float:
        return self._begin_s[0]

    @property
    def last_s(self) -> float:
        return self._end_s[-1]

    @property
    def head(self) -> IntArray:
        """The first ``MOST`` rows; a part may be smaller where there is no other."""
        return np.concatenate(self._parts[:MOST])[:MOST] if PART < MOST else self._parts[0][:MOST]

    @property
    def tail(self) -> IntArray:
        """The last ``MOST`` rows."""
        return np.concatenate(self._parts[-MOST:])[-MOST:] if PART < MOST else self._parts[-1][-MOST:]

    def add(self, rows: IntArray) -> None:
        """Put further rows in, which are in the order of time; after those of the same time."""
        times = self._time_s[rows]
        end = len(rows)
        while end:
            number = max(bisect_right(self._begin_s, float(times[end - 1])) - 1, 0)
            begin = 0 if number == 0 else int(np.searchsorted(times[:end], self._begin_s[number]))
            both = np.concatenate([self._parts[number], rows[begin:end]])
            self._put(number, number + 1, both[np.argsort(self._time_s[both], kind="stable")])
            end = begin

    def between(self, begin_s: float, end_s: float, new_s: FloatArray) -> tuple[IntArray, float]:
        """Return the rows of some time and one more on either side, and by how much their way is longer than told.

        Of parts in which there is none of the new times, ascending, only the ends are returned.
        """
        first = max(bisect_left(self._begin_s, begin_s) - 1, 0)
        last = min(bisect_right(self._begin_s, end_s) + 1, len(self._parts))
        rows, longer_m = list[IntArray](), 0.0
        after = list[IntArray]()
        if self._end_s[first] < begin_s:
            rows.append(self._parts[first][-1:])
            first += 1
        if last > first and self._begin_s[last - 1] > end_s:
            after.append(self._parts[last - 1][:1])
            last -= 1
        for number in [*self._touched(new_s), last]:
            if number > first:
                ends = np.concatenate([self._parts[first][:1], self._parts[number - 1][-1:]])
                rows.append(ends if ends[0] != ends[1] else ends[:1])
                way_m = sum(self._way_m[first:number]) + sum(self._link_m[first : number - 1])
                longer_m += way_m - _length_m(self._place_m[ends])
            if first <= number < last:
                rows.append(self._parts[number])
            first = max(first, number + 1)
        found = np.concatenate(rows + after)
        times = self._time_s[found]
        begin, end = max(int(np.searchsorted(times, begin_s)) - 1, 0), int(np.searchsorted(times, end_s, "right")) + 1
        return found[begin:end], longer_m

    def _touched(self, new_s: FloatArray) -> list[int]:
        """Return the parts in whose time there are some of these, ascending."""
        found, at = list[int](), 0
        while at < len(new_s):
            time_s = float(new_s[at])
            begin, end = bisect_left(self._end_s, time_s), bisect_right(self._begin_s, time_s)
            found.extend(number for number in range(begin, end) if not found or number > found[-1])
            if begin < end:
                at = int(np.searchsorted(new_s, self._end_s[end - 1], "right"))
            else:
                at = int(np.searchsorted(new_s, self._begin_s[end])) if end < len(self._parts) else len(new_s)
        return found

    def _put(self, begin: int, end: int, rows: IntArray) -> None:
        """Put rows in the place of some parts: as one, or as several where they are too many."""
        count = 1 if len(rows) <= 2 * PART else len(rows) // PART
        edges = np.linspace(0, len(rows), count + 1).astype(int).tolist()
        parts = [rows[low:high] for low, high in pairwise(edges)]
        along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self._place_m[rows], axis=0).T))])
        first, last = np.array(edges[:-1]), np.array(edges[1:]) - 1
        self._parts[begin:end] = parts
        self._begin_s[begin:end] = self._time_s[rows[first]].tolist()
        self._end_s[begin:end] = self._time_s[rows[last]].tolist()
        self._way_m[begin:end] = (along_m[last] - along_m[first]).tolist()
        self._link_m[begin:end] = [*(along_m[first[1:]] - along_m[last[:-1]]).tolist(), 0.0]
        for number in (begin - 1, begin + len(parts) - 1):
            if 0 <= number < len(self._parts) - 1:
                ends = [self._parts[number][-1], self._parts[number + 1][0]]
                self._link_m[number] = _length_m(self._place_m[ends])


def _set_back(time_s: FloatArray) -> list[int]:
    """Return the rows (k,) at which the clock may have been set back: some before them are later by ``LATE_S``."""
    found, latest_s = list[int](), -np.inf
    for row in np.flatnonzero(np.diff(time_s) < 0.0) + 1:
        latest_s = max(latest_s, time_s[row - 1])
        if time_s[row] < latest_s - LATE_S:
            found.append(int(row))
            latest_s = -np.inf
    return found


def set_back_s(time_s: FloatArray, east_m: FloatArray, north_m: FloatArray) -> float:
    """Return by how many seconds a clock was set back at most, 0 where no two ways have the same times.

    Arguments are those of :func:`sessions`. Less than ``LEAST_S``, and what may have been recorded by two instruments
    at the same place, is not told.
    """
    place = np.column_stack([east_m, north_m])
    found = sessions(time_s, east_m, north_m)
    most_s = 0.0
    for before, after in pairwise(found):
        begin, end = max(time_s[before[0]], time_s[after[0]]), min(time_s[before[-1]], time_s[after[-1]])
        if end - begin < LEAST_S:
            continue
        at = np.linspace(begin, end, MOST)
        apart = [
            np.interp(at, time_s[before], place[before, axis]) - np.interp(at, time_s[after], place[after, axis])
            for axis in (0, 1)
        ]
        if np.median(np.hypot(*apart)) > SAME_MOMENT_M:
            most_s = max(most_s, float(time_s[before[-1]] - time_s[after[0]]))
    return most_s


def _continues(session: _Session, run: IntArray, time_s: FloatArray, place_m: FloatArray, *, newest: bool) -> bool:
    """Return whether a run of soundings lies on the way of a session, or before or after it."""
    of_run = time_s[run]
    begin_s, end_s = float(of_run[0]), float(of_run[-1])
    if begin_s >= session.last_s:
        return newest or _follows(session.tail, run[:MOST], time_s, place_m)
    if end_s <= session.first_s:
        return _follows(run[-MOST:], session.head, time_s, place_m)
    # Of both what lies at the same times, and one more on either side.
    low, high = int(np.searchsorted(of_run, session.first_s)), int(np.searchsorted(of_run, session.last_s, "right"))
    new = run[max(low - 1, 0) : high + 1]
    known, longer_m = session.between(begin_s, end_s, time_s[new])
    _, one, other = np.intersect1d(time_s[known], time_s[new], return_indices=True)
    if 2 * len(one) >= len(new):
        return bool(np.median(np.hypot(*(place_m[known[one]] - place_m[new[other]]).T)) <= SAME_MOMENT_M)
    both = np.concatenate([known, new])
    both = both[np.argsort(time_s[both], kind="stable")]
    apart = _length_m(place_m[known]) + longer_m + _length_m(place_m[new])
    return _length_m(place_m[both]) + longer_m <= ZIGZAG * apart + TOLERANCE_M


def _follows(before: IntArray, after: IntArray, time_s: FloatArray, place_m: FloatArray) -> bool:
    """Return whether the first of some soundings comes right after the last of others, as a vehicle can move."""
    gap_s = float(time_s[after[0]] - time_s[before[-1]])
    if gap_s > 0.0 and len(before) == len(after) == 1:
        return False  # what is usual is not known
    is_near = math.dist(place_m[after[0]], place_m[before[-1]]) <= FASTEST_MPS * gap_s + UNCERTAIN_M
    if not is_near:
        return False
    steps_s = np.concatenate([np.diff(time_s[before]), np.diff(time_s[after])])
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    return gap_s <= NEXT_OF_USUAL * usual_s


def _length_m(places_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(places_m, axis=0).T).sum())
