"""Improves a survey plan (via points per vehicle) by many small random changes, compiled."""

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.exploration.core.geometry import enters, leaves, signed_distance
from app.exploration.survey.value import Nodes, Objective, expected_error, lower_to_route

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
    start: FloatArray,
    route: FloatArray,
    count: int,
    area: FloatArray,
    keep_out: FloatArray,
    zones: IntArray,
    convex: bool,
    margin: float,
) -> bool:
    """Whether all via points keep ``margin`` from the border and no leg leaves the area or enters a zone."""
    ax, ay = start[0], start[1]
    for k in range(count):
        bx, by = route[k, 0], route[k, 1]
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
def _left(d2: FloatArray, after: FloatArray, weight: FloatArray, scale_m: float, power: float) -> FloatArray:
    """Return the running sum over nodes of what each still adds to U after the plan, (m,).

    ``d2`` (m,) are squared distances to soundings, ``after`` (n_vehicles, m) to the vehicles' routes.
    """
    total = 0.0
    running = np.empty(len(d2))
    inverse2 = 1.0 / (scale_m * scale_m)
    for i in range(len(d2)):
        least = d2[i]
        for j in range(len(after)):
            least = min(least, after[j, i])
        total += expected_error(least, weight[i], inverse2, power)
        running[i] = total
    return running


@njit(cache=True, nogil=True)
def improve(
    d2: FloatArray,
    nodes: Nodes,
    objective: Objective,
    starts: FloatArray,
    headings: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    locked: IntArray,
    spread_m: float,
    area: FloatArray,
    keep_out: FloatArray,
    zones: IntArray,
    convex: bool,
    margin: float,
    heat: float,
    draws: FloatArray,
) -> tuple[FloatArray, IntArray, float]:
    """Change the plan at random, keeping changes that lower :func:`~app.exploration.survey.value.plan_value`.

    At first changes that worsen it by up to the part ``heat`` are kept too, so that the plan gets out of dead ends;
    what is tolerated falls to nothing. The best plan met is returned.

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
    n, m = len(starts), len(d2)
    scale, power, weight = objective.scale_m, objective.power, nodes.weight
    vertices = np.empty((objective.steps + 2, 2))
    current, current_counts = vias.copy(), counts.copy()
    after = np.full((n, m), np.inf)
    turns = np.zeros(n)
    for j in range(n):
        turns[j] = lower_to_route(
            after[j], nodes, objective, starts[j, 0], starts[j, 1], headings[j], current[j], counts[j], vertices
        )
    running = _left(d2, after, weight, scale, power)
    value = running[-1] * (1.0 + objective.turn_penalty * turns.sum())
    best, best_counts, best_value = current.copy(), current_counts.copy(), value
    plan, plan_counts = current.copy(), current_counts.copy()
    trial, trial_turns = after.copy(), turns.copy()
    changed = np.zeros(n, np.bool_)
    for it in range(len(draws)):
        r = draws[it]
        changed[:] = False
        j = int(r[1] * n)
        movable = plan_counts[j] - locked[j]
        kind = r[0]
        if kind < 0.55 and kind >= 0.3 and movable > 0:  # take one out, to make room for another
            k = locked[j] + int(r[2] * movable)
            _remove(plan[j], plan_counts[j], k)
            plan_counts[j] -= 1
            changed[j] = True
        if kind < 0.5:  # insert where much uncertainty is left
            i = np.searchsorted(running, r[3] * running[-1])
            i = min(i, m - 1)
            x = nodes.x[i] + (r[4] - 0.5) * spread_m
            y = nodes.y[i] + (r[5] - 0.5) * spread_m
            v, k = _cheapest(starts, plan, plan_counts, locked, x, y, r[2])
            if v >= 0:
                _insert(plan[v], plan_counts[v], k, x, y)
                plan_counts[v] += 1
                changed[v] = True
        elif kind < 0.55:
            pass
        elif kind < 0.75 and movable > 0:  # shift one
            k = locked[j] + int(r[2] * movable)
            plan[j, k, 0] += (r[3] + r[4] - 1.0) * 2.0 * spread_m
            plan[j, k, 1] += (r[5] + r[4] - 1.0) * 2.0 * spread_m
            changed[j] = True
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
            changed[j] = True
        elif kind < 0.95 and movable > 0:  # move a via point to another place in the order, or to another vehicle
            k = locked[j] + int(r[2] * movable)
            x, y = plan[j, k, 0], plan[j, k, 1]
            _remove(plan[j], plan_counts[j], k)
            plan_counts[j] -= 1
            changed[j] = True
            v, k = _cheapest(starts, plan, plan_counts, locked, x, y, r[3])
            if v >= 0:
                _insert(plan[v], plan_counts[v], k, x, y)
                plan_counts[v] += 1
                changed[v] = True
        elif movable > 1:  # leave out a section
            k = locked[j] + int(r[2] * movable)
            for _ in range(1 + int(r[3] * 4)):
                if k < plan_counts[j]:
                    _remove(plan[j], plan_counts[j], k)
                    plan_counts[j] -= 1
            changed[j] = True
        keep = bool(changed.any())
        for v in range(n):
            if changed[v] and not _free(starts[v], plan[v], plan_counts[v], area, keep_out, zones, convex, margin):
                keep = False
        if keep:
            total_turns = 0.0
            for v in range(n):
                if changed[v]:
                    trial[v, :] = np.inf
                    trial_turns[v] = lower_to_route(
                        trial[v],
                        nodes,
                        objective,
                        starts[v, 0],
                        starts[v, 1],
                        headings[v],
                        plan[v],
                        plan_counts[v],
                        vertices,
                    )
                total_turns += trial_turns[v]
            left = _left(d2, trial, weight, scale, power)
            new = left[-1] * (1.0 + objective.turn_penalty * total_turns)
            keep = new < value * (1.0 + heat * (1.0 - (it + 1.0) / len(draws)) ** 2) - 1e-12
            if keep:
                value = new
                running = left
                if value < best_value:
                    best_value = value
                    best[:] = plan
                    best_counts[:] = plan_counts
        for v in range(n):
            if changed[v]:
                if keep:
                    current[v] = plan[v]
                    current_counts[v] = plan_counts[v]
                    after[v] = trial[v]
                    turns[v] = trial_turns[v]
                else:
                    plan[v] = current[v]
                    plan_counts[v] = current_counts[v]
                    trial[v] = after[v]
                    trial_turns[v] = turns[v]
    return best, best_counts, best_value
