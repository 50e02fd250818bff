"""Vehicles with a swath sonar over a known sea floor, in simulated time: straight lines, turning circles, pings."""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray
from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage
from app.exploration.motion.dubins import poses_along, shortest_way
from app.exploration.motion.leg_rules import TURN_S
from app.exploration.swath.raster import Flying
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.holidays import holidays, open_ground, side_of
from app.mapping.types import Grid
from simulator.floors.terrain import Terrain
from simulator.sonars.raycasting import depth_between, march

FASTEST_MPS = 1.5
CRUISE_M = 2.0
MIN_ALTITUDE_M = 1.0
ROLL_SD_RAD = float(np.radians(0.5))
RANGE_NOISE = 0.002
CELL_OF_DEPTH = 0.05
FINEST_M = 0.5

LEAD_S = 2.5
"""So long before a vehicle ends a leg the next one is decided: what is sounded from there on is not known for it."""


@njit(cache=True, nogil=True)
def sounded(
    z_m: FloatArray,
    cell_m: float,
    poses: FloatArray,
    depths_m: FloatArray,
    angles: FloatArray,
    rolls: FloatArray,
    range_m: float,
) -> tuple[FloatArray, FloatArray]:
    """Return horizontal distance to starboard and depth (pings, beams) of what the beams meet; NaN for nothing."""
    n, b = len(poses), len(angles)
    starboard, depth = np.full((n, b), np.nan), np.full((n, b), np.nan)
    shoalest, deepest = np.nanmin(z_m), np.nanmax(z_m)
    directions = np.empty((b, 3))
    for k in range(n):
        east, north, heading = poses[k]
        for i in range(b):
            side = np.sin(angles[i] + rolls[k])
            directions[i, 0] = side * np.cos(heading)
            directions[i, 1] = -side * np.sin(heading)
            directions[i, 2] = np.cos(angles[i] + rolls[k])
        ranges = march(z_m, cell_m, east, north, depths_m[k], directions, shoalest, deepest, range_m)
        for i in range(b):
            starboard[k, i] = ranges[i] * np.sin(angles[i] + rolls[k])
            depth[k, i] = depths_m[k] + ranges[i] * directions[i, 2]
    return starboard, depth


@njit(cache=True, nogil=True)
def _depths(z_m: FloatArray, cell_m: float, poses: FloatArray, cruise_m: float, altitude_m: float) -> FloatArray:
    """Return the depths that a vehicle travels at, (n,)."""
    found = np.zeros(len(poses))
    for k in range(len(poses)):
        floor = depth_between(z_m, cell_m, poses[k, 0], poses[k, 1])
        found[k] = cruise_m if np.isnan(floor) else min(cruise_m, max(floor - altitude_m, 0.0))
    return found


@dataclass(frozen=True)
class CoverageScenario:
    """A survey of all known ground of a terrain.

    Attributes
    ----------
    terrain
    vehicles
        They begin in the south-western corner, 5 m apart.
    sonar
    cell_m
        Side of the nodes.
    overlap
        Share of half a swath that is sounded twice.
    seed
        Of the sonar's and the vehicles' errors.
    """

    terrain: Terrain
    vehicles: int
    sonar: SwathSonar
    cell_m: float
    overlap: float = 0.06
    seed: int = 0

    @property
    def flying(self) -> Flying:
        """How the vehicles fly."""
        return Flying(self.sonar, CRUISE_M, MIN_ALTITUDE_M, TURN_S * FASTEST_MPS, self.overlap)

    @property
    def speed_mps(self) -> float:
        """How fast they fly: all surveys are as dense as that makes them."""
        return min(FASTEST_MPS, self.sonar.speed_mps(self.cell_m))

    @property
    def names(self) -> tuple[str, ...]:
        """The vehicles."""
        return tuple(f"auv-{k + 1}" for k in range(self.vehicles))

    @property
    def grid(self) -> Grid:
        """The nodes."""
        terrain, cell_m = self.terrain, self.cell_m
        rows = int(np.floor(terrain.height_m / cell_m + 1e-9))
        cols = int(np.floor(terrain.width_m / cell_m + 1e-9))
        return Grid(0.0, 0.0, cell_m, rows, cols)

    def true_depth_m(self) -> FloatArray:
        """Return the depths at the nodes, (rows, cols); NaN where the terrain is not known."""
        grid = self.grid
        east, north = np.meshgrid(grid.east_m, grid.north_m)
        return self.terrain.depth_at(east, north)

    def wanted(self) -> BoolArray:
        """Return which nodes are to be ensonified: known ground deep enough to fly over."""
        depth = self.true_depth_m()
        return np.asarray(np.isfinite(depth) & (np.nan_to_num(depth) > MIN_ALTITUDE_M))


