"""Stretches of a track within which the vehicle's clock went on: soundings come in the order in which they arrived."""

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
                found[number].add(run, time_s[run])
                break
        else:
            if len(run):
                found.append(_Session(run, time_s[run]))
    return [session.rows for session in found]


class _Session:
    """Rows in the order of time, and their times, with room for more: soundings may come in many small parts."""

    def __init__(self, rows: IntArray, times: FloatArray) -> None:
        self._rows, self._times, self._size = rows.copy(), times.copy(), len(rows)

    @property
    def rows(self) -> IntArray:
        return self._rows[: self._size]

    @property
    def times(self) -> FloatArray:
        return self._times[: self._size]

    def add(self, rows: IntArray, times: FloatArray) -> None:
        """Put further rows in; both are in the order of time."""
        size = self._size + len(rows)
        if size > len(self._rows):
            self._rows, self._times = np.resize(self._rows, 2 * size), np.resize(self._times, 2 * size)
        begin = int(np.searchsorted(self.times, times[0]))
        late_rows = np.concatenate([self.rows[begin:], rows])
        late_times = np.concatenate([self.times[begin:], times])
        order = np.argsort(late_times, kind="stable")
        self._rows[begin:size], self._times[begin:size], self._size = late_rows[order], late_times[order], size


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
    rows, times, of_run = session.rows, session.times, time_s[run]
    if of_run[0] >= times[-1]:
        return newest or _follows(rows[-MOST:], run[:MOST], time_s, place_m)
    if of_run[-1] <= times[0]:
        return _follows(run[-MOST:], rows[:MOST], time_s, place_m)
    # Of both what lies at the same times, and one more on either side.
    known = rows[
        max(int(np.searchsorted(times, of_run[0])) - 1, 0) : int(np.searchsorted(times, of_run[-1], "right")) + 1
    ]
    low, high = int(np.searchsorted(of_run, times[0])), int(np.searchsorted(of_run, times[-1], "right"))
    new = run[max(low - 1, 0) : high + 1]
    _, one, other = np.intersect1d(time_s[known], time_s[new], return_indices=True)
    if 2 * len(one) >= len(new):
        return bool(np.median(np.hypot(*(place_m[known[one]] - place_m[new[other]]).T)) <= SAME_MOMENT_M)
    both = np.concatenate([known, new])
    both = both[np.argsort(time_s[both], kind="stable")]
    apart = _length_m(place_m[known]) + _length_m(place_m[new])
    return _length_m(place_m[both]) <= ZIGZAG * apart + TOLERANCE_M


def _follows(before: IntArray, after: IntArray, time_s: FloatArray, place_m: FloatArray) -> bool:
    """Return whether the first of some soundings comes right after the last of others, as a vehicle can move."""
    steps_s = np.concatenate([np.diff(time_s[before]), np.diff(time_s[after])])
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    gap_s = time_s[after[0]] - time_s[before[-1]]
    gap_m = np.hypot(*(place_m[after[0]] - place_m[before[-1]]))
    return bool(gap_s <= NEXT_OF_USUAL * usual_s and gap_m <= FASTEST_MPS * gap_s + UNCERTAIN_M)


def _length_m(places_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(places_m, axis=0).T).sum())
