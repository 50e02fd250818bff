"""Routes: polylines that a vehicle follows in straight legs of at most one step, with the turns between them."""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray
from app.exploration.core.problem import Situation

CORNER_TOLERANCE = 0.15
"""A corner may be cut when the leg passes it within this fraction of a step, ..."""
CORNER_MOST_M = 2.0
"""... and within so many metres: where a step is as long as a line, lines side by side would become a zigzag."""
SAME_CORNER = 0.03
"""Vertices that are no farther apart than this fraction of a step are one corner."""
SAME_M = 1e-3
"""Places no farther apart are the same."""
SWING = 3.94
"""Radii per radian by which two turns to the same side, taken as one, exceed a right angle: right for a reversal."""
SHARP_RAD = 0.5
"""A turn by less than this is no corner: the legs before and after it are as long as they may be."""


@njit(cache=True, nogil=True)
def next_waypoint(
    x: float, y: float, route: FloatArray, first: int, count: int, step: float, cut: float
) -> tuple[float, float, int]:
    """Return the end of the next leg along a route and the index of the first vertex still to be reached.

    Parameters
    ----------
    x, y : float
        Where the leg starts.
    route : (m, 2)
        Vertices; those from ``first`` to ``count`` (exclusive) are still to be reached.
    step : float
        Largest length of the leg.
    cut : float
        A vertex may be left aside by this fraction of a step, at most by ``CORNER_MOST_M``, and with it others that
        belong to the same corner.
    """
    i = first
    while i < count and np.hypot(route[i, 0] - x, route[i, 1] - y) < 1e-9:
        i += 1
    if i >= count:
        return x, y, count
    dx = route[i, 0] - x
    dy = route[i, 1] - y
    d = np.hypot(dx, dy)
    if d >= step:
        f = step / d
        reached = 1 if d - step < 1e-9 else 0
        return x + f * dx, y + f * dy, i + reached
    # The vertex lies within the step: cut the corner when the leg still passes close to it.
    to_x, to_y, ahead, close_m = route[i, 0], route[i, 1], i + 1, min(cut * step, CORNER_MOST_M)
    for j in range(i, count - 1):
        if np.hypot(route[j, 0] - route[i, 0], route[j, 1] - route[i, 1]) > min(cut, SAME_CORNER) * step:
            break
        px, py = route[j, 0] - x, route[j, 1] - y
        ex, ey = route[j + 1, 0] - route[j, 0], route[j + 1, 1] - route[j, 1]
        a, b, c = ex * ex + ey * ey, px * ex + py * ey, px * px + py * py - step * step
        t = 1.0
        if a > 0.0:
            t = min(1.0, (-b + np.sqrt(max(0.0, b * b - a * c))) / a)
        tx, ty = px + t * ex, py + t * ey
        length = np.hypot(tx, ty)
        if length <= 1e-9:
            break
        close = True
        for k in range(i, j + 1):
            kx, ky = route[k, 0] - x, route[k, 1] - y
            along = (kx * tx + ky * ty) / length
            if not -1e-12 <= along <= length + 1e-12 or abs(kx * ty - ky * tx) / length > close_m + 1e-12:
                close = False
                break
        if not close:
            break
        to_x, to_y, ahead = x + tx, y + ty, j + 2 if t >= 1.0 else j + 1
        if t < 1.0:
            break
    return to_x, to_y, ahead


def follows(start: FloatArray, ends: FloatArray, planned_m: FloatArray) -> BoolArray:
    """Return which legs lie on a planned one: they may end before it does, where they climb over ground, (...).

    Parameters
    ----------
    start, planned_m : (2,) or what broadcasts with ``ends``
        Where the planned leg begins and ends.
    ends : (..., 2)
        Where the legs end; one that ends where it begins follows a planned one only if that does, too.
    """
    way, planned = ends - start, planned_m - start
    length = np.hypot(planned[..., 0], planned[..., 1])
    along = (way * planned).sum(axis=-1)
    aside = np.abs(way[..., 0] * planned[..., 1] - way[..., 1] * planned[..., 0])
    on_line = (aside <= SAME_M * length) & (along > 0.0) & (along <= (length + SAME_M) * length)
    same = np.hypot(ends[..., 0] - planned_m[..., 0], ends[..., 1] - planned_m[..., 1]) <= SAME_M
    return np.asarray(on_line | same)