def cell_by_depth_m(terrain: Terrain) -> float:
    """Return the usual side of a node: a twentieth of the depth."""
    return max(FINEST_M, CELL_OF_DEPTH * float(np.nanmedian(terrain.z_m)))


@dataclass
class SurveyCraft:
    """One vehicle: its pose (3,), its time, and how far it flew."""

    pose: FloatArray
    time_s: float = 0.0
    flown_m: float = 0.0
    idle_until_s: float = 0.0
    """When it is looked at again, after there was no line for it."""
    unseen: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    """Poses (n, 3) of the pings that come in after its next leg was decided."""
    ends_m: list[FloatArray] = field(default_factory=list)
    """Where its legs ended, each (2,)."""


@dataclass
class Fleet:
    """Vehicles at sea, and what they have ensonified."""

    scenario: CoverageScenario
    density: DensityGrid = field(init=False)
    crafts: dict[str, SurveyCraft] = field(init=False)

    def __post_init__(self) -> None:
        scenario = self.scenario
        self.wanted = scenario.wanted()
        self.density = DensityGrid(scenario.grid, self.wanted)
        self._rng = np.random.default_rng(scenario.seed)
        self._angles = scenario.sonar.angles_rad
        begin = _first_place(scenario, self.wanted)
        self.crafts = {
            name: SurveyCraft(np.array([begin[0] + 5.0 * k, begin[1], 0.0])) for k, name in enumerate(scenario.names)
        }
        for craft in self.crafts.values():
            self._ping(craft.pose[None])

    def coverage(self, prior_m: FloatArray | None = None) -> Coverage:
        """Return what is left to see; ``prior_m`` (rows, cols) are depths that were known before."""
        side = side_of(self.scenario.cell_m, self.scenario.cell_m)
        left = open_ground(self.density.ensonified, self.wanted, side)
        grid = self.density.grid
        depth = self.density.depth_m
        depth = depth if prior_m is None else np.where(np.isfinite(depth), depth, prior_m)
        return Coverage(grid.west_m, grid.south_m, grid.cell_m, self.wanted, self.wanted & ~left, depth).planned_on()

    def fly_to(self, craft: SurveyCraft, place_m: FloatArray, heading_rad: float | None) -> None:
        """Fly to a place (2,): in a shortest way with turning circles where a heading is asked for, else straight."""
        if heading_rad is None:
            poses, length_m = _straight(craft.pose, place_m, self._spacing_m, self.scenario.flying.radius_m)
        else:
            goal = np.array([*place_m, heading_rad])
            radius_m = self.scenario.flying.radius_m
            way = shortest_way(craft.pose, goal, radius_m)
            length_m = way.length_m
            at = np.arange(self._spacing_m, length_m, self._spacing_m)
            poses = np.vstack([poses_along(craft.pose, way, radius_m, at), goal])
        ahead = int(LEAD_S * self.scenario.sonar.rate_hz)
        self.take_in(craft)
        self._ping(poses[:-ahead])
        craft.unseen = poses[-ahead:]
        craft.pose = poses[-1]
        craft.ends_m.append(poses[-1, :2])
        craft.flown_m += length_m
        craft.time_s += length_m / self.scenario.speed_mps

    def take_in(self, craft: SurveyCraft) -> None:
        """Take in what a vehicle has sounded up to where it is."""
        poses, craft.unseen = craft.unseen, np.zeros((0, 3))
        self._ping(poses)

    def fly_along(self, craft: SurveyCraft, path: FloatArray) -> None:
        """Fly a line (k, 2): to its beginning by turning circles, then along it."""
        self.fly_to(craft, path[0], float(np.arctan2(*(path[1] - path[0]))))
        for place in path[1:]:
            self.fly_to(craft, place, None)

    @property
    def _spacing_m(self) -> float:
        return self.scenario.speed_mps / self.scenario.sonar.rate_hz

    def _ping(self, poses: FloatArray) -> None:
        terrain, sonar = self.scenario.terrain, self.scenario.sonar
        depths = _depths(terrain.z_m, terrain.cell_m, poses, CRUISE_M, MIN_ALTITUDE_M)
        rolls = self._rng.normal(0.0, ROLL_SD_RAD, len(poses))
        starboard, depth = sounded(terrain.z_m, terrain.cell_m, poses, depths, self._angles, rolls, sonar.range_m)
        met = np.isfinite(depth)
        ping, _ = np.nonzero(met)
        heading = poses[ping, 2]
        below = depth[met] - depths[ping]
        noisy = depth[met] + RANGE_NOISE * below * self._rng.standard_normal(len(ping))
        self.density.add(
            poses[ping, 0] + starboard[met] * np.cos(heading),
            poses[ping, 1] - starboard[met] * np.sin(heading),
            noisy,
            np.maximum(RANGE_NOISE * below, 0.01),
        )


