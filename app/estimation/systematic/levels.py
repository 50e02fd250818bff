"""Depth offsets of vehicles and the water level's residual, from depths where lines cross."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.systematic.jackknife import Estimate, jackknife_sd, solved

OFFSET_PRIOR_M, LEVEL_PRIOR_M = 1.0, 0.3
"""Standard deviations of a vehicle's offset and of the water level's residual before anything is known."""

NODE_S, MOST_NODES = 1800.0, 24
"""The residual of the water level is linear between nodes this far apart, or so many of them."""

LEAST_SPAN_S, APART_S, LEAST_APART = 3600.0, 1800.0, 20
"""A water level is looked for in surveys at least this long, with so many crossings of lines so far apart in time."""

LEAST_CROSSINGS = 5
"""Fewer crossings with other vehicles tell nothing of an offset."""

MOST_GROUPS = 60
HUBER = 1.5
"""Differences of more than so many standard deviations count less (Huber 1964)."""
ROUNDS = 10


@dataclass(frozen=True)
class CrossingDepths:
    """Depths of two lines where they cross, k times.

    Attributes
    ----------
    vehicle, line : (k, 2)
        Numbers of the vehicles and of the lines, from 0.
    time_s : (k, 2)
    difference_m : (k,)
        Depth on the first line minus that on the second.
    """

    vehicle: IntArray
    line: IntArray
    time_s: FloatArray
    difference_m: FloatArray


@dataclass(frozen=True)
class LevelErrors:
    """What the crossings tell.

    Attributes
    ----------
    offsets
        By vehicle, by how much its depths are too large, beside the mean of all that cross each other.
    node_s, level_m : (n,)
        By how much depths are too large at some times, mean 0; no nodes where the survey does not tell.
    level
        The largest of these.
    rms_before_m, rms_after_m
        Of the differences as they are, and as they are without these errors, each line's by what all others say.
    """

    offsets: dict[int, Estimate]
    node_s: FloatArray
    level_m: FloatArray
    level: Estimate | None
    rms_before_m: float
    rms_after_m: float


def level_errors(found: CrossingDepths) -> LevelErrors | None:
    """Return offsets and water level that make the crossings agree; None where they tell nothing of either.

    A difference is modelled as ``o_a - o_b + L(t_a) - L(t_b)``, robustly (Huber). Errors of one line are shared by its
    crossings, so deviations come of leaving lines out.
    """
    offset_of = _compared(found)
    node_s = _nodes(found.time_s)
    if not len(offset_of) and not len(node_s):
        return None
    design = np.hstack([_offsets(found.vehicle, offset_of), _hats(found.time_s, node_s)])
    prior = np.concatenate([np.full(len(offset_of), OFFSET_PRIOR_M), np.full(len(node_s), LEVEL_PRIOR_M)])
    weight = _robust_weights(design, found.difference_m, prior)
    weighted = design * weight[:, None]
    normal, right = weighted.T @ design + np.diag(prior**-2.0), weighted.T @ found.difference_m
    members = _groups(found.line)
    parts = [(weighted[own].T @ design[own], weighted[own].T @ found.difference_m[own]) for own in members]
    solutions = solved(normal, right, parts)
    sd = jackknife_sd(solutions[1:])
    best, without = solutions[0], solutions[1:]
    count = (design != 0.0).sum(axis=0)
    offsets = {
        vehicle: Estimate(float(best[at]), float(sd[at]), int(count[at]), len(members))
        for at, vehicle in enumerate(offset_of.tolist())
    }
    level_m = best[len(offset_of) :] - (best[len(offset_of) :].mean() if len(node_s) else 0.0)
    level = None
    if len(node_s):
        most = int(np.abs(level_m).argmax())
        level = Estimate(float(level_m[most]), float(sd[len(offset_of) + most]), len(design), len(members))
    left = np.concatenate([found.difference_m[own] - design[own] @ x for own, x in zip(members, without, strict=True)])
    return LevelErrors(offsets, node_s, level_m, level, _rms(found.difference_m), _rms(left))


def _compared(found: CrossingDepths) -> IntArray:
    """Return the vehicles that cross others often enough."""
    others = found.vehicle[found.vehicle[:, 0] != found.vehicle[:, 1]]
    vehicles, count = np.unique(others, return_counts=True)
    return np.asarray(vehicles[count >= LEAST_CROSSINGS])


def _nodes(time_s: FloatArray) -> FloatArray:
    if not len(time_s) or (np.abs(np.diff(time_s, axis=1)) >= APART_S).sum() < LEAST_APART:
        return np.zeros(0)
    first, last = float(time_s.min()), float(time_s.max())
    if last - first < LEAST_SPAN_S:
        return np.zeros(0)
    return np.linspace(first, last, 1 + min(MOST_NODES - 1, round((last - first) / NODE_S)))


def _offsets(vehicle: IntArray, offset_of: IntArray) -> FloatArray:
    """Return the part of the equations that is for offsets, (k, v)."""
    one, other = (vehicle[:, side, None] == offset_of for side in (0, 1))
    return np.asarray(one.astype(float) - other.astype(float))


def _hats(time_s: FloatArray, node_s: FloatArray) -> FloatArray:
    """Return the part that is for the water level's nodes, (k, n): linear between them."""
    if not len(node_s):
        return np.zeros((len(time_s), 0))
    hats = np.zeros((len(time_s), len(node_s)))
    row = np.arange(len(time_s))
    place = (time_s - node_s[0]) / (node_s[1] - node_s[0])
    at = np.clip(np.floor(place).astype(np.int64), 0, len(node_s) - 2)
    for side, sign in ((0, 1.0), (1, -1.0)):
        share = place[:, side] - at[:, side]
        np.add.at(hats, (row, at[:, side]), sign * (1.0 - share))
        np.add.at(hats, (row, at[:, side] + 1), sign * share)
    return hats


def _robust_weights(design: FloatArray, difference_m: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the weight of each difference (k,), 1 over its variance, less where it is far from what is expected."""
    weight = np.full(len(difference_m), 1.0 / max(_spread(difference_m), 1e-3) ** 2)
    for _ in range(ROUNDS):
        normal = (design * weight[:, None]).T @ design + np.diag(prior**-2.0)
        off = difference_m - design @ np.linalg.solve(normal, (design * weight[:, None]).T @ difference_m)
        sd = max(_spread(off), 1e-3)
        weight = np.minimum(1.0, HUBER * sd / np.maximum(np.abs(off), 1e-12)) / sd**2
    return weight


def _groups(line: IntArray) -> list[BoolArray]:
    """Return which crossings (k,) each group of lines takes part in; at most ``MOST_GROUPS``."""
    numbers = np.unique(line)
    group = np.searchsorted(numbers, line) * min(MOST_GROUPS, len(numbers)) // max(len(numbers), 1)
    return [np.asarray((group == g).any(axis=1)) for g in range(min(MOST_GROUPS, len(numbers)))]


def _spread(values: FloatArray) -> float:
    """Robust standard deviation about zero."""
    return 1.4826 * float(np.median(np.abs(values)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))
