"""Survey lines for a row of vehicles side by side, which closes up to pass obstacles.

A *row* is three numbers: where its middle is (east, north) and the gap between neighbours. The row always points in the
same direction, across the lines.
"""

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from shapely import LineString, MultiLineString, MultiPoint, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.prepared import PreparedGeometry, prep

from app.arrays import BoolArray, FloatArray
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.free_space import FreeSpace
from app.exploration.lines.lattice import axes_of

EDGE = 0.01
"""How far from a zone a vehicle stays at least, as a fraction of the visibility."""

OUTLIERS = 0.01
"""Part of the unfinished landmarks on either side that do not widen the strip to be swept."""


@dataclass(frozen=True, eq=False)
class RowSpace:
    """Where a row of ``n`` vehicles may be: the mission's area in coordinates across (u) and along (v) the lines.

    Attributes
    ----------
    constraints : Constraints
        Give the area and its keep-out zones.
    direction_rad : float
        Of the lines, anticlockwise from east.
    n : int
        Vehicles in the row.
    closed_m : float
        Gap of a row that has closed up.
    edge_m : float
        Distance kept from zones.
    """

    constraints: Constraints
    direction_rad: float
    n: int
    closed_m: float
    edge_m: float

    @cached_property
    def _free(self) -> "PreparedGeometry[BaseGeometry]":
        return prep(FreeSpace(self.constraints, 0.0).region.buffer(1e-6))

    @cached_property
    def _middles(self) -> FreeSpace:
        return FreeSpace(self._for_middles(), self.edge_m / 2)

    def _for_middles(self) -> Constraints:
        """Return the limits of the middle of a row that has closed up: its ends must keep the mission's."""
        half = (self.n - 1) / 2 * self.closed_m * self.axes[0]
        zones = [MultiPoint(np.vstack([zone - half, zone + half])).convex_hull for zone in self.constraints.keep_out]
        shifted = [Polygon(self.constraints.area + k * half) for k in (-1, 1)]
        area = shifted[0].intersection(shifted[1])
        if not isinstance(area, Polygon) or area.is_empty:
            return self.constraints
        return replace(
            self.constraints,
            area=np.asarray(area.exterior.coords)[:-1],
            keep_out=tuple(np.asarray(zone.exterior.coords)[:-1] for zone in zones if isinstance(zone, Polygon)),
        )

    @property
    def axes(self) -> FloatArray:
        """Unit vectors across and along the lines, (2, 2)."""
        return axes_of(self.direction_rad)

    def to_uv(self, en_m: FloatArray) -> FloatArray:
        """Turn local positions (..., 2) into (u, v)."""
        return np.asarray(en_m @ self.axes.T)

    def to_row(self, u: float, v: float, gap: float) -> FloatArray:
        """Return the row (3,) whose middle is at (u, v)."""
        return np.append(np.array([u, v]) @ self.axes, gap)

    def slots(self, rows: FloatArray) -> FloatArray:
        """Return where the vehicles of rows (..., 3) are, (..., n, 2), by increasing u."""
        k = np.arange(self.n) - (self.n - 1) / 2
        across = k[:, None] * self.axes[0]
        return np.asarray(rows[..., None, :2] + rows[..., 2, None, None] * across)

    def allowed(self, rows: FloatArray) -> BoolArray:
        """Return for which of the rows (k, 3) every vehicle is inside the area and outside all zones, (k,)."""
        slots = self.slots(rows)
        return np.asarray(inside_area(self.constraints, slots.reshape(-1, 2)).reshape(len(rows), self.n).all(axis=1))

    def way(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return the rows (k, 3) from ``start`` (3,), left out, to ``goal`` (3,), closed up round zones."""
        legs = np.stack([self.slots(start), self.slots(goal)], axis=1)
        if self._free.covers(MultiLineString([LineString(leg) for leg in legs])):
            return goal[None]
        middles = self._middles.way(start[:2], goal[:2])
        closed = np.column_stack([middles, np.full(len(middles), min(self.closed_m, start[2], goal[2]))])
        here = np.append(start[:2], closed[0, 2])
        return np.vstack([here, closed, goal])

    def length(self, start: FloatArray, route: FloatArray) -> float:
        """Return how far the vehicles travel at most from ``start`` (3,) along a route (k, 3) of rows."""
        if len(route) == 0:
            return 0.0
        return float(self.leg_lengths(np.vstack([start, route])).sum())

    def leg_lengths(self, rows: FloatArray) -> FloatArray:
        """Return the length (k - 1,) of every leg between rows (k, 3): what its busiest vehicle travels at most."""
        change = np.diff(rows, axis=0)
        return np.asarray(np.hypot(change[:, 0], change[:, 1]) + (self.n - 1) / 2 * np.abs(change[:, 2]))

    def along(self, start: FloatArray, route: FloatArray, distance: float) -> tuple[FloatArray, int]:
        """Return the row after ``distance`` along a route (k, 3), and how many of its rows are then behind."""
        here, left, passed = start, distance, 0
        for goal in route:
            length = float(self.leg_lengths(np.stack([here, goal]))[0])
            if length > left:
                return here + left / length * (goal - here), passed
            here, left, passed = goal, left - length, passed + 1
        return here, passed


def lines_over(
    space: RowSpace, start: FloatArray, unfinished: FloatArray, widest_gap: float, inset: float
) -> FloatArray:
    """Return the route (k, 3) of a row over all unfinished places: parallel lines there and back, round the zones.

    Parameters
    ----------
    start : (3,)
        The row as it is.
    unfinished : (m, 2)
        What is to be seen, at least one place.
    widest_gap : float
        Between neighbours.
    inset : float
        How far before the end of what is to be seen a line ends.
    """
    uv = space.to_uv(unfinished)
    low, high = np.quantile(uv[:, 0], [OUTLIERS, 1.0 - OUTLIERS])
    borders = space.to_uv(space.constraints.area)[:, 0]
    pad = widest_gap / 4
    low, high = max(borders.min(), low - pad), min(borders.max(), high + pad)
    passes = max(1, int(np.ceil((high - low) / (space.n * widest_gap) - 1e-9)))
    width = (high - low) / passes
    lines = []
    for k in range(passes):
        strip = low + k * width, low + (k + 1) * width
        inside = uv[(uv[:, 0] >= strip[0]) & (uv[:, 0] <= strip[1]), 1]
        if len(inside):
            lines.append(_line(space, strip, _trimmed(float(inside.min()), float(inside.max()), inset)))
    routes = []
    for ordered in (lines, lines[::-1]):
        for upwards in (True, False):
            stops = [row for k, line in enumerate(ordered) for row in (line if (k % 2 == 0) == upwards else line[::-1])]
            route, here = [np.zeros((0, 3))], start
            for stop in stops:
                route.append(space.way(here, stop))
                here = stop
            routes.append(np.vstack(route))
    return min(routes, key=lambda route: space.length(start, route))


def _trimmed(low: float, high: float, inset: float) -> tuple[float, float]:
    cut = min(inset, (high - low) / 2)
    return low + cut, high - cut


def _line(space: RowSpace, strip: tuple[float, float], ends: tuple[float, float]) -> list[FloatArray]:
    """Return the rows along one line by increasing v; beside a zone the row closes up into what it leaves free."""
    low, high = strip
    boxes = [space.to_uv(zone) for zone in space.constraints.keep_out]
    beside = [
        (box.min(axis=0) - space.edge_m, box.max(axis=0) + space.edge_m)
        for box in boxes
        if box[:, 0].max() + space.edge_m > low and box[:, 0].min() - space.edge_m < high
    ]
    edges = [float(v) for box in beside for v in (box[0][1], box[1][1])]
    cuts = [ends[0], *sorted({v for v in edges if ends[0] < v < ends[1]}), ends[1]]
    rows: list[FloatArray] = []
    for v0, v1 in itertools.pairwise(cuts):
        blocked = [(float(b[0][0]), float(b[1][0])) for b in beside if b[0][1] < (v0 + v1) / 2 < b[1][1]]
        left, right = _widest_free(low, high, blocked)
        if right - left >= space.n * space.closed_m / 2:
            gap = (right - left) / space.n
            rows += [space.to_row((left + right) / 2, v, gap) for v in (v0, v1)]
    if ends[0] == ends[1]:
        rows = [space.to_row((low + high) / 2, ends[0], (high - low) / space.n)]
    return rows


def _widest_free(low: float, high: float, blocked: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the widest part of [low, high] outside the blocked intervals; an empty one when there is none."""
    best, left = (low, low), low
    for b0, b1 in [*sorted(blocked), (high, high)]:
        if min(b0, high) - left > best[1] - best[0]:
            best = (left, min(b0, high))
        left = max(left, b1)
    return best
