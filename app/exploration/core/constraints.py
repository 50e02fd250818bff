"""The constraints C(X) <= 0 of AURO15 section 4.1, in metres: what no proposed team configuration may break.

Each limit of each vehicle has an *excess* in metres: 0 while it is kept, positive by how much it is broken. A limit
that is already broken where the vehicles are now (launched outside the area, pushed there by a current, out of range of
each other) may stay broken only while the move lessens the excess; every other excess must be 0.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.geometry import convex, enters, inside, leaves, signed_distance

TOLERANCE_M = 1e-6
LEG_CHECKS = 4


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

    @property
    def lowest_m(self) -> float:
        """Height above the sea floor below which vehicles never are."""
        return self.min_altitude_m if self.held_altitude_m is None else self.held_altitude_m

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
        vertices, starts = _flatten(self.keep_out)
        limits = np.array(
            [
                self.max_step_m,
                self.min_depth_m,
                self.max_depth_m,
                self.min_altitude_m,
                self.com_range_m,
                self.min_separation_m,
                self.min_vertical_separation_m,
            ],
            dtype=np.float64,
        )
        return _excess(
            np.ascontiguousarray(origin, dtype=np.float64),
            np.ascontiguousarray(candidates, dtype=np.float64),
            np.ascontiguousarray(self.area, dtype=np.float64),
            vertices,
            starts,
            limits,
            np.array([bottom.west_m, bottom.south_m, bottom.cell_m]),
            bottom.depth_m,
        )

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
                    "depth {v:.2f} m is above {a:g} m",
                )
            case Limit.MAX_DEPTH:
                value, allowed, what = (
                    self.max_depth_m + excess_m,
                    self.max_depth_m,
                    "depth {v:.2f} m is below {a:g} m",
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


def _flatten(polygons: tuple[FloatArray, ...]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return all vertices in one array and where each polygon starts (one more entry than polygons)."""
    starts = np.zeros(len(polygons) + 1, dtype=np.int64)
    if not polygons:
        return np.zeros((0, 2)), starts
    starts[1:] = np.cumsum([len(p) for p in polygons])
    return np.ascontiguousarray(np.vstack(polygons), dtype=np.float64), starts


@njit(cache=True, nogil=True)
def _clearance_excess(
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    min_altitude: float,
    frame: FloatArray,
    depth: FloatArray,
) -> float:
    worst = 0.0
    for k in range(1, LEG_CHECKS + 1):
        t = k / LEG_CHECKS
        col = int(np.floor((ax + t * (bx - ax) - frame[0]) / frame[2]))
        row = int(np.floor((ay + t * (by - ay) - frame[1]) / frame[2]))
        if 0 <= row < depth.shape[0] and 0 <= col < depth.shape[1]:
            floor = depth[row, col]
            if not np.isnan(floor):
                worst = max(worst, min_altitude - (floor - az - t * (bz - az)))
    return worst


@njit(cache=True, nogil=True)
def _closest_approach(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> float:
    """Least horizontal distance of two vehicles that go a -> b and c -> d in the same time."""
    rx = a[0] - c[0]
    ry = a[1] - c[1]
    vx = (b[0] - a[0]) - (d[0] - c[0])
    vy = (b[1] - a[1]) - (d[1] - c[1])
    v2 = vx * vx + vy * vy
    t = 0.0
    if v2 > 0.0:
        t = min(1.0, max(0.0, -(rx * vx + ry * vy) / v2))
    return float(np.hypot(rx + t * vx, ry + t * vy))


@njit(cache=True, nogil=True)
def _excess(
    origin: FloatArray,
    candidates: FloatArray,
    area: FloatArray,
    keep_out: FloatArray,
    starts: NDArray[np.int64],
    limits: FloatArray,
    frame: FloatArray,
    depth: FloatArray,
) -> FloatArray:
    n_candidates, n, _ = candidates.shape
    out = np.zeros((n_candidates, n, 10))
    area_now = np.empty(n)
    round_area = convex(area)
    outside_now = np.empty((n, len(starts) - 1))
    for i in range(n):
        area_now[i] = signed_distance(area, origin[i, 0], origin[i, 1])
        for z in range(len(starts) - 1):
            zone = keep_out[starts[z] : starts[z + 1]]
            outside_now[i, z] = signed_distance(zone, origin[i, 0], origin[i, 1])
    for c in range(n_candidates):
        for i in range(n):
            ax, ay, az = origin[i, 0], origin[i, 1], origin[i, 2]
            bx, by, bz = candidates[c, i, 0], candidates[c, i, 1], candidates[c, i, 2]
            outside = signed_distance(area, bx, by)
            out[c, i, 0] = max(0.0, outside)
            within = area_now[i] <= 1e-6 and outside <= 1e-6
            if within and not round_area and leaves(area, ax, ay, bx, by, 1e-6):
                out[c, i, 1] = np.inf
            for z in range(len(starts) - 1):
                zone = keep_out[starts[z] : starts[z + 1]]
                out[c, i, 2] = max(out[c, i, 2], -signed_distance(zone, bx, by))
                if outside_now[i, z] >= -1e-6 and enters(zone, ax, ay, bx, by, 1e-6):
                    out[c, i, 3] = np.inf
            out[c, i, 2] = max(0.0, out[c, i, 2])
            step = np.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2)
            out[c, i, 4] = max(0.0, step - limits[0])
            out[c, i, 5] = max(0.0, limits[1] - bz)
            out[c, i, 6] = max(0.0, bz - limits[2])
            out[c, i, 7] = _clearance_excess(ax, ay, az, bx, by, bz, limits[3], frame, depth)
            if n > 1:
                nearest = np.inf
                for k in range(n):
                    if k == i:
                        continue
                    other = candidates[c, k]
                    d3 = np.sqrt((bx - other[0]) ** 2 + (by - other[1]) ** 2 + (bz - other[2]) ** 2)
                    nearest = min(nearest, d3)
                    if limits[5] <= 0.0:
                        continue
                    gap_now = az - origin[k, 2]
                    gap = bz - other[2]
                    if abs(gap) >= limits[6] and abs(gap_now) >= limits[6] and gap * gap_now > 0.0:
                        continue
                    here = np.hypot(ax - origin[k, 0], ay - origin[k, 1])
                    if here < limits[5]:  # already too close: what counts is where they end
                        approach = np.hypot(bx - other[0], by - other[1])
                        if abs(gap) >= limits[6]:
                            continue
                    else:
                        approach = _closest_approach(origin[i], candidates[c, i], origin[k], other)
                    out[c, i, 9] = max(out[c, i, 9], limits[5] - approach)
                if nearest > limits[4]:
                    out[c, i, 8] = nearest - limits[4]
    return out


def inside_area(constraints: Constraints, en_m: FloatArray) -> BoolArray:
    """Return which positions (n, 2) lie in the area and in no keep-out zone."""
    zones = tuple(np.ascontiguousarray(z, dtype=np.float64) for z in constraints.keep_out)
    return _inside_area(np.ascontiguousarray(en_m), np.ascontiguousarray(constraints.area), *_flatten(zones))


@njit(cache=True, nogil=True)
def _inside_area(points: FloatArray, area: FloatArray, keep_out: FloatArray, starts: NDArray[np.int64]) -> BoolArray:
    result = np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        free = inside(area, x, y)
        for z in range(len(starts) - 1):
            free = free and not inside(keep_out[starts[z] : starts[z + 1]], x, y)
        result[i] = free
    return result
