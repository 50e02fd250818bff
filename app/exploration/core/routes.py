"""Routes: polylines that a vehicle follows in straight legs of at most one step, round keep-out zones."""

from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import nearest_points

from app.arrays import BoolArray, FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Situation

CORNER_TOLERANCE = 0.15
"""A corner may be cut when the leg passes it within this fraction of a step, ..."""
CORNER_MOST_M = 2.0
"""... and within so many metres: where a step is as long as a line, lines side by side would become a zigzag."""
SAME_CORNER = 0.03
"""Vertices that are no farther apart than this fraction of a step are one corner."""
SAME_M = 1e-3
"""Places no farther apart are the same."""
CLEAR_M = 1.0
"""Who is too near to a zone, or to a corner, goes so far beyond where that begins."""
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


def free_region(constraints: Constraints, margin_m: float) -> BaseGeometry:
    """Return the area without its keep-out zones, ``margin_m`` from borders and zones where that leaves anything."""
    whole = Polygon(constraints.area)
    inner = whole.buffer(-margin_m, join_style="mitre") if margin_m > 0 else whole
    area: BaseGeometry = whole if inner.is_empty else inner
    # Sharp corners throughout: a rounded one is a dozen vertices a few centimetres apart.
    for zone in constraints.keep_out:
        area = area.difference(Polygon(zone).buffer(2.0 * margin_m, join_style="mitre"))
    return area


