"""Improves a survey plan (via points per vehicle) by many small random changes, compiled."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.exploration.geometry import enters, leaves, signed_distance
from app.exploration.routes import fly
from app.exploration.survey_value import lower_to_segment, plan_value

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DRAWS = 6
"""Random numbers that one change uses."""


@njit(cache=True, nogil=True)
def _insert(vias: FloatArray, count: int, at: int, x: float, y: float) -> None:
    for k in range(count, at, -1):
        vias[k, 0] = vias[k - 1, 0]
        vias[k, 1] = vias[k - 1, 1]
    vias[at, 0] = x
    vias[at, 1] = y


@njit(cache=True, nogil=True)
def _remove(vias: FloatArray, count: int, at: int) -> None:
    for k in range(at, count - 1):
        vias[k, 0] = vias[k + 1, 0]
        vias[k, 1] = vias[k + 1, 1]


@njit(cache=True, nogil=True)
def _cheapest(
    starts: FloatArray, vias: FloatArray, counts: IntArray, locked: IntArray, x: float, y: float, luck: float
) -> tuple[int, int]:
    """Return the vehicle and place where a via point lengthens a route least; ``luck`` in [0, 1) blurs the choice."""
    best = np.inf
    vehicle = -1
    place = 0
    for j in range(len(starts)):
        if counts[j] >= vias.shape[1]:
            continue
        for k in range(locked[j], counts[j] + 1):
            if k == 0:
                ax, ay = starts[j, 0], starts[j, 1]
            else:
                ax, ay = vias[j, k - 1, 0], vias[j, k - 1, 1]
            extra = np.hypot(x - ax, y - ay)
            if k < counts[j]:
                bx, by = vias[j, k, 0], vias[j, k, 1]
                extra += np.hypot(bx - x, by - y) - np.hypot(bx - ax, by - ay)
            # A reproducible blur per place lets second-best insertions have their turn.
            extra *= 1.0 + 0.5 * ((luck * 7919.0 * (k + 1) + 0.37 * j) % 1.0)
            if extra < best:
                best = extra
                vehicle = j
                place = k
    return vehicle, place


@njit(cache=True, nogil=True)
def _free(
    starts: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    area: FloatArray,
    keep_out: FloatArray,
    zones: IntArray,
    convex: bool,
    margin: float,
) -> bool:
    """Whether all via points keep ``margin`` from the border and no leg leaves the area or enters a zone."""
    for j in range(len(starts)):
        ax, ay = starts[j, 0], starts[j, 1]
        for k in range(counts[j]):
            bx, by = vias[j, k, 0], vias[j, k, 1]
            if signed_distance(area, bx, by) > -margin:
                return False
            if not convex and leaves(area, ax, ay, bx, by, 1e-6):
                return False
            for z in range(len(zones) - 1):
                if enters(keep_out[zones[z] : zones[z + 1]], ax, ay, bx, by, 1e-6):
                    return False
            ax, ay = bx, by
    return True


@njit(cache=True, nogil=True)
def _contributions(
    d2: FloatArray,
    px: FloatArray,
    py: FloatArray,
    weight: FloatArray,
    starts: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    step: float,
    steps: int,
    scale_m: float,
    power: float,
) -> FloatArray:
    """Return the running sum over nodes of what each still adds to U after the plan, (m,)."""
    after = d2.copy()
    vertices = np.empty((steps + 2, 2))
    for j in range(len(starts)):
        n, _ = fly(starts[j, 0], starts[j, 1], vias[j], counts[j], step, steps, vertices)
        for k in range(1, n):
            lower_to_segment(after, px, py, vertices[k - 1, 0], vertices[k - 1, 1], vertices[k, 0], vertices[k, 1])
    total = 0.0
    running = np.empty(len(d2))
    for i in range(len(d2)):
        total += weight[i] * min(1.0, after[i] / (scale_m * scale_m)) ** (0.5 * power)
        running[i] = total
    return running


@njit(cache=True, nogil=True)
def improve(
    d2: FloatArray,
    px: FloatArray,
    py: FloatArray,
    weight: FloatArray,
    starts: FloatArray,
    headings: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    locked: IntArray,
    step: float,
    steps: int,
    scale_m: float,
    power: float,
    turn_penalty: float,
    spread_m: float,
    area: FloatArray,
    keep_out: FloatArray,
    zones: IntArray,
    convex: bool,
    margin: float,
    draws: FloatArray,
) -> tuple[FloatArray, IntArray, float]:
    """Hill-climb: keep every change to the plan that lowers :func:`plan_value`.

    Parameters
    ----------
    vias : (n_vehicles, k, 2)
        The plan to start from; the first ``locked[j]`` via points of a vehicle stay as they are.
    spread_m : float
        Typical size of a shift of a via point.
    area, keep_out, zones, convex, margin
        Where via points and legs may lie.
    draws : (iterations, DRAWS)
        Uniform random numbers in [0, 1), one row per change.

    Returns
    -------
    vias, counts, value
        The improved plan and its value.
    """
    best = vias.copy()
    best_counts = counts.copy()
    value = plan_value(
        d2, px, py, weight, starts, headings, best, best_counts, step, steps, scale_m, power, turn_penalty
    )
    running = _contributions(d2, px, py, weight, starts, best, best_counts, step, steps, scale_m, power)
    n = len(starts)
    plan = best.copy()
    plan_counts = best_counts.copy()
    for it in range(len(draws)):
        r = draws[it]
        plan[:] = best
        plan_counts[:] = best_counts
        j = int(r[1] * n)
        movable = plan_counts[j] - locked[j]
        kind = r[0]
        changed = False
        if kind < 0.55 and kind >= 0.3 and movable > 0:  # take one out, to make room for another
            k = locked[j] + int(r[2] * movable)
            _remove(plan[j], plan_counts[j], k)
            plan_counts[j] -= 1
            changed = True
        if kind < 0.5:  # insert where much uncertainty is left
            i = np.searchsorted(running, r[3] * running[-1])
            i = min(i, len(running) - 1)
            x = px[i] + (r[4] - 0.5) * spread_m
            y = py[i] + (r[5] - 0.5) * spread_m
            v, k = _cheapest(starts, plan, plan_counts, locked, x, y, r[2])
            if v >= 0:
                _insert(plan[v], plan_counts[v], k, x, y)
                plan_counts[v] += 1
                changed = True
        elif kind < 0.55:
            pass
        elif kind < 0.75 and movable > 0:  # shift one
            k = locked[j] + int(r[2] * movable)
            plan[j, k, 0] += (r[3] + r[4] - 1.0) * 2.0 * spread_m
            plan[j, k, 1] += (r[5] + r[4] - 1.0) * 2.0 * spread_m
            changed = True
        elif kind < 0.85 and movable > 1:  # reverse a section
            a = locked[j] + int(r[2] * movable)
            b = locked[j] + int(r[3] * movable)
            if a > b:
                a, b = b, a
            while a < b:
                for q in range(2):
                    plan[j, a, q], plan[j, b, q] = plan[j, b, q], plan[j, a, q]
                a += 1
                b -= 1
            changed = True
        elif kind < 0.95 and movable > 0:  # move a via point to another place in the order, or to another vehicle
            k = locked[j] + int(r[2] * movable)
            x, y = plan[j, k, 0], plan[j, k, 1]
            _remove(plan[j], plan_counts[j], k)
            plan_counts[j] -= 1
            v, k = _cheapest(starts, plan, plan_counts, locked, x, y, r[3])
            if v >= 0:
                _insert(plan[v], plan_counts[v], k, x, y)
                plan_counts[v] += 1
                changed = True
        elif movable > 1:  # leave out a section
            k = locked[j] + int(r[2] * movable)
            for _ in range(1 + int(r[3] * 4)):
                if k < plan_counts[j]:
                    _remove(plan[j], plan_counts[j], k)
                    plan_counts[j] -= 1
            changed = True
        if not changed or not _free(starts, plan, plan_counts, area, keep_out, zones, convex, margin):
            continue
        trial = plan_value(
            d2, px, py, weight, starts, headings, plan, plan_counts, step, steps, scale_m, power, turn_penalty
        )
        if trial < value - 1e-12:
            value = trial
            best[:] = plan
            best_counts[:] = plan_counts
            running = _contributions(d2, px, py, weight, starts, best, best_counts, step, steps, scale_m, power)
    return best, best_counts, value
