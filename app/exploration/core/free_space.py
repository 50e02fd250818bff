"""The area without its keep-out zones, as polygons, and shortest ways through it."""

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import nearest_points

from app.arrays import BoolArray, FloatArray
from app.exploration.core.constraints import Constraints

CLEAR_M = 1.0
"""Who is too near to a zone, or to a corner, goes so far beyond where that begins."""


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