def vertices_passed(start: FloatArray, end: FloatArray, route: FloatArray, step: float, cut: float) -> int | None:
    """Return how many vertices of a route (m, 2) a leg reaches or leaves behind; None where it does not follow it.

    The leg (2,) may end before the one of :func:`next_waypoint`. What it would have reached it has as good as reached
    when no more than a corner's tolerance is left to fly.
    """
    x, y, reached = next_waypoint(start[0], start[1], route, 0, len(route), step, cut)
    planned_m = np.array([x, y])
    if not follows(start, end, planned_m):
        return None
    planned = planned_m - start
    length = float(np.hypot(*planned))
    if length <= SAME_M:
        return reached
    along = (route[:reached] - start) @ planned / length
    beyond = np.flatnonzero(
        along > float((end - start) @ planned) / length + max(min(cut * step, CORNER_MOST_M), SAME_M)
    )
    return int(beyond[0]) if len(beyond) else reached


class Vehicles(NamedTuple):
    """A team that a plan is made for.

    Attributes
    ----------
    en_m : (n_vehicles, 2)
        Positions now.
    headings_rad : (n_vehicles,)
        Clockwise from north; NaN unknown.
    left_m : (n_vehicles,)
        How far each may fly.
    """

    en_m: FloatArray
    headings_rad: FloatArray
    left_m: FloatArray


class Turns(NamedTuple):
    """What turns cost: the radius of the tightest circle, and the metres that are lost at every corner besides."""

    radius_m: float
    corner_m: float


@njit(cache=True, nogil=True)
def turn_m(turn: float, before: float, leg_m: float, turns: Turns) -> float:
    """Return by how many metres a turn at the end of a leg of ``leg_m`` lengthens the way.

    ``turn`` and ``before``, the turn at the leg's start, are signed angles. On an arc a vehicle comes forward along the
    next leg, so that r (a - sin a) is lost. A short leg between two turns to the same side has it swing out, as of a
    Dubins path.
    """
    angle, radius_m = abs(turn), turns.radius_m
    extra = radius_m * (angle - np.sin(angle))
    if turn * before > 0.0 and leg_m < 2.0 * radius_m:
        joined = min(angle + abs(before) * (1.0 - leg_m / (2.0 * radius_m)), np.pi)
        extra += SWING * radius_m * max(0.0, joined - max(angle, 0.5 * np.pi))
    return float(extra + turns.corner_m if angle > SHARP_RAD else extra)


class Underway(NamedTuple):
    """A vehicle on its route: where it is, its course (mathematical, NaN unknown), and how far it has flown.

    ``turn`` is the turn at the start of its last leg, ``leg_m`` the length of that.
    """

    x: float
    y: float
    course: float
    turn: float
    leg_m: float
    flown_m: float


@njit(cache=True, nogil=True)
def set_out(x: float, y: float, heading: float) -> Underway:
    """Return a vehicle that begins its route at (x, y); NaN heading: unknown."""
    return Underway(x, y, 0.5 * np.pi - heading, 0.0, np.inf, 0.0)


@njit(cache=True, nogil=True)
def after_leg(at: Underway, to_x: float, to_y: float, most_m: float, turns: Turns) -> tuple[Underway, float]:
    """Return a vehicle after its next leg, and which part of that it flies before it has flown ``most_m`` in all."""
    dx = to_x - at.x
    dy = to_y - at.y
    d = np.hypot(dx, dy)
    if d < 1e-6:
        return at, 0.0
    course, turn, flown = np.arctan2(dy, dx), at.turn, at.flown_m
    if not np.isnan(at.course):
        turn = (course - at.course + np.pi) % (2.0 * np.pi) - np.pi
        flown += turn_m(turn, at.turn, at.leg_m, turns)
    part = max(0.0, min(1.0, (most_m - flown) / d))
    return Underway(to_x, to_y, course, turn, d, min(flown + d, most_m)), part


@njit(cache=True, nogil=True)
def flown_m(x: float, y: float, heading: float, route: FloatArray, turns: Turns) -> float:
    """Return how far a vehicle flies from (x, y) along a route (k, 2), turns included; NaN heading: unknown."""
    at = set_out(x, y, heading)
    for k in range(len(route)):
        at, _ = after_leg(at, route[k, 0], route[k, 1], np.inf, turns)
    return at.flown_m


def metres_left(team: Situation) -> FloatArray:
    """Return how far each vehicle may still fly, (n_vehicles,)."""
    if team.left_m is not None:
        return np.maximum(0.0, team.left_m)
    steps = max(1, team.steps_total - team.step + 1)
    return np.full(len(team.vehicles), steps * team.constraints.max_step_m)


def warm_up() -> None:
    """Compile what follows routes, or load it from the cache of an earlier start."""
    route = np.array([[0.0, 1.0]])
    next_waypoint(0.0, 0.0, route, 0, 1, 1.0, 0.0)
    flown_m(0.0, 0.0, 0.0, route, Turns(0.0, 0.0))
