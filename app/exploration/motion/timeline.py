"""Where vehicles are when, and how close two of them come: pieces of straight lines, flown evenly."""

import math
from typing import NamedTuple

import numpy as np

from app.arrays import FloatArray


class Timeline(NamedTuple):
    """A vehicle's motion.

    Attributes
    ----------
    time_s : (n,)
        Increasing; before the first and after the last of them the vehicle stays.
    place_m : (n, 3)
        East, north and depth at these times.
    """

    time_s: FloatArray
    place_m: FloatArray

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the places (k, 3) at times (k,)."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self.place_m.T])

    def since(self, begin_s: float) -> "Timeline":
        """Return the part of the motion from a time on."""
        later = self.time_s > begin_s
        start = self.at(np.array([begin_s]))
        return Timeline(np.append(begin_s, self.time_s[later]), np.vstack([start, self.place_m[later]]))


SLOWEST_SHARE = 0.1
"""Part of its speed that a vehicle makes good at the least against a current, so that its way ends."""


def speed_over_ground_mps(way: FloatArray, speed_mps: float, current_mps: tuple[float, float]) -> float:
    """Return how fast a vehicle makes good a straight way that heads into the current as much as keeps it there.

    Parameters
    ----------
    way : (2,) or (3,)
        From its beginning to its end: east, north, and what it goes down.
    speed_mps
        Through the water.
    current_mps
        East and north.
    """
    length_m = math.hypot(*way)
    if length_m < 1e-9 or current_mps == (0.0, 0.0):
        return speed_mps
    helps = (way[0] * current_mps[0] + way[1] * current_mps[1]) / length_m
    aside2 = max(current_mps[0] ** 2 + current_mps[1] ** 2 - helps**2, 0.0)
    return float(max(math.sqrt(max(speed_mps**2 - aside2, 0.0)) + helps, SLOWEST_SHARE * speed_mps))


class Approach(NamedTuple):
    """The closest that two vehicles come to each other, and when."""

    distance_m: float
    time_s: float


def closest_approach(a: Timeline, b: Timeline, vertical_m: float = np.inf, until_s: float = np.inf) -> Approach:
    """Return the least horizontal distance of two vehicles while they are less than ``vertical_m`` apart in depth.

    Looked at from the later one of the two beginnings to ``until_s``, or to the end of both. ``Approach(inf, nan)``
    where they are never that close in depth.
    """
    begin_s = max(a.time_s[0], b.time_s[0])
    end_s = max(begin_s, min(until_s, max(a.time_s[-1], b.time_s[-1])))
    knots = np.union1d(a.time_s, b.time_s)
    knots = np.unique(np.concatenate([[begin_s], knots[(knots > begin_s) & (knots < end_s)], [end_s]]))
    apart = a.at(knots) - b.at(knots)
    if len(knots) == 1:
        close = abs(apart[0, 2]) < vertical_m
        return Approach(float(np.hypot(*apart[0, :2])), float(knots[0])) if close else Approach(np.inf, np.nan)
    start, change = apart[:-1], np.diff(apart, axis=0)
    # The part of each piece in which the depths are close: |dz + t * ddz| < vertical_m.
    low, high = _close_part(start[:, 2], change[:, 2], vertical_m)
    v2 = np.einsum("ij,ij->i", change[:, :2], change[:, :2])
    nearest = -np.einsum("ij,ij->i", start[:, :2], change[:, :2]) / np.where(v2 > 0.0, v2, 1.0)
    part = np.clip(np.where(v2 > 0.0, nearest, 0.0), low, high)
    distance = np.hypot(*(start[:, :2] + part[:, None] * change[:, :2]).T)
    distance = np.where(low <= high, distance, np.inf)
    k = int(np.argmin(distance))
    if not np.isfinite(distance[k]):
        return Approach(np.inf, np.nan)
    return Approach(float(distance[k]), float(knots[k] + part[k] * (knots[k + 1] - knots[k])))


def _close_part(gap: FloatArray, change: FloatArray, limit: float) -> tuple[FloatArray, FloatArray]:
    """Return the part (n,) of each piece, from and to, in which an even gap is below a limit; from > to: never."""
    if not np.isfinite(limit):
        return np.zeros(len(gap)), np.ones(len(gap))
    steady = np.abs(change) < 1e-12
    per = np.where(steady, 1.0, change)
    first, second = (-limit - gap) / per, (limit - gap) / per
    low, high = np.maximum(np.minimum(first, second), 0.0), np.minimum(np.maximum(first, second), 1.0)
    close = np.abs(gap) < limit
    return np.where(steady, np.where(close, 0.0, 1.0), low), np.where(steady, np.where(close, 1.0, 0.0), high)
