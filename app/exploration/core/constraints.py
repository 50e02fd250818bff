"""The constraints C(X) <= 0 of AURO15 section 4.1, in metres: what no proposed team configuration may break.

Each limit of each vehicle has an *excess* in metres: 0 while it is kept, positive by how much it is broken. A limit
that is already broken where the vehicles are now (launched outside the area, pushed there by a current, out of range of
each other) may stay broken only while the move lessens the excess; every other excess must be 0.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from shapely import Polygon

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.bottom import LEG_CHECKS, Bottom
from app.exploration.core.geometry import boundary_distance, convex, enters, inside, leaves, signed_distance

TOLERANCE_M = 1e-6


class Limit(IntEnum):
    """The limits, in the order of the last axis of :meth:`Constraints.excess`."""

    AREA = 0
    AREA_LEG = 1
    KEEP_OUT = 2
    KEEP_OUT_LEG = 3
    STEP = 4
    MIN_DEPTH = 5
    MAX_DEPTH = 6
    ALTITUDE = 7
    COM_RANGE = 8
    SEPARATION = 9


# Compiled functions index with plain numbers.
AREA, AREA_LEG, KEEP_OUT, KEEP_OUT_LEG, STEP, MIN_DEPTH, MAX_DEPTH, ALTITUDE, COM_RANGE, SEPARATION = map(int, Limit)

WHERE = (Limit.AREA, Limit.AREA_LEG, Limit.KEEP_OUT, Limit.KEEP_OUT_LEG)
"""The limits of where a leg leads, however deep and long it is."""


class Region(NamedTuple):
    """Where vehicles may be, for compiled functions.

    Attributes
    ----------
    area : (n_vertices, 2)
        As in :class:`Constraints`.
    area_is_convex : bool
        Then no leg between two places inside leaves it.
    keep_out : (n_vertices, 2)
        The vertices of all zones.
    starts : (n_zones + 1,)
        Where each zone begins in them.
    """

    area: FloatArray
    area_is_convex: bool
    keep_out: FloatArray
    starts: IntArray


@dataclass(frozen=True)
class Violation:
    """One broken limit of one vehicle; ``value_m`` is what was proposed, ``limit_m`` what is allowed."""

    vehicle: str
    limit: Limit
    value_m: float
    limit_m: float
    reason: str

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.reason}"


@dataclass(frozen=True)
class Constraints:
    """Limits of a mission, in the local frame (east, north, depth; depth positive down).

    Attributes
    ----------
    area : (n_vertices, 2)
        Simple polygon, counter-clockwise, not closed.
    keep_out : tuple of (n_vertices, 2)
        Polygons that no leg may enter.
    max_step_m : float
        Largest 3-D distance a vehicle moves in one step.
    min_depth_m, max_depth_m : float
        Band of allowed vehicle depths.
    min_altitude_m : float
        Least clearance above the sea floor as estimated now.
    com_range_m : float
        Each vehicle has another one within this distance (inf: unlimited; no matter for a single vehicle).
    min_separation_m : float
        Least distance between two vehicles, horizontally unless they are ``min_vertical_separation_m`` apart in depth.
    min_vertical_separation_m : float
        Difference in depth that makes horizontal separation unnecessary.
    held_altitude_m : float or None
        Height above the sea floor that vehicles hold by themselves when they are sent deeper; None: the least altitude.
    climb : float
        Metres a metre that vehicles rise from the beginning of a leg that ends less deep; 0: evenly along it.
    around : tuple of (n_vertices, 2)
        Polygons about the keep-out zones that plans keep off, too: a vehicle begins its leg near where it was planned
        to, and its way from there has to be free.
    checked_by : Constraints or None
        Of limits that plans keep to: what their legs are held to before they are sent; None: the same.
    """

    area: FloatArray
    keep_out: tuple[FloatArray, ...] = ()
    max_step_m: float = 10.0
    min_depth_m: float = 0.0
    max_depth_m: float = np.inf
    min_altitude_m: float = 1.0
    com_range_m: float = np.inf
    min_separation_m: float = 0.0
    min_vertical_separation_m: float = np.inf
    held_altitude_m: float | None = None
    climb: float = 0.0
    around: tuple[FloatArray, ...] = ()
    checked_by: "Constraints | None" = None

    @cached_property
    def for_plans(self) -> "Constraints":
        """The limits that plans keep to: the same object each time, for what planners make of it is made once."""
        if not self.around:
            return self
        return replace(self, keep_out=(*self.keep_out, *self.around), around=(), checked_by=self)

    @property
    def for_checks(self) -> "Constraints":
        """The limits that legs are held to before they are sent."""
        return self if self.checked_by is None else self.checked_by

    @property
    def lowest_m(self) -> float:
        """Height above the sea floor below which vehicles never are."""
        return self.min_altitude_m if self.held_altitude_m is None else self.held_altitude_m

    @cached_property
    def region(self) -> Region:
        """Where vehicles may be."""
        area = np.ascontiguousarray(self.area, dtype=np.float64)
        starts = np.zeros(len(self.keep_out) + 1, dtype=np.int64)
        starts[1:] = np.cumsum([len(zone) for zone in self.keep_out])
        vertices = np.vstack(self.keep_out) if self.keep_out else np.zeros((0, 2))
        return Region(area, convex(area), np.ascontiguousarray(vertices, dtype=np.float64), starts)

    def excess(self, origin: FloatArray, candidates: FloatArray, bottom: Bottom) -> FloatArray:
        """Return by how much each limit would be broken.

        Parameters
        ----------
        origin : (n_vehicles, 3)
            Where the vehicles are.
        candidates : (n_candidates, n_vehicles, 3)
            Where they might go, each on a straight leg, all at the same time.
        bottom : Bottom
            The sea floor as estimated now.

        Returns
        -------
        (n_candidates, n_vehicles, len(Limit))
            Metres; 0 where the limit is kept, inf for a leg across a forbidden zone.
        """
        floor = _Floor(float(bottom.west_m), float(bottom.south_m), float(bottom.cell_m), bottom.depth_m)
        limits = _Limits(
            float(self.max_step_m),
            float(self.min_depth_m),
            float(self.max_depth_m),
            float(self.min_altitude_m),
            float(self.com_range_m),
            float(self.min_separation_m),
            float(self.min_vertical_separation_m),
            float(self.climb),
        )
        ends = np.ascontiguousarray(candidates, dtype=np.float64)
        excess = np.zeros((*ends.shape[:2], len(Limit)))
        _excess(np.ascontiguousarray(origin, dtype=np.float64), ends, self.region, floor, limits, excess)
        return excess

    def feasible(self, origin: FloatArray, candidates: FloatArray, bottom: Bottom | None = None) -> BoolArray:
        """Return which candidates obey every limit, (n_candidates,); shapes of the arguments as in :meth:`excess`."""
        floor = Bottom.unknown() if bottom is None else bottom
        broken = self._broken(origin, candidates, floor)
        return np.asarray(~broken.any(axis=(1, 2)), dtype=np.bool_)

    def violations(
        self, vehicles: tuple[str, ...], origin: FloatArray, target: FloatArray, bottom: Bottom | None = None
    ) -> tuple[Violation, ...]:
        """Return what the configuration ``target`` (n_vehicles, 3) would break, in words; empty when nothing."""
        floor = Bottom.unknown() if bottom is None else bottom
        excess = self.excess(origin, target[None], floor)[0]
        broken = self._broken(origin, target[None], floor)[0]
        return tuple(
            self._violation(name, Limit(int(k)), float(excess[i, k]))
            for i, name in enumerate(vehicles)
            for k in np.flatnonzero(broken[i])
        )

    def _broken(self, origin: FloatArray, candidates: FloatArray, bottom: Bottom) -> BoolArray:
        excess = self.excess(origin, candidates, bottom)
        now = self.excess(origin, np.asarray(origin)[None], bottom)
        return np.asarray((excess > TOLERANCE_M) & ~(excess < now - TOLERANCE_M), dtype=np.bool_)

    def _violation(self, vehicle: str, limit: Limit, excess_m: float) -> Violation:
        match limit:
            case Limit.AREA:
                return Violation(
                    vehicle,
                    limit,
                    excess_m,
                    0.0,
                    f"waypoint lies {excess_m:.2f} m outside the area; choose one inside",
                )
            case Limit.AREA_LEG:
                return Violation(
                    vehicle, limit, excess_m, 0.0, "the leg leaves the area; go round by a waypoint inside"
                )
            case Limit.KEEP_OUT:
                return Violation(
                    vehicle, limit, excess_m, 0.0, f"waypoint lies {excess_m:.2f} m inside a keep-out zone"
                )
            case Limit.KEEP_OUT_LEG:
                return Violation(vehicle, limit, excess_m, 0.0, "the leg crosses a keep-out zone; go round it")
            case Limit.STEP:
                value, allowed, what = (
                    self.max_step_m + excess_m,
                    self.max_step_m,
                    "step of {v:.2f} m is longer than {a:g} m",
                )
            case Limit.MIN_DEPTH:
                value, allowed, what = (
                    self.min_depth_m - excess_m,
                    self.min_depth_m,
                    "depth of {v:.2f} m is shallower than {a:g} m",
                )
            case Limit.MAX_DEPTH:
                value, allowed, what = (
                    self.max_depth_m + excess_m,
                    self.max_depth_m,
                    "depth of {v:.2f} m is deeper than {a:g} m",
                )
            case Limit.ALTITUDE:
                value, allowed = self.min_altitude_m - excess_m, self.min_altitude_m
                what = "clearance of {v:.2f} m above the estimated bottom is less than {a:g} m"
            case Limit.COM_RANGE:
                value, allowed = self.com_range_m + excess_m, self.com_range_m
                what = "the closest other vehicle is {v:.2f} m away, beyond the communication range of {a:g} m"
            case Limit.SEPARATION:
                value, allowed = self.min_separation_m - excess_m, self.min_separation_m
                what = "passes another vehicle at {v:.2f} m, closer than {a:g} m"
        return Violation(vehicle, limit, value, allowed, what.format(v=value, a=allowed))


class _Floor(NamedTuple):
    west: float
    south: float
    cell: float
    depth: FloatArray


class _Limits(NamedTuple):
    step: float
    min_depth: float
    max_depth: float
    altitude: float
    com_range: float
    separation: float
    vertical_separation: float
    climb: float


Point = tuple[float, float, float]


@njit(cache=True, nogil=True)
def _point(points: FloatArray, i: int) -> Point:
    """Return a row of (n, 3) as numbers: every view of an array that is passed on is counted, which takes its time."""
    return points[i, 0], points[i, 1], points[i, 2]


@njit(cache=True, nogil=True)
def _area_excess(origin: FloatArray, candidates: FloatArray, region: Region, excess: FloatArray) -> None:
    """Write by how much the area is left."""
    area = region.area
    for i in range(len(origin)):
        a = _point(origin, i)
        may_leave = not region.area_is_convex and signed_distance(area, a[0], a[1]) <= TOLERANCE_M
        for candidate in range(len(candidates)):
            x, y = candidates[candidate, i, 0], candidates[candidate, i, 1]
            outside = 0.0 if inside(area, x, y) else boundary_distance(area, x, y)
            if outside > 0.0:
                excess[candidate, i, AREA] = outside
            if may_leave and outside <= TOLERANCE_M and leaves(area, a[0], a[1], x, y, TOLERANCE_M):
                excess[candidate, i, AREA_LEG] = np.inf


@njit(cache=True, nogil=True)
def _zone_excess(origin: FloatArray, candidates: FloatArray, zone: FloatArray, excess: FloatArray) -> None:
    """Write by how much a keep-out zone is entered, where that is more than is written for others."""
    for i in range(len(origin)):
        a = _point(origin, i)
        may_enter = signed_distance(zone, a[0], a[1]) >= -TOLERANCE_M
        for candidate in range(len(candidates)):
            x, y = candidates[candidate, i, 0], candidates[candidate, i, 1]
            if inside(zone, x, y):
                row = excess[candidate, i]
                row[KEEP_OUT] = max(row[KEEP_OUT], boundary_distance(zone, x, y))
            if may_enter and enters(zone, a[0], a[1], x, y, TOLERANCE_M):
                excess[candidate, i, KEEP_OUT_LEG] = np.inf


@njit(cache=True, nogil=True)
def _clearance(a: Point, b: Point, floor: _Floor, climb: float) -> float:
    """Return the least height of the leg a -> b above the floor, inf where that is unknown."""
    least = np.inf
    length = np.hypot(b[0] - a[0], b[1] - a[1])
    for k in range(1, LEG_CHECKS + 1):
        t = k / LEG_CHECKS
        col = int(np.floor((a[0] + t * (b[0] - a[0]) - floor.west) / floor.cell))
        row = int(np.floor((a[1] + t * (b[1] - a[1]) - floor.south) / floor.cell))
        if 0 <= row < floor.depth.shape[0] and 0 <= col < floor.depth.shape[1]:
            depth = a[2] + t * (b[2] - a[2])
            if b[2] < a[2]:
                depth = max(b[2], min(depth, a[2] - climb * t * length))
            height = floor.depth[row, col] - depth
            if height < least:  # never where the depth is NaN
                least = height
    return least


@njit(cache=True, nogil=True)
def _approach(a: Point, b: Point, c: Point, d: Point, limits: _Limits) -> float:
    """Return how close vehicles that go a -> b and c -> d in the same time come, horizontally; inf above each other."""
    gap_now = a[2] - c[2]
    gap = b[2] - d[2]
    apart = abs(gap) >= limits.vertical_separation
    if apart and abs(gap_now) >= limits.vertical_separation and gap * gap_now > 0.0:
        return np.inf
    rx = a[0] - c[0]
    ry = a[1] - c[1]
    vx = (b[0] - a[0]) - (d[0] - c[0])
    vy = (b[1] - a[1]) - (d[1] - c[1])
    t = 1.0
    if np.hypot(rx, ry) >= limits.separation:
        v2 = vx * vx + vy * vy
        t = min(1.0, max(0.0, -(rx * vx + ry * vy) / v2)) if v2 > 0.0 else 0.0
    elif apart:  # already too close: what counts is where they end
        return np.inf
    return float(np.hypot(rx + t * vx, ry + t * vy))


@njit(cache=True, nogil=True)
def _excess(
    origin: FloatArray,
    candidates: FloatArray,
    region: Region,
    floor: _Floor,
    limits: _Limits,
    excess: FloatArray,
) -> None:
    """Write the excess of every candidate into ``excess``, zeros before."""
    n = len(origin)
    _area_excess(origin, candidates, region, excess)
    for z in range(len(region.starts) - 1):
        _zone_excess(origin, candidates, region.keep_out[region.starts[z] : region.starts[z + 1]], excess)
    for candidate in range(len(candidates)):
        ends = candidates[candidate]
        for i in range(n):
            a, b, row = _point(origin, i), _point(ends, i), excess[candidate, i]
            step = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            row[STEP] = max(0.0, step - limits.step)
            row[MIN_DEPTH] = max(0.0, limits.min_depth - b[2])
            row[MAX_DEPTH] = max(0.0, b[2] - limits.max_depth)
            row[ALTITUDE] = max(0.0, limits.altitude - _clearance(a, b, floor, limits.climb))
            nearest = np.inf
            for k in range(n):
                if k == i:
                    continue
                other = _point(ends, k)
                nearest = min(
                    nearest, np.sqrt((b[0] - other[0]) ** 2 + (b[1] - other[1]) ** 2 + (b[2] - other[2]) ** 2)
                )
                if limits.separation > 0.0:
                    row[SEPARATION] = max(
                        row[SEPARATION], limits.separation - _approach(a, b, _point(origin, k), other, limits)
                    )
            if n > 1 and nearest > limits.com_range:
                row[COM_RANGE] = nearest - limits.com_range


def inside_area(constraints: Constraints, en_m: FloatArray) -> BoolArray:
    """Return which positions (n, 2) lie in the area and in no keep-out zone."""
    east, north = np.asarray(en_m, dtype=np.float64).T
    free: BoolArray = shapely.contains_xy(Polygon(constraints.area), east, north)
    for zone in constraints.keep_out:
        free &= ~shapely.contains_xy(Polygon(zone), east, north)
    return free


def warm_up() -> None:
    """Compile what checks candidates, or load it from the cache of an earlier start."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    Constraints(square).excess(np.zeros((2, 3)), np.zeros((1, 2, 3)), Bottom.unknown())
