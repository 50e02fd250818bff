"""Improves a survey plan (via points per vehicle) by many small random changes, compiled."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.constraints import Constraints, Region
from app.exploration.core.copies import copy_row, copy_rows
from app.exploration.core.geometry import enters, leaves, signed_distance
from app.exploration.core.routes import Turns, Underway, Vehicles, set_out
from app.exploration.survey.value import SurveyObjective, UncertaintyNodes, expected_error, lower_to_leg, make_nodes

DRAWS = 6
"""Random numbers that one change uses."""

REPLACE = 0.3
INSERT = 0.5
TAKE_OUT = 0.55
SHIFT = 0.75
REVERSE = 0.85
RELOCATE = 0.95
"""Shares of the changes, added up: between 0.3 and 0.5 a via point is taken out and another one inserted. The rest
leaves out a section."""


class ViaPoints(NamedTuple):
    """Via points of every vehicle.

    Attributes
    ----------
    vias : (n_vehicles, k, 2)
        With room for more.
    counts : (n_vehicles,)
        How many of them count.
    locked : (n_vehicles,)
        How many of these stay as they are.
    """

    vias: FloatArray
    counts: IntArray
    locked: IntArray


class PlanSearch(NamedTuple):
    """How plans are changed.

    Attributes
    ----------
    spread_m : float
        Typical size of a shift of a via point.
    region : Region
        Where via points and legs may lie.
    margin_m : float
        How far inside its border via points lie.
    heat : float
        Part by which a change may worsen the plan at first.
    """

    spread_m: float
    region: Region
    margin_m: float
    heat: float


@njit(cache=True, nogil=True)
def _insert(plan: ViaPoints, starts: FloatArray, x: float, y: float, luck: float, changed: BoolArray) -> None:
    """Insert a via point where it lengthens a route least."""
    v, at = _cheapest(plan, starts, x, y, luck)
    if v < 0:
        return
    vias = plan.vias[v]
    for k in range(plan.counts[v], at, -1):
        vias[k, 0] = vias[k - 1, 0]
        vias[k, 1] = vias[k - 1, 1]
    vias[at, 0] = x
    vias[at, 1] = y
    plan.counts[v] += 1
    changed[v] = True


@njit(cache=True, nogil=True)
def _remove(plan: ViaPoints, j: int, at: int, changed: BoolArray) -> None:
    vias = plan.vias[j]
    for k in range(at, plan.counts[j] - 1):
        vias[k, 0] = vias[k + 1, 0]
        vias[k, 1] = vias[k + 1, 1]
    plan.counts[j] -= 1
    changed[j] = True


@njit(cache=True, nogil=True)
def _cheapest(plan: ViaPoints, starts: FloatArray, x: float, y: float, luck: float) -> tuple[int, int]:
    """Return the vehicle and place where a via point lengthens a route least; ``luck`` in [0, 1) blurs the choice."""
    vias = plan.vias
    best = np.inf
    vehicle = -1
    place = 0
    for j in range(len(starts)):
        if plan.counts[j] >= vias.shape[1]:
            continue
        for k in range(plan.locked[j], plan.counts[j] + 1):
            if k == 0:
                ax, ay = starts[j, 0], starts[j, 1]
            else:
                ax, ay = vias[j, k - 1, 0], vias[j, k - 1, 1]
            extra = np.hypot(x - ax, y - ay)
            if k < plan.counts[j]:
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
def _reverse(vias: FloatArray, a: int, b: int) -> None:
    """Reverse the section between two via points."""
    if a > b:
        a, b = b, a
    while a < b:
        for q in range(2):
            vias[a, q], vias[b, q] = vias[b, q], vias[a, q]
        a += 1
        b -= 1


@njit(cache=True, nogil=True)
def _change(
    plan: ViaPoints,
    starts: FloatArray,
    nodes: UncertaintyNodes,
    running: FloatArray,
    spread: float,
    r: FloatArray,
    changed: BoolArray,
) -> None:
    """Change a plan as the random numbers ``r`` (DRAWS,) say; ``running`` is what :func:`_left` returned."""
    kind = r[0]
    j = int(r[1] * len(starts))
    vias, locked = plan.vias[j], plan.locked[j]
    movable = plan.counts[j] - locked
    if REPLACE <= kind < TAKE_OUT and movable > 0:
        _remove(plan, j, locked + int(r[2] * movable), changed)
    if kind < INSERT:  # where much uncertainty is left
        i = min(np.searchsorted(running, r[3] * running[-1]), len(running) - 1)
        x = nodes.x[i] + (r[4] - 0.5) * spread
        y = nodes.y[i] + (r[5] - 0.5) * spread
        _insert(plan, starts, x, y, r[2], changed)
    elif kind < TAKE_OUT:
        pass
    elif kind < SHIFT and movable > 0:
        k = locked + int(r[2] * movable)
        vias[k, 0] += (r[3] + r[4] - 1.0) * 2.0 * spread
        vias[k, 1] += (r[5] + r[4] - 1.0) * 2.0 * spread
        changed[j] = True
    elif kind < REVERSE and movable > 1:
        _reverse(vias, locked + int(r[2] * movable), locked + int(r[3] * movable))
        changed[j] = True
    elif kind < RELOCATE and movable > 0:  # to another place in the order, or to another vehicle
        k = locked + int(r[2] * movable)
        x, y = vias[k, 0], vias[k, 1]
        _remove(plan, j, k, changed)
        _insert(plan, starts, x, y, r[3], changed)
    elif movable > 1:  # leave out a section
        k = locked + int(r[2] * movable)
        for _ in range(1 + int(r[3] * 4)):
            if k < plan.counts[j]:
                _remove(plan, j, k, changed)
        changed[j] = True


@njit(cache=True, nogil=True)
def _free(start: FloatArray, route: FloatArray, count: int, region: Region, margin: float) -> bool:
    """Whether all via points keep ``margin`` from the border and no leg leaves the area or enters a zone."""
    ax, ay = start[0], start[1]
    for k in range(count):
        bx, by = route[k, 0], route[k, 1]
        if signed_distance(region.area, bx, by) > -margin:
            return False
        if not region.area_is_convex and leaves(region.area, ax, ay, bx, by, 1e-6):
            return False
        for z in range(len(region.starts) - 1):
            if enters(region.keep_out[region.starts[z] : region.starts[z + 1]], ax, ay, bx, by, 1e-6):
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


class Flights(NamedTuple):
    """How every vehicle flies its route, leg by leg: a change is only flown from where it begins.

    Attributes
    ----------
    d2 : (n_vehicles, k + 1, m)
        Squared distances of the nodes to the first 0, 1, ... legs.
    at : (n_vehicles, k + 1, 6)
        The vehicle after them, as :class:`~app.exploration.core.routes.Underway`.
    """

    d2: FloatArray
    at: FloatArray


@njit(cache=True, nogil=True)
def _under_way(at: FloatArray) -> Underway:
    return Underway(at[0], at[1], at[2], at[3], at[4], at[5])


@njit(cache=True, nogil=True)
def _fly(
    flights: Flights,
    v: int,
    first: int,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    left_m: float,
    plan: ViaPoints,
) -> None:
    """Fly a vehicle's route anew from its leg ``first`` on."""
    for k in range(first, plan.counts[v]):
        copy_row(flights.d2[v, k + 1], flights.d2[v, k])
        at = _under_way(flights.at[v, k])
        after = lower_to_leg(flights.d2[v, k + 1], nodes, objective, at, plan.vias[v, k, 0], plan.vias[v, k, 1], left_m)
        for i, value in enumerate(after):
            flights.at[v, k + 1, i] = value