@dataclass(frozen=True)
class CoverageFlown:
    """How a survey came out."""

    ensonified_pct: float
    holidays: int
    holiday_m2: float
    density_ok_pct: float
    km: float
    minutes: float


def outcome(fleet: Fleet) -> CoverageFlown:
    """Return what a fleet has covered, and how far and how long it flew: the minutes are those of the last one."""
    for craft in fleet.crafts.values():
        fleet.take_in(craft)
    density, scenario = fleet.density, fleet.scenario
    missed = holidays(density.ensonified, fleet.wanted, density.grid, side_of(scenario.cell_m, scenario.cell_m))
    return CoverageFlown(
        ensonified_pct=density.ensonified_pct(),
        holidays=len(missed),
        holiday_m2=float(sum(one.area_m2 for one in missed)),
        density_ok_pct=density.dense_pct(),
        km=sum(craft.flown_m for craft in fleet.crafts.values()) / 1000.0,
        minutes=max(craft.time_s for craft in fleet.crafts.values()) / 60.0,
    )


def _straight(pose: FloatArray, place_m: FloatArray, spacing_m: float, radius_m: float) -> tuple[FloatArray, float]:
    """Return the poses on a straight leg, on which a vehicle turns in no less than its circle."""
    away = place_m - pose[:2]
    length_m = float(np.hypot(*away))
    heading = float(np.arctan2(*away)) if length_m > 1e-9 else float(pose[2])
    at = np.append(np.arange(spacing_m, length_m, spacing_m), length_m)
    places = pose[:2] + (at / max(length_m, 1e-9))[:, None] * away
    off = (float(pose[2]) - heading + np.pi) % (2.0 * np.pi) - np.pi
    still = np.sign(off) * np.maximum(np.abs(off) - at / radius_m, 0.0)
    return np.column_stack([places, heading + still]), length_m


def _first_place(scenario: CoverageScenario, wanted: BoolArray) -> FloatArray:
    """Return the node of the area that is closest to the south-western corner."""
    rows, cols = np.nonzero(wanted)
    k = int(np.argmin(rows + cols))
    grid = scenario.grid
    return np.array([grid.east_m[cols[k]], grid.north_m[rows[k]]])
