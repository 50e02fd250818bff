"""Vehicles that need no links fly each its own route; what they see together is one matter.

A team in a row (:mod:`app.exploration.rollout.flight`) goes only as fast as its slowest member, and is one place from
which moving targets are ranged. Routes are flown one by one, each as the plan of a team of one, and judged together.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.exploration.rollout.allowed_raster import AllowedRaster, clear_ways, settle_waypoint
from app.exploration.rollout.flight import PER_WAYPOINT, STEEP, Plan, Rules, advance
from app.exploration.rollout.floor import FloorEstimate, sample
from app.exploration.rollout.local_search import change
from app.exploration.rollout.points import LandmarkPoints, lacks, look_whole

ALL_LEFT = 10_000.0
"""Steps charged for leaving every landmark over: one of a thousand is worth a way of ten steps."""

EARLY = 10.0
"""What the sum over time of the part that remains counts, against a step more in the end: more than
:data:`.flight.WORTH_OF_EARLY`, which routes of a whole team are judged by.

Routes over what takes many looks fill the time that is left. With less than that they put off what they could do now,
and then errands come between.
"""

HALVINGS = 6
"""Times that the reach of a step is narrowed down between what is too far for its climb and what is not."""


class Routes(NamedTuple):
    """A route for each vehicle, with room for more waypoints than it has.

    Attributes
    ----------
    at_m : (n_vehicles, room, 1, 2)
        Waypoints, east and north.
    height_m : (n_vehicles, room)
        Height above the floor on the way to each.
    sinking : (n_vehicles, room)
        Part of a step by which the vehicle may sink on the way to each, at the cost of its way ahead.
    counts : (n_vehicles,)
        How many there are.
    """

    at_m: FloatArray
    height_m: FloatArray
    sinking: FloatArray
    counts: IntArray


def no_routes(vehicles: int, room: int, height_m: float) -> Routes:
    """Return empty routes to be flown ``height_m`` above the floor."""
    return Routes(
        np.zeros((vehicles, room, 1, 2)), np.full((vehicles, room), height_m), np.full((vehicles, room), STEEP),
        np.zeros(vehicles, dtype=np.int64),
    )  # fmt: skip


def stops_of(routes: Routes, i: int) -> FloatArray:
    """Return a vehicle's waypoints and how quickly it sinks on the way to each, (k, 3)."""
    count = routes.counts[i]
    return np.column_stack([routes.at_m[i, :count, 0], routes.sinking[i, :count]])


@njit(cache=True, nogil=True)
def route_of(routes: Routes, i: int) -> Plan:
    """Return a view of one vehicle's route as the plan of a team of one."""
    return Plan(routes.at_m[i], routes.height_m[i], routes.sinking[i], np.zeros(1, dtype=np.int64))


