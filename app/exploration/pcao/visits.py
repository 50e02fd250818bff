"""What keeps the controller from standing still for ever: without progress it leaves a vehicle to one landmark.

A controller sees what is left through a few sums only. Where these hold each other in balance, or where a landmark
lies out of sight below, it stays although something is left. Whether it gets on can be told from what is known: no
landmark became accurate for some steps while others are left. Then the nearest of these is *visited*: a vehicle goes
right over it and down until it is known, and the controller leads again. The sooner it fails again, the sooner the
next visit begins; where the controller does well it is given time again.

Vehicles that hold together for communication are one *group*, all others a group each: a group has progress, and one
of its vehicles, its visitor, makes its visits.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray

PATIENCE = 2
"""Steps without progress after which a group begins to visit; halved by every visit, down to one."""

ENOUGH = 8
"""Landmarks between two visits that give a group back its whole patience."""

HEIGHT, HEIGHT_ON_THE_WAY, LEAST_HEIGHT = 1.5, 3.0, 0.3
"""Above the landmark, in units of the state, at the end of a visit and on the way; lower with every look in vain."""
LOWER = 0.15
OVER = 0.5
"""A visitor this close, in units, horizontally, is over the landmark."""
NEARBY = 2.0
"""Within so many units it comes down to its height at the end; a landmark never seen makes it go down blindly."""

LOOKS = 10
"""Steps in which a visitor comes no closer after which it leaves the landmark for later."""
AGAIN = 6.0
"""How much farther, in units, a landmark seems with every visit in vain."""


BLIND = 2.0
"""How far below a vehicle, in units, a landmark is presumed that was never seen."""


class Visits(NamedTuple):
    """The memory of all groups (g) and landmarks (m), written in place.

    Attributes
    ----------
    idle : (g,)
        Steps since a landmark of the group's became known.
    patience : (g,)
        How many of them begin a visit.
    gained : (g,)
        Landmarks that became known since the last visit.
    target, visitor : (g,)
        The landmark that is visited, -1 without one; the row of the vehicle that does.
    looks : (g,)
        Steps in which the visitor came no closer.
    closest : (g,)
        How close it came.
    vain : (m,)
        Visits of each landmark in vain.
    open : (m,)
        Which landmarks were left one step ago.
    """

    idle: IntArray
    patience: IntArray
    gained: IntArray
    target: IntArray
    visitor: IntArray
    looks: IntArray
    closest: FloatArray
    vain: IntArray
    open: BoolArray


@njit(cache=True, nogil=True)
def no_visits(groups: int, landmarks: int) -> Visits:
    """Return the memory at the beginning of a mission."""
    return Visits(
        np.zeros(groups, dtype=np.int64),
        np.full(groups, PATIENCE, dtype=np.int64),
        np.zeros(groups, dtype=np.int64),
        np.full(groups, -1, dtype=np.int64),
        np.zeros(groups, dtype=np.int64),
        np.zeros(groups, dtype=np.int64),
        np.full(groups, np.inf),
        np.zeros(landmarks, dtype=np.int64),
        np.ones(landmarks, dtype=np.bool_),
    )


@njit(cache=True, nogil=True)
def watch(
    positions: FloatArray,
    groups: IntArray,
    xy: FloatArray,
    depth: FloatArray,
    left: FloatArray,
    unit: float,
    steps_left: int,
    visits: Visits,
) -> None:
    """Take in what one step brought: count it for the groups, end and begin visits.

    Parameters
    ----------
    positions, groups : (n, 3), (n,)
        Of the vehicles; the number of each one's group.
    xy, depth, left : (m, 2), (m,), (m,)
        Of the landmarks, as in :func:`app.exploration.pcao.state.reduced_state`.
    """
    n, m = len(positions), len(xy)
    fresh = np.zeros(len(visits.idle), dtype=np.int64)
    for i in range(m):
        if not visits.open[i] or left[i] > 0.0:
            continue
        visits.open[i] = False
        least, nearest = np.inf, 0
        for v in range(n):
            d2 = (xy[i, 0] - positions[v, 0]) ** 2 + (xy[i, 1] - positions[v, 1]) ** 2
            if d2 < least:
                least, nearest = d2, v
        fresh[groups[nearest]] += 1
    pace = np.count_nonzero(left > 0.0) / max(1, steps_left) / max(1, len(visits.idle))
    for g in range(len(visits.idle)):
        visits.gained[g] += fresh[g]
        visits.idle[g] = 0 if fresh[g] > 0 and fresh[g] >= pace else visits.idle[g] + 1
        if visits.target[g] >= 0:
            _go_on(positions, xy, depth, left, unit, visits, g)
        elif visits.gained[g] >= ENOUGH:
            visits.patience[g] = PATIENCE
        if visits.target[g] < 0 and visits.idle[g] >= visits.patience[g]:
            _begin(positions, groups, xy, depth, left, unit, visits, g)


@njit(cache=True, nogil=True)
def _go_on(
    positions: FloatArray, xy: FloatArray, depth: FloatArray, left: FloatArray, unit: float, visits: Visits, g: int
) -> None:
    """End the visit of group ``g`` when its landmark is known, or when its visitor comes no closer."""
    target = visits.target[g]
    at = positions[visits.visitor[g]]
    away = np.hypot(xy[target, 0] - at[0], xy[target, 1] - at[1])
    # Once it is over the landmark what counts is how far it went down: negative, so that it is closer than before.
    closer = away if away > OVER * unit else -at[2] - 1e6
    if not np.isnan(depth[target]) and away <= OVER * unit:
        closer = abs(at[2] + HEIGHT * unit - depth[target]) - 2e6
    if closer < visits.closest[g] - 0.02 * unit:
        visits.closest[g] = closer
        visits.looks[g] = 0
    else:
        visits.looks[g] += 1
    if left[target] > 0.0 and visits.looks[g] < LOOKS:
        return
    if left[target] > 0.0:
        visits.vain[target] += 1
        visits.idle[g] = visits.patience[g]  # another one at once
    visits.target[g] = -1
    visits.patience[g] = PATIENCE if visits.gained[g] >= ENOUGH else visits.patience[g] // 2


@njit(cache=True, nogil=True)
def _begin(
    positions: FloatArray,
    groups: IntArray,
    xy: FloatArray,
    depth: FloatArray,
    left: FloatArray,
    unit: float,
    visits: Visits,
    g: int,
) -> None:
    """Choose the landmark that is nearest to a vehicle of group ``g`` and that nobody else visits.

    To go down to it is a way as well; a landmark that was never seen is presumed ``BLIND`` units below.
    """
    least = np.inf
    for i in range(len(xy)):
        if left[i] <= 0.0:
            continue
        taken = False
        for other in range(len(visits.target)):
            taken = taken or (other != g and visits.target[other] == i)
        if taken:
            continue
        for v in range(len(positions)):
            if groups[v] != g:
                continue
            flat = np.hypot(xy[i, 0] - positions[v, 0], xy[i, 1] - positions[v, 1])
            down = BLIND * unit if np.isnan(depth[i]) else depth[i] - HEIGHT * unit - positions[v, 2]
            away = np.hypot(flat, down) + AGAIN * unit * visits.vain[i]
            if away < least:
                least = away
                visits.target[g], visits.visitor[g] = i, v
    visits.gained[g] = 0
    visits.looks[g] = 0
    visits.closest[g] = np.inf


@njit(cache=True, nogil=True)
def visiting_depth(at: FloatArray, xy: FloatArray, depth: float, looks: int, step: float, unit: float) -> float:
    """Return how deep a visitor ``at`` (3,) should go next on its way to a landmark (2,) of a depth, NaN unknown."""
    away = np.hypot(xy[0] - at[0], xy[1] - at[1])
    if np.isnan(depth):
        return float(at[2] + (step if away < NEARBY * unit else 0.0))
    if away > NEARBY * unit:
        return float(depth - HEIGHT_ON_THE_WAY * unit)
    return float(depth - max(LEAST_HEIGHT, HEIGHT - LOWER * looks) * unit)


@njit(cache=True, nogil=True)
def visiting_move(
    at: FloatArray, xy: FloatArray, depth: float, looks: int, step: float, unit: float, way: FloatArray
) -> None:
    """Write the straight move of a visitor ``at`` (3,) to a landmark (2,) into ``way`` (3,); at most a step each."""
    x, y = xy[0] - at[0], xy[1] - at[1]
    part = min(1.0, step / max(np.hypot(x, y), 1e-12))
    way[0], way[1] = part * x, part * y
    way[2] = min(step, max(-step, visiting_depth(at, xy, depth, looks, step, unit) - at[2]))
