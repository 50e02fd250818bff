"""How close a ship and a vehicle come: the closest point of approach of a course and a planned way."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray

DIVE_S = 60.0
"""A vehicle that leaves the surface counts as there for so long: how steep it dives is not known."""


@dataclass(frozen=True)
class TimedWay:
    """Where a vehicle will be when: straight on between corners, at rest after the last.

    Attributes
    ----------
    time_s : (n,)
        When it is at each corner, from now on; ascending, the first 0.
    place_m : (n, 2)
        East, north.
    depth_m : (n,)
    """

    time_s: FloatArray
    place_m: FloatArray
    depth_m: FloatArray


def planned_way(
    place_m: FloatArray, depth_m: float, ends: Sequence[tuple[FloatArray, float]], speed_mps: float
) -> TimedWay:
    """Return the way of a vehicle that goes from where it is through ``ends``, each a place (2,) and a depth (m).

    Without a speed it stays where it is, and counts as at the least of these depths.
    """
    places = np.array([place_m, *(end for end, _ in ends)], dtype=np.float64)
    depths = np.array([depth_m, *(deep for _, deep in ends)], dtype=np.float64)
    if speed_mps <= 0.0:
        return TimedWay(np.zeros(1), places[:1], np.array([depths.min()]))
    away = np.diff(np.column_stack([places, depths]), axis=0)
    taken = np.linalg.norm(away, axis=1) / speed_mps
    return TimedWay(np.concatenate([[0.0], np.cumsum(taken)]), places, depths)


def closest_approach(
    ships_m: FloatArray, velocities_mps: FloatArray, way: TimedWay, least_depth_m: float, within_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return how close ships come within a time to a vehicle while that is shallower than a depth, and when.

    Ships keep course and speed. A leg that leads up counts from its beginning: when a vehicle rises on it is its own
    affair. One that leads down counts for :data:`DIVE_S`.

    Parameters
    ----------
    ships_m, velocities_mps : (n, 2)
        East, north; where they are now.
    least_depth_m
        From here on down the vehicle is out of their way.

    Returns
    -------
    distance_m, in_s : (n,)
        inf and 0 where the vehicle is deep all the time; of equal distances the first time.
    """
    distance_m, in_s = np.full(len(ships_m), np.inf), np.zeros(len(ships_m))
    for begin_s, end_s in _shallow_times(way, least_depth_m, within_s):
        inner = way.time_s[(way.time_s > begin_s) & (way.time_s < end_s)]
        times = np.concatenate([[begin_s], inner, [end_s]])
        vehicle = np.column_stack([np.interp(times, way.time_s, way.place_m[:, axis]) for axis in (0, 1)])
        apart = ships_m + times[:, None, None] * velocities_mps - vehicle[:, None, :]
        for first, second, start_s, stop_s in zip(apart, apart[1:], times, times[1:], strict=False):
            along = second - first
            length2 = np.einsum("ij,ij->i", along, along)
            toward = -np.einsum("ij,ij->i", first, along)
            part = np.clip(toward / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
            away = np.hypot(*(first + part[:, None] * along).T)
            closer = away < distance_m
            distance_m[closer], in_s[closer] = away[closer], (start_s + part * (stop_s - start_s))[closer]
    return distance_m, in_s


def _shallow_times(way: TimedWay, least_depth_m: float, within_s: float) -> Iterator[tuple[float, float]]:
    """Yield from when to when a vehicle counts as shallow, one after the other."""
    ends = [*way.time_s[1:].tolist(), math.inf]
    last = len(way.time_s) - 1
    for leg, (begin_s, end_s) in enumerate(zip(way.time_s.tolist(), ends, strict=True)):
        begins_up = way.depth_m[leg] < least_depth_m
        ends_up = way.depth_m[min(leg + 1, last)] < least_depth_m
        if begin_s <= within_s and (begins_up or ends_up):
            until_s = end_s if ends_up else min(begin_s + DIVE_S, end_s)
            yield begin_s, min(until_s, within_s)
