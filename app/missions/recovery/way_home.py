"""The way home: from where a vehicle is, inside the area and the corridor to its recovery point, off zones and land."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient
from shapely.ops import nearest_points, unary_union

from app.arrays import BoolArray, FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints

CORRIDOR_M = 30.0
"""Half the width of the corridor that leads from the area to a recovery point outside of it."""

CLEARANCE_M = 0.5
"""Ways keep this far from borders and zones."""

LAND_MARGIN_M = 5.0
"""Ways keep this far from where the water is too shallow."""

DETAIL_M = 0.25
"""Corners of the ground are told apart from this distance on."""

LEAST_SHARE = 0.05
"""A vehicle that makes good less of its speed against the current does not get home."""


def homeward_ground(constraints: Constraints, home_m: FloatArray) -> Constraints:
    """Return a mission's limits with its area widened by a straight corridor to a recovery point (2,).

    Parameters
    ----------
    constraints
        Of the mission; zones stay as they are.
    """
    area, home = Polygon(constraints.area), Point(home_m)
    if area.contains(home):
        return constraints
    free: BaseGeometry = area
    for zone in constraints.keep_out:
        free = free.difference(Polygon(zone))
    ashore, _ = nearest_points(area if free.is_empty else free, home)
    corridor = LineString([(ashore.x, ashore.y), (home.x, home.y)]).buffer(CORRIDOR_M, quad_segs=2)
    [whole] = _polygons(unary_union([area, corridor]))
    ground = orient(Polygon(whole.exterior))
    return replace(constraints, area=np.asarray(ground.exterior.coords)[:-1])


class WaysHome:
    """All ways to one recovery point: found once, asked often.

    Parameters
    ----------
    constraints
        Of the mission: the area is widened by :func:`homeward_ground`.
    home_m : (2,)
    bottom
        Pessimistic sea floor; where it is shallower than ``least_m`` counts as land.
    apart
        Places to go round, and how far from them.
    """

    def __init__(
        self,
        constraints: Constraints,
        home_m: FloatArray,
        bottom: Bottom | None = None,
        least_m: float = 0.0,
        apart: tuple[Sequence[FloatArray], float] = ((), 0.0),
    ) -> None:
        ground = homeward_ground(constraints, home_m)
        free: BaseGeometry = Polygon(ground.area)
        blocked: list[BaseGeometry] = [Polygon(zone) for zone in ground.keep_out]
        blocked += [] if bottom is None else _land(bottom, least_m)
        places_m, apart_m = apart
        blocked += [Point(place_m).buffer(apart_m, quad_segs=2) for place_m in places_m]
        if blocked:
            free = free.difference(unary_union(blocked))
        self._home_m = home_m
        self._inner = inner = free.buffer(-CLEARANCE_M, quad_segs=2).simplify(DETAIL_M)
        self._reachable = not inner.is_empty and inner.distance(Point(home_m)) <= CLEARANCE_M + 1e-9
        if not self._reachable:
            return
        self._roomy = inner.buffer(1e-3)
        shapely.prepare([self._inner, self._roomy])
        last = _coords(nearest_points(inner, Point(home_m))[0])
        rings = [ring for part in _polygons(inner) for ring in (part.exterior, *part.interiors)]
        self._nodes = nodes = np.vstack([last, *(np.asarray(ring.coords)[:-1] for ring in rings)])
        a, b = np.triu_indices(len(nodes), 1)
        seen = self.sees(nodes[a], nodes[b])
        length = np.hypot(*(nodes[a[seen]] - nodes[b[seen]]).T)
        graph = csr_array((np.maximum(length, 1e-9), (a[seen], b[seen])), shape=(len(nodes), len(nodes)))
        away, before = dijkstra(graph, directed=False, indices=[0], return_predecessors=True)
        self._away_m, self._before = away[0], before[0]

    def way(self, start_m: FloatArray) -> FloatArray | None:
        """Return the corners of the shortest way home, (n, 2), the last of them home; None when there is none.

        A vehicle outside the ground, or in a zone's margin, leaves that by the shortest way first.
        """
        if not self._reachable:
            return None
        inside = self._inner.covers(Point(start_m))
        first = start_m if inside else _coords(nearest_points(self._inner, Point(start_m))[0])
        total_m = np.hypot(*(self._nodes - first).T) + self._away_m
        total_m[~self.sees(np.broadcast_to(first, self._nodes.shape), self._nodes)] = np.inf
        node = int(np.argmin(total_m))
        if not np.isfinite(total_m[node]):
            return None
        way = [] if inside else [first]
        while node > 0:
            way.append(self._nodes[node])
            node = int(self._before[node])
        return np.array([*way, self._home_m])

    def sees(self, from_m: FloatArray, to_m: FloatArray) -> BoolArray:
        """Return whether straight lines from places (n, 2) to others (n, 2) keep off everything, (n,)."""
        if not self._reachable:
            return np.zeros(len(from_m), dtype=np.bool_)
        lines = shapely.linestrings(np.stack([from_m, to_m], axis=1))
        return np.asarray(shapely.covers(self._roomy, lines), dtype=np.bool_)


def way_time_s(start_m: FloatArray, way_m: FloatArray, speed_mps: float, current_mps: tuple[float, float]) -> float:
    """Return how long a way takes against a current, of which what helps is not counted; inf where it is too strong.

    Parameters
    ----------
    start_m : (2,)
    way_m : (n, 2)
        Its corners after the start.
    current_mps
        East and north.
    """
    total_s = 0.0
    for a, b in pairwise(np.vstack([start_m, way_m])):
        length_m = float(np.hypot(*(b - a)))
        if length_m < 1e-9:
            continue
        along = (b - a) / length_m
        helps = float(along @ np.array(current_mps))
        aside2 = max(current_mps[0] ** 2 + current_mps[1] ** 2 - helps**2, 0.0)
        made_good = math.sqrt(max(speed_mps**2 - aside2, 0.0)) + min(helps, 0.0)
        if made_good < LEAST_SHARE * speed_mps:
            return math.inf
        total_s += length_m / made_good
    return total_s


def passed_over(
    here_m: FloatArray,
    way_m: FloatArray,
    depths_m: Sequence[float],
    place_m: FloatArray,
    apart_m: float,
    above_m: float,
) -> bool:
    """Whether a way leads nearer than ``apart_m`` to who waits at the surface, where it is no deeper than ``above_m``.

    Parameters
    ----------
    here_m : (2,)
        Where it begins. From within that distance it leads anywhere.
    way_m : (n, 2)
    depths_m
        How deep the way is to each of its corners.
    place_m : (2,)
    """
    if math.dist(here_m, place_m) < apart_m:
        return False
    place = Point(place_m)
    pieces = zip(pairwise(np.vstack([here_m, way_m])), depths_m, strict=True)
    return any(depth_m < above_m and LineString(piece).distance(place) < apart_m for piece, depth_m in pieces)


def _land(bottom: Bottom, least_m: float) -> list[BaseGeometry]:
    """Return the ground that is known to be too shallow."""
    rows, cols = np.nonzero(bottom.depth_m < least_m)
    if len(rows) == 0:
        return []
    west, south = bottom.west_m + cols * bottom.cell_m, bottom.south_m + rows * bottom.cell_m
    boxes = shapely.box(west, south, west + bottom.cell_m, south + bottom.cell_m)
    return [shapely.union_all(boxes).buffer(LAND_MARGIN_M, join_style="mitre")]


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    return [part for part in getattr(geometry, "geoms", [geometry]) if isinstance(part, Polygon)]


def _coords(point: Point) -> FloatArray:
    return np.array([point.x, point.y])
