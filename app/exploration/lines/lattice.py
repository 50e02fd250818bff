"""Parallel survey lines over an area: equal shares per vehicle, evenly spaced, flown there and back (boustrophedon)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Polygon, minimum_rotated_rectangle

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, flown_m

SHARE_SAMPLES = 200
MAX_LINES = 2000
LEAST_LINE_M = 0.5
MOST_INSET = 0.4
"""A line is taken back at either end by at most this part of its length."""


def longer_axis_rad(area: FloatArray) -> float:
    """Return the direction of the longer side of the smallest rectangle around the area.

    Anticlockwise from east, in [0, pi). Of equal sides the one closer to north counts as the longer.
    """
    rectangle = minimum_rotated_rectangle(Polygon(area))
    corners = np.asarray(rectangle.exterior.coords if isinstance(rectangle, Polygon) else area)
    sides = np.diff(corners[:3], axis=0)
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    angles = np.arctan2(sides[:, 1], sides[:, 0]) % np.pi
    if np.isclose(lengths[0], lengths[1], rtol=1e-6):
        return float(angles[np.argmin(np.abs(angles - np.pi / 2))])
    return float(angles[np.argmax(lengths)])


def direction_of_lines_rad(area: FloatArray, heading_deg: float | None) -> float:
    """Return the direction of lines of a heading, clockwise from north; without one that of the longer side.

    Anticlockwise from east, in [0, pi).
    """
    return longer_axis_rad(area) if heading_deg is None else float(np.radians(90.0 - heading_deg) % np.pi)


def axes_of(direction_rad: float) -> FloatArray:
    """Return unit vectors (2, 2) across and along lines of a direction, anticlockwise from east."""
    along = np.array([np.cos(direction_rad), np.sin(direction_rad)])
    return np.stack([np.array([along[1], -along[0]]), along])


@dataclass(frozen=True)
class Sweep:
    """A direction of survey lines: ``v`` runs along the lines, ``u`` across them.

    Lines lie ``within`` two values of v.
    """

    constraints: Constraints
    free: FreeSpace
    direction_rad: float
    within: tuple[float, float] = (-np.inf, np.inf)

    @property
    def _axes(self) -> FloatArray:
        return axes_of(self.direction_rad)

    def to_uv(self, en_m: FloatArray) -> FloatArray:
        """Turn local positions (..., 2) into (u, v)."""
        return np.asarray(en_m @ self._axes.T)

    def to_en(self, uv_m: FloatArray) -> FloatArray:
        """Turn (u, v) positions (..., 2) into local ones."""
        return np.asarray(uv_m @ self._axes)

    def shares(self, parts: FloatArray) -> FloatArray:
        """Return the n + 1 values of u that cut the free area into strips whose areas are as ``parts`` (n,)."""
        area = self.constraints.area
        low, high = area.min(axis=0), area.max(axis=0)
        axes = [np.linspace(low[k], high[k], SHARE_SAMPLES, endpoint=False) for k in (0, 1)]
        east, north = np.meshgrid(*(axis + (high[k] - low[k]) / SHARE_SAMPLES / 2 for k, axis in enumerate(axes)))
        points = np.column_stack([east.ravel(), north.ravel()])
        u = self.to_uv(points[inside_area(self.constraints, points)])[:, 0]
        u_area = self.to_uv(area)[:, 0]
        at = np.cumsum(parts)[:-1] / np.sum(parts)
        if len(u) == 0:
            u = u_area
        cuts = np.quantile(u, at)
        return np.concatenate([[u_area.min()], cuts, [u_area.max()]])

    def lines(self, lines_u: FloatArray, inset_m: float = 0.0) -> list[list[FloatArray]]:
        """Return the parts (2, 2) of each line at ``lines_u`` that lie in the free space, by increasing v.

        Both ends of a part are taken back by ``inset_m``, where it is long enough.
        """
        v = self.to_uv(self.constraints.area)[:, 1]
        n = len(lines_u)
        u = np.repeat(lines_u, 2)
        ends = self.to_en(np.column_stack([u, np.tile([v.min() - 1.0, v.max() + 1.0], n)])).reshape(n, 2, 2)
        cuts, of = shapely.get_parts(
            shapely.intersection(self.free.region, shapely.linestrings(ends)), return_index=True
        )
        lines = (shapely.get_type_id(cuts) == shapely.GeometryType.LINESTRING) & ~shapely.is_empty(cuts)
        cuts, of = cuts[lines], of[lines]
        pieces = np.stack([shapely.get_coordinates(shapely.get_point(cuts, k)).reshape(-1, 2) for k in (0, -1)], axis=1)
        if np.isfinite(self.within).any():
            ends_uv = self.to_uv(pieces)
            ends_uv[..., 1] = np.clip(ends_uv[..., 1], *self.within)
            some = np.abs(np.diff(ends_uv[..., 1], axis=1)[:, 0]) > LEAST_LINE_M
            pieces, of = self.to_en(ends_uv[some]), of[some]
        along = self.to_uv(pieces)[..., 1]
        backwards = along[:, 0] > along[:, 1]
        pieces[backwards] = pieces[backwards, ::-1]
        way = pieces[:, 1] - pieces[:, 0]
        inset = way * np.minimum(inset_m / np.maximum(np.hypot(*way.T), 1e-9), MOST_INSET)[:, None]
        pieces = pieces + np.stack([inset, -inset], axis=1)
        found: list[list[FloatArray]] = [[] for _ in range(n)]
        for i in np.lexsort((np.minimum(*along.T), of)):
            found[of[i]].append(pieces[i])
        return found

    def stops(self, lines_u: FloatArray, *, upwards: bool, inset_m: float = 0.0) -> FloatArray:
        """Return the stops (k, 2) of flying the lines at ``lines_u`` in order, the first one ``upwards`` (along v).

        Their ends are taken back by ``inset_m``.
        """
        stops: list[FloatArray] = []
        # All lines at once: one by one they take most of the time of planning a long mission, and hold others up.
        for pieces in self.lines(lines_u, inset_m):
            if not pieces:
                continue
            stops.extend(pieces if upwards else [p[::-1] for p in reversed(pieces)])
            upwards = not upwards
        return np.vstack(stops) if stops else np.zeros((0, 2))


def even_lines(low_u: float, high_u: float, n: int, to_low: float = 0.5, to_high: float = 0.5) -> FloatArray:
    """Return ``n`` evenly spaced lines in the interval; by default the middles of ``n`` equal parts.

    ``to_low`` and ``to_high`` are the distances of the outer ones from the ends, in spacings.
    """
    return np.asarray(low_u + (np.arange(n) + to_low) * (high_u - low_u) / (n - 1 + to_low + to_high))


def route_length(start: FloatArray, stops: FloatArray) -> float:
    """Return the length of the polyline from ``start`` (2,) through ``stops`` (k, 2)."""
    if len(stops) == 0:
        return 0.0
    return float(np.hypot(*np.diff(np.vstack([start, stops]), axis=0).T).sum())


def most_lines(affordable: Callable[[int], bool]) -> int:
    """Return the largest number of lines that is ``affordable``, at least 1; more lines always cost more."""
    low, high = 1, 2
    while high < MAX_LINES and affordable(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if affordable(middle) else (low, middle)
    return low


def flown_length(start: FloatArray, stops: FloatArray, turn_radius_m: float) -> float:
    """Return how far a vehicle flies from ``start`` (2,) through ``stops`` (k, 2) that turns in such circles."""
    if turn_radius_m <= 0.0:
        return route_length(start, stops)
    return float(flown_m(start[0], start[1], np.nan, np.ascontiguousarray(stops), Turns(turn_radius_m, 0.0)))


def boustrophedon(
    sweep: Sweep,
    start: FloatArray,
    low_u: float,
    high_u: float,
    budget_m: float,
    *,
    lines: FloatArray | None = None,
    turn_radius_m: float = 0.0,
) -> FloatArray:
    """Return the route (k, 2) over as many evenly spaced lines of the strip as ``budget_m`` pays for, turns included.

    Begins at the corner of the strip that is closest to ``start``. At least one line is returned, whatever its length;
    given ``lines`` (values of u) are flown whatever they cost.
    """
    if lines is not None:
        return _from_closest_corner(sweep, start, lines)

    def route(n: int) -> FloatArray:
        return _from_closest_corner(sweep, start, even_lines(low_u, high_u, n))

    return route(most_lines(lambda n: flown_length(start, route(n), turn_radius_m) <= budget_m))


def _from_closest_corner(sweep: Sweep, start: FloatArray, lines: FloatArray) -> FloatArray:
    options = [
        sweep.free.connect(start, sweep.stops(lines[::order], upwards=upwards))
        for order in (1, -1)
        for upwards in (True, False)
    ]
    return min(options, key=lambda route: float(np.hypot(*(route[0] - start))) if len(route) else np.inf)