@njit(cache=True, nogil=True)
def _try(
    d2: FloatArray,
    flights: Flights,
    v: int,
    first: int,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    left_m: float,
    plan: ViaPoints,
) -> None:
    """Set ``d2`` (m,) to what it is after a vehicle's route, which is as it was up to its leg ``first``."""
    copy_row(d2, flights.d2[v, first])
    at = _under_way(flights.at[v, first])
    for k in range(first, plan.counts[v]):
        if at.flown_m >= left_m:
            break
        at = lower_to_leg(d2, nodes, objective, at, plan.vias[v, k, 0], plan.vias[v, k, 1], left_m)


@njit(cache=True, nogil=True)
def _first_changed(vias: FloatArray, count: int, before: FloatArray, count_before: int) -> int:
    """Return the first via point in which two routes differ."""
    for k in range(min(count, count_before)):
        if vias[k, 0] != before[k, 0] or vias[k, 1] != before[k, 1]:
            return k
    return min(count, count_before)


@njit(cache=True, nogil=True)
def improve(
    d2: FloatArray,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    vehicles: Vehicles,
    begin: ViaPoints,
    search: PlanSearch,
    draws: FloatArray,
) -> tuple[FloatArray, IntArray, float]:
    """Change the plan at random, keeping changes that lower :func:`~app.exploration.survey.value.plan_value`.

    At first changes that worsen it by up to the part ``heat`` are kept too, so that the plan gets out of dead ends;
    what is tolerated falls to nothing. The best plan met is returned. The first four arguments are as there.

    Parameters
    ----------
    begin
        The plan to start from.
    draws : (iterations, DRAWS)
        Uniform random numbers in [0, 1), one row per change.

    Returns
    -------
    vias, counts, value
        The improved plan and its value.
    """
    starts, headings, left_m = vehicles
    n, m = len(starts), len(d2)
    scale, power, weight = objective.scale_m, objective.power, nodes.weight
    current, current_counts = begin.vias.copy(), begin.counts.copy()
    plan = ViaPoints(begin.vias.copy(), begin.counts.copy(), begin.locked)
    after = np.full((n, m), np.inf)
    rows = plan.vias.shape[1] + 1
    flights = Flights(np.full((n, rows, m), np.inf), np.zeros((n, rows, 6)))
    for v in range(n):
        for i, number in enumerate(set_out(starts[v, 0], starts[v, 1], headings[v])):
            flights.at[v, 0, i] = number
        _fly(flights, v, 0, nodes, objective, left_m[v], plan)
        copy_row(after[v], flights.d2[v, plan.counts[v]])
    running = _left(d2, after, weight, scale, power)
    value = running[-1]
    best, best_counts, best_value = current.copy(), current_counts.copy(), value
    trial = after.copy()
    changed = np.zeros(n, np.bool_)
    first = np.zeros(n, np.int64)
    for it in range(len(draws)):
        changed[:] = False
        _change(plan, starts, nodes, running, search.spread_m, draws[it], changed)
        keep = bool(changed.any())
        for v in range(n):
            if changed[v] and not _free(starts[v], plan.vias[v], plan.counts[v], search.region, search.margin_m):
                keep = False
        if keep:
            for v in range(n):
                if changed[v]:
                    first[v] = _first_changed(plan.vias[v], plan.counts[v], current[v], current_counts[v])
                    _try(trial[v], flights, v, first[v], nodes, objective, left_m[v], plan)
            left = _left(d2, trial, weight, scale, power)
            new = left[-1]
            keep = new < value * (1.0 + search.heat * (1.0 - (it + 1.0) / len(draws)) ** 2) - 1e-12
            if keep:
                value = new
                running = left
                if value < best_value:
                    best_value = value
                    for v in range(n):
                        copy_rows(best[v], plan.vias[v])
                        best_counts[v] = plan.counts[v]
        for v in range(n):
            if changed[v] and keep:
                copy_rows(current[v], plan.vias[v])
                current_counts[v] = plan.counts[v]
                copy_row(after[v], trial[v])
                _fly(flights, v, first[v], nodes, objective, left_m[v], plan)
            elif changed[v]:
                copy_rows(plan.vias[v], current[v])
                plan.counts[v] = current_counts[v]
                copy_row(trial[v], after[v])
    return best, best_counts, best_value


@cache
def warm_up() -> None:
    """Compile what improves plans, or load it from the cache of an earlier start; once in a process is enough."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places, one, none = np.full((1, 2), 0.5), np.ones(1), np.zeros(1, dtype=np.int64)
    plan = ViaPoints(np.zeros((1, 1, 2)), none, none)
    search = PlanSearch(1.0, Constraints(square).region, 0.0, 0.0)
    objective = SurveyObjective(1.0, 2.0, Turns(0.0, 0.0), 1.0)
    improve(one, make_nodes(places, one), objective, Vehicles(places, one, one), plan, search, np.zeros((1, DRAWS)))