class FreeSpace:
    """The area without its keep-out zones, and shortest ways through it."""

    def __init__(self, constraints: Constraints, margin_m: float) -> None:
        """Keep ``margin_m`` away from borders and zones, where that leaves anything."""
        self.margin_m = margin_m
        self.region = free_region(constraints, margin_m)
        self._loose: BaseGeometry = self.region.buffer(1e-6)
        shapely.prepare(self._loose)
        self._open = not constraints.keep_out and bool(np.isclose(self.region.area, self.region.convex_hull.area))
        self._corners = np.zeros((0, 2)) if self._open else _corners(self.region)
        self._links = self._visibility(self._corners)
        # Between corners ways are found once: only their ends differ.
        self._away_m, self._before = (
            dijkstra(csr_matrix(self._links), return_predecessors=True)
            if len(self._corners)
            else (np.zeros((0, 0)), np.zeros((0, 0), dtype=np.int32))
        )

    @property
    def is_open(self) -> bool:
        """Whether every place of it is seen from every other one."""
        return self._open

    def _sees(self, place: FloatArray, others: FloatArray) -> BoolArray:
        """Return which of ``others`` (n, 2) a straight leg from ``place`` (2,) reaches."""
        if self._open:
            return np.ones(len(others), dtype=np.bool_)
        legs = np.stack([np.broadcast_to(place, others.shape), others], axis=1)
        return np.asarray(shapely.covers(self._loose, shapely.linestrings(legs)), dtype=np.bool_)

    def _visibility(self, corners: FloatArray) -> FloatArray:
        n = len(corners)
        links = np.zeros((n, n))
        for i in range(1, n):
            links[i, :i] = self._links_to(corners[i], corners[:i])
        return links + links.T

    def _links_to(self, place: FloatArray, others: FloatArray) -> FloatArray:
        """Return the distance to each of ``others`` (n, 2), 0 where no straight leg leads there."""
        east, north = (others - place).T
        return np.where(self._sees(place, others), np.maximum(np.hypot(east, north), 1e-9), 0.0)

    def holds(self, en_m: FloatArray) -> bool:
        """Whether a place (2,) lies in the free space."""
        return bool(self._loose.covers(Point(*en_m)))

    def parts(self) -> list[Polygon]:
        """Return the parts of it between which no way leads."""
        return _polygons(self.region)

    def nearest(self, en_m: FloatArray) -> FloatArray:
        """Return the point of the free space closest to ``en_m`` (2,)."""
        point = Point(*en_m)
        if self._loose.covers(point):
            return np.asarray(en_m, dtype=np.float64)
        closest, _ = nearest_points(self.region, point)
        return np.array([closest.x, closest.y])

    def way(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return the vertices (k, 2) of a shortest way, ``goal`` last and ``start`` left out.

        Where no way exists the straight line is returned: the constraints stop a vehicle on it.
        """
        if self._sees(start, np.asarray(goal)[None])[0]:
            return np.asarray(goal, dtype=np.float64)[None]
        return self._round(start, goal)

    def corner(self, start: FloatArray, goal: FloatArray, still_m: float) -> FloatArray:
        """Return the first corner of a shortest way, (2,), that is farther than ``still_m`` from where the way begins.

        Where that one is not seen from where the way begins, inside a zone or a little before a corner, a place
        ``CLEAR_M`` beyond what is nearer: a leg to the next corner would lead along a border, on the wrong side of it.
        The goal, where no corner is farther away.
        """
        way = self.way(start, goal)
        away_m = np.hypot(*(way - start).T)
        far = away_m > still_m
        if far[0] or not far.any():
            return np.asarray(way[0] if far[0] else way[-1])
        onward = way[int(np.argmax(far))]
        if away_m[0] > 0.0 and not self._sees(start, onward[None])[0]:
            clear = start + (1.0 + CLEAR_M / away_m[0]) * (way[0] - start)
            if self.holds(clear):
                return np.asarray(clear)
        return np.asarray(onward)

    def _round(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return such a way where no straight leg leads to the goal."""
        start_inside, goal_inside = self.nearest(start), self.nearest(goal)
        legs = np.stack(
            [np.broadcast_to(self._corners, (2, *self._corners.shape)), np.empty((2, *self._corners.shape))], axis=2
        )
        legs[0, :, 1], legs[1, :, 1] = start_inside, goal_inside
        lengths = np.maximum(np.hypot(*np.moveaxis(legs[:, :, 0] - legs[:, :, 1], -1, 0)), 1e-9)
        sees = np.asarray(shapely.covers(self._loose, shapely.linestrings(legs)), dtype=np.bool_)
        first_m, last_m = np.where(sees, lengths, np.inf)
        by_corners = first_m[:, None] + self._away_m + last_m
        straight_m = np.inf
        if self._sees(start_inside, goal_inside[None])[0]:
            straight_m = float(np.hypot(*(goal_inside - start_inside)))
        first, last = np.unravel_index(int(np.argmin(by_corners)), by_corners.shape) if by_corners.size else (0, 0)
        shortest_m = float(by_corners[first, last]) if by_corners.size else np.inf
        if not np.isfinite(min(straight_m, shortest_m)):
            return np.asarray(goal, dtype=np.float64)[None]
        way = [goal_inside]
        if shortest_m < straight_m:
            node = int(last)
            while node != first:
                way.append(self._corners[node])
                node = int(self._before[first, node])
            way.append(self._corners[first])
        if not np.allclose(start_inside, start):
            way.append(start_inside)
        found = np.array(way[::-1])
        return np.asarray(found if np.allclose(goal_inside, goal) else np.vstack([found, goal]))

    def connect(self, start: FloatArray, stops: FloatArray) -> FloatArray:
        """Return the route (m, 2) from ``start`` (left out) through all ``stops`` (k, 2), round obstacles."""
        if self._open or len(stops) == 0:
            return np.asarray(stops, dtype=np.float64).reshape(-1, 2)
        return np.vstack(self.legs(np.vstack([start, stops])))

    def legs(self, stops: FloatArray) -> list[FloatArray]:
        """Return the routes (m, 2) from each of ``stops`` (k, 2) to the next, without where they begin."""
        if len(stops) < 2:
            return []
        ends = np.asarray(stops[1:], dtype=np.float64)
        if self._open:
            return [stop[None] for stop in ends]
        # All at once: most legs are free, and asking one by one takes far longer.
        both = np.stack([stops[:-1], ends], axis=1)
        free = np.asarray(shapely.covers(self._loose, shapely.linestrings(both)))
        return [
            stop[None] if clear else self._round(a, stop) for a, stop, clear in zip(stops, ends, free, strict=False)
        ]


def _polygons(region: BaseGeometry) -> list[Polygon]:
    return [part for part in getattr(region, "geoms", [region]) if isinstance(part, Polygon)]


def _corners(region: BaseGeometry) -> FloatArray:
    """Return the vertices of all rings of a region, those of its holes included."""
    rings = [np.asarray(ring.coords)[:-1] for part in _polygons(region) for ring in (part.exterior, *part.interiors)]
    return np.vstack(rings) if rings else np.zeros((0, 2))


def warm_up() -> None:
    """Compile what follows routes, or load it from the cache of an earlier start."""
    route = np.array([[0.0, 1.0]])
    next_waypoint(0.0, 0.0, route, 0, 1, 1.0, 0.0)
    flown_m(0.0, 0.0, 0.0, route, Turns(0.0, 0.0))
