"""Routes: polylines that a vehicle follows in straight legs of at most one step, round keep-out zones."""

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

CORNER_TOLERANCE = 0.15
"""A corner may be cut when the leg passes it within this fraction of a step."""
SAME_CORNER = 0.03
"""Vertices that are no farther apart than this fraction of a step are one corner."""


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
        A vertex may be left aside by this fraction of a step, and with it others that belong to the same corner.
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
    to_x, to_y, ahead = route[i, 0], route[i, 1], i + 1
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
            if along > length + 1e-12 or abs(kx * ty - ky * tx) / length > cut * step + 1e-12:
                close = False
                break
        if not close:
            break
        to_x, to_y, ahead = x + tx, y + ty, j + 2 if t >= 1.0 else j + 1
        if t < 1.0:
            break
    return to_x, to_y, ahead


@njit(cache=True, nogil=True)
def fly(
    x: float, y: float, route: FloatArray, count: int, step: float, steps: int, vertices: FloatArray
) -> tuple[int, int]:
    """Follow a route for at most ``steps`` legs.

    Writes the corners of the track into ``vertices`` (at least steps + 1 rows; straight legs merged, start included)
    and returns their number and the steps used.
    """
    vertices[0, 0] = x
    vertices[0, 1] = y
    n = 1
    used = 0
    i = 0
    while used < steps and i < count:
        d = np.hypot(route[i, 0] - x, route[i, 1] - y)
        if d > 3.0 * step:  # far from the next corner all legs are the same: take them at once
            legs = min(int(d / step) - 1, steps - used)
            f = legs * step / d
            nx, ny = x + f * (route[i, 0] - x), y + f * (route[i, 1] - y)
            used += legs
        else:
            nx, ny, i = next_waypoint(x, y, route, i, count, step, CORNER_TOLERANCE)
            if np.hypot(nx - x, ny - y) < 1e-9:
                break
            used += 1
        if n >= 2:
            ux = vertices[n - 1, 0] - vertices[n - 2, 0]
            uy = vertices[n - 1, 1] - vertices[n - 2, 1]
            vx = nx - x
            vy = ny - y
            if abs(ux * vy - uy * vx) < 1e-6 * (abs(ux) + abs(uy)) and ux * vx + uy * vy > 0.0:
                n -= 1
        vertices[n, 0] = nx
        vertices[n, 1] = ny
        n += 1
        x = nx
        y = ny
    return n, used


class FreeSpace:
    """The area without its keep-out zones, and shortest ways through it."""

    def __init__(self, constraints: Constraints, margin_m: float) -> None:
        """Keep ``margin_m`` away from borders and zones, where that leaves anything."""
        whole = Polygon(constraints.area)
        inner = whole.buffer(-margin_m, join_style="mitre") if margin_m > 0 else whole
        # Sharp corners throughout: a rounded one is a dozen vertices a few centimetres apart.
        zones = [Polygon(zone).buffer(2.0 * margin_m, join_style="mitre") for zone in constraints.keep_out]
        area: BaseGeometry = whole if inner.is_empty else inner
        for zone in zones:
            area = area.difference(zone)
        self.region: BaseGeometry = area
        self._loose: BaseGeometry = self.region.buffer(1e-6)
        shapely.prepare(self._loose)
        self._open = not constraints.keep_out and bool(np.isclose(area.area, area.convex_hull.area))
        self._corners = np.zeros((0, 2)) if self._open else _corners(self.region)
        self._links = self._visibility(self._corners)

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
        start_inside, goal_inside = self.nearest(start), self.nearest(goal)
        nodes = np.vstack([self._corners, start_inside, goal_inside])
        n = len(nodes)
        links = np.zeros((n, n))
        links[: n - 2, : n - 2] = self._links
        for k in (n - 2, n - 1):
            links[:k, k] = links[k, :k] = self._links_to(nodes[k], nodes[:k])
        distance, previous = dijkstra(csr_matrix(links), return_predecessors=True)
        if not np.isfinite(distance[n - 2, n - 1]):
            return np.asarray(goal, dtype=np.float64)[None]
        chain = [n - 1]
        while previous[n - 2, chain[-1]] >= 0:
            chain.append(int(previous[n - 2, chain[-1]]))
        way = nodes[chain[::-1]]
        if np.allclose(start_inside, start):
            way = way[1:]
        return np.asarray(way if np.allclose(goal_inside, goal) else np.vstack([way, goal]))

    def connect(self, start: FloatArray, stops: FloatArray) -> FloatArray:
        """Return the route (m, 2) from ``start`` (left out) through all ``stops`` (k, 2), round obstacles."""
        if self._open or len(stops) == 0:
            return np.asarray(stops, dtype=np.float64).reshape(-1, 2)
        pieces, here = [], start
        for stop in stops:
            pieces.append(self.way(here, stop))
            here = stop
        return np.vstack(pieces)


def _corners(region: BaseGeometry) -> FloatArray:
    """Return the vertices of all rings of a region, those of its holes included."""
    parts = [p for p in getattr(region, "geoms", [region]) if isinstance(p, Polygon)]
    rings = [np.asarray(ring.coords)[:-1] for part in parts for ring in (part.exterior, *part.interiors)]
    return np.vstack(rings) if rings else np.zeros((0, 2))