@njit(cache=True, nogil=True)
def fly_alone(
    at: FloatArray, plan: Plan, k: int, count: int, floor: FloorEstimate, rules: Rules, out: FloatArray
) -> int:
    """Fly one vehicle's step from ``at`` (1, 3) into ``out``; return the index of the next waypoint to be reached.

    It goes as far along its route as its climb or descent leaves of the step.
    """
    step = rules.step_m * (1.0 - 1e-9)
    there = np.empty((1, 2))
    enough, too_far, reach = 0.0, step, step
    sinking = plan.sinking[min(k, count - 1)]
    here = at[:, :2]
    after = k
    for halving in range(HALVINGS + 2):
        after = advance(here, plan, k, count, reach, rules.cut_corners, there)
        x, y = there[0, 0], there[0, 1]
        wish = sample(floor.smooth_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        wish -= plan.height_m[min(k, count - 1)]
        limit = sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        # Sinking may wait, with what the way ahead leaves of the step, or as the route says.
        spare = np.sqrt(max(0.0, step * step - (x - at[0, 0]) ** 2 - (y - at[0, 1]) ** 2))
        lowest = at[0, 2] + max(spare, sinking * step)
        z = min(max(rules.min_depth_m, min(rules.max_depth_m, wish, limit)), lowest)
        out[0, 0], out[0, 1], out[0, 2] = x, y, z
        fits = (x - at[0, 0]) ** 2 + (y - at[0, 1]) ** 2 + (z - at[0, 2]) ** 2 <= step * step
        if fits:
            enough = reach
            if halving == 0 or halving > HALVINGS:
                break
        else:
            too_far = reach
        reach = enough if halving == HALVINGS else 0.5 * (enough + too_far)
    out[0, 2] = min(max(out[0, 2], at[0, 2] - step), at[0, 2] + step)
    return after


class Paths(NamedTuple):
    """Where vehicles come to be step by step on their routes.

    Attributes
    ----------
    at_m : (n_vehicles, horizon, 3)
        After each step; meaningless beyond its end.
    length : (n_vehicles,)
        How many steps each takes to the end of its route, at most ``horizon``.
    """

    at_m: FloatArray
    length: IntArray


def no_paths(vehicles: int, horizon: int) -> Paths:
    """Return paths that lead nowhere, with room for ``horizon`` steps."""
    return Paths(np.zeros((vehicles, horizon, 3)), np.zeros(vehicles, dtype=np.int64))


@njit(cache=True, nogil=True)
def trace(start: FloatArray, i: int, routes: Routes, floor: FloorEstimate, rules: Rules, paths: Paths) -> None:
    """Fly the route of vehicle ``i`` from its place in ``start`` (n_vehicles, 3), into its row of ``paths``."""
    at, after = start[i : i + 1].copy(), np.empty((1, 3))
    plan, count, k, t = route_of(routes, i), routes.counts[i], 0, 0
    while k < count and t < paths.at_m.shape[1]:
        k = fly_alone(at, plan, k, count, floor, rules, after)
        at[:] = after
        paths.at_m[i, t] = after[0]
        t += 1
    paths.length[i] = t


@njit(cache=True, nogil=True)
def judge(
    paths: Paths,
    free_part: FloatArray,
    waypoints: int,
    points: LandmarkPoints,
    rules: Rules,
    bound: float,
    left: FloatArray,
) -> float:
    """Return the score of a team's paths in steps; less is better, inf as soon as it cannot be better than ``bound``.

    Parameters
    ----------
    free_part : (n_vehicles,)
        Of its time, what each is expected to have for its route; errands take the rest.
    waypoints : int
        How many the routes have together.
    left : (m,)
        Overwritten: what each landmark lacks in the end, 0 to 1.
    """
    n, size = len(free_part), points.information.shape[1]
    information = points.information.copy()
    done = np.zeros(size, dtype=np.bool_)
    flown = np.zeros(n, dtype=np.int64)
    credit = np.zeros(n)
    open_, t, cost = float(size), 0.0, PER_WAYPOINT * waypoints
    flying = True
    while flying and open_ > 0.0 and t < paths.at_m.shape[1]:
        flying = False
        for i in range(n):
            if flown[i] >= paths.length[i]:
                continue
            flying = True
            credit[i] += free_part[i]
            if credit[i] < 1.0:
                continue
            credit[i] -= 1.0
            x, y, z = paths.at_m[i, flown[i]]
            flown[i] += 1
            open_ -= look_whole(x, y, z, points, rules.visibility_m, rules.relative_noise, information, done)
        if flying:
            t += 1.0
            cost += EARLY * open_ / points.work.total
            if t + cost >= bound:
                return np.inf
    missing = 0.0
    for m in range(size):
        left[m] = 0.0 if done[m] else lacks(information, m, points.variance_m2)
        missing += left[m]
    return float(t + cost + ALL_LEFT * 0.5 * (open_ + missing) / points.work.total)


class RoutesFlown(NamedTuple):
    """Routes with their paths and what these leave of each landmark, (m,)."""

    routes: Routes
    paths: Paths
    left: FloatArray


class RoutesTask(NamedTuple):
    """What routes are judged by.

    Attributes
    ----------
    start : (n_vehicles, 3)
        Where the vehicles are.
    free_part : (n_vehicles,)
        Of its time, what each is expected to have for its route.
    """

    start: FloatArray
    free_part: FloatArray
    points: LandmarkPoints
    floor: FloorEstimate
    rules: Rules


@njit(cache=True, nogil=True)
def improve_apart(
    best: RoutesFlown,
    score: float,
    trial: RoutesFlown,
    draws: FloatArray,
    task: RoutesTask,
    free: AllowedRaster,
    worth: float,
) -> float:
    """Try a change to one vehicle's route per row of ``draws`` and keep those that better the score by ``worth``.

    ``best`` is kept up to date, ``trial`` is scratch; the first number of a row chooses the vehicle. Returns the score.
    """
    start, points, rules = task.start, task.points, task.rules
    n = len(start)
    for i in range(n):
        _copy(best, trial, i)
    for d in range(len(draws)):
        i = int(draws[d, 0] * n)
        plan = route_of(trial.routes, i)
        here = start[i : i + 1, :2].copy()
        changed, first, last = change(plan, best.routes.counts[i], here, points.work, rules, best.left, draws[d, 1:])
        ok = first >= 0
        for k in range(first, min(last, changed - 1) + 1):
            ok = ok and settle_waypoint(free, plan.at_m[k], plan.chain, np.inf)
        changed = clear_ways(free, plan, changed, here, first, last + 1, np.inf) if ok else -1
        if changed >= 0:
            trial.routes.counts[i] = changed
            trace(start, i, trial.routes, task.floor, rules, trial.paths)
            waypoints = trial.routes.counts.sum()
            value = judge(trial.paths, task.free_part, waypoints, points, rules, score - worth, trial.left)
            if value < score - worth:
                score = value
                best.left[:] = trial.left
                _copy(trial, best, i)
                continue
        _copy(best, trial, i)
    return score


@njit(cache=True, nogil=True)
def _copy(source: RoutesFlown, target: RoutesFlown, i: int) -> None:
    """Copy a vehicle's route and path."""
    target.routes.at_m[i] = source.routes.at_m[i]
    target.routes.height_m[i] = source.routes.height_m[i]
    target.routes.sinking[i] = source.routes.sinking[i]
    target.routes.counts[i] = source.routes.counts[i]
    length = source.paths.length[i]
    target.paths.at_m[i, :length] = source.paths.at_m[i, :length]
    target.paths.length[i] = length
