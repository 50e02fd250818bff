"""The field experiment without a network: vehicles on straight legs over a known terrain, sounding as they go."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from app.arrays import FloatArray
from app.estimation import Attitude, Multibeam, SingleBeam
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gross_errors.outliers import OutlierReport
from app.mapping.types import BathymetricMap, Grid, Soundings
from simulator.floors.terrain import Terrain

Sampling = Literal["step", "continuous"]
Sounder = Literal["single", "dvl", "swath"]
SIDE_BEAM_RAD = float(np.radians(22.5))
SWATH_RAD, SWATH_BEAMS = float(np.radians(90.0)), 5

SPEED_MPS = 1.3
SOUNDING_RATE_HZ = 5.0
FIRST_DEPTH_M = 2.0
MIN_ALTITUDE_M = 0.5
SHALLOW_M = 2.0
FAR_M = 1e6
BELIEF_NODES_PER_SIDE = 50
MAPS = 20
"""How often the belief is brought up to date in a mission."""
LEAST_LEFT_M = 0.1
"""Who has less than this left to fly is done."""
LONGEST = 2
"""Missions by metres take at most this many times the legs that they would if all were as long as they may be."""
LEARN_AT = (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8)
"""Parts of the mission after which the map's hyperparameters are learned again; between them they are kept."""


@dataclass(frozen=True)
class SurveyScenario:
    """A survey of a whole terrain.

    Attributes
    ----------
    terrain : Terrain
        The true sea floor; the area is its rectangle.
    vehicles : int
        Size of the team, starting in the south-west corner, 5 m apart.
    steps : int
        Steps of the mission; sounding along legs every vehicle flies the metres that these would be at most.
    max_step_m : float
        Largest leg.
    sampling : "step" or "continuous"
        One sounding at the end of every leg, or 5 Hz at 1.3 m/s along it.
    relative_noise : float
        Of a sounding's range to the bottom.
    seed : int
        Of everything random.
    sounder : "single", "dvl" or "swath"
        One beam down; that and two DVL beams to the sides; five beams across the way.
    symmetry : int
        By which symmetry of the square ``terrain`` was turned from how its file has it; for the report.
    """

    terrain: Terrain
    vehicles: int = 2
    steps: int = 100
    max_step_m: float = 10.0
    sampling: Sampling = "continuous"
    relative_noise: float = 0.01
    seed: int = 0
    sounder: Sounder = "single"
    symmetry: int = 0

    def log(self, stream: int) -> "Log":
        """Return an empty log; ``stream`` separates the random numbers of surveys under one seed."""
        beams = None
        if self.sounder == "dvl":
            beams = Multibeam(self.relative_noise, count=3, swath_rad=2 * SIDE_BEAM_RAD)
        elif self.sounder == "swath":
            beams = Multibeam(self.relative_noise, count=SWATH_BEAMS, swath_rad=SWATH_RAD)
        return Log(SingleBeam(self.relative_noise), self.terrain, np.random.default_rng([self.seed, stream]), beams)

    @property
    def area_m(self) -> FloatArray:
        """The terrain's rectangle, (4, 2)."""
        w, h = self.terrain.width_m, self.terrain.height_m
        return np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])

    @property
    def constraints(self) -> Constraints:
        """The limits of the mission; where it is shallow vehicles stay at the surface, whatever the map says."""
        altitude = MIN_ALTITUDE_M if self.terrain.min_depth_m >= SHALLOW_M else -FAR_M
        return Constraints(
            self.area_m, max_step_m=self.max_step_m, max_depth_m=50.0, min_altitude_m=altitude, min_depth_m=0.0
        )

    @property
    def starts_m(self) -> FloatArray:
        """Where the vehicles start, (vehicles, 3): 2 m from the corner, 5 m apart, each 1 m deeper than the last."""
        k = np.arange(self.vehicles)
        gap = min(5.0, (self.terrain.width_m - 4.0) / max(1, self.vehicles))
        depth = np.minimum(FIRST_DEPTH_M + k, max(0.2, self.terrain.min_depth_m - MIN_ALTITUDE_M))
        return np.column_stack([2.0 + gap * k, np.full(self.vehicles, 2.0), depth])

    @property
    def grid(self) -> Grid:
        """The grid of the map that is judged: about 1 m."""
        return terrain_grid(self.terrain)

    @property
    def belief_grid(self) -> Grid:
        """The coarser grid whose nodes are the planner's landmarks."""
        t = self.terrain
        cell = max(t.width_m, t.height_m) / BELIEF_NODES_PER_SIDE
        return Grid(0.0, 0.0, cell, max(1, int(np.ceil(t.height_m / cell))), max(1, int(np.ceil(t.width_m / cell))))


def terrain_grid(terrain: Terrain) -> Grid:
    """Return the grid over a terrain on which maps are judged: cells of about 1 m."""
    cell = max(1.0, max(terrain.width_m, terrain.height_m) / 200.0)
    return Grid(0.0, 0.0, cell, max(1, int(terrain.height_m / cell)), max(1, int(terrain.width_m / cell)))


@dataclass
class Log:
    """Soundings taken, growing; with ``beams`` every sounding is a ping of several."""

    sensor: SingleBeam
    terrain: Terrain
    rng: np.random.Generator
    beams: Multibeam | None = None
    east_m: list[FloatArray] = field(default_factory=list)
    north_m: list[FloatArray] = field(default_factory=list)
    depth_m: list[FloatArray] = field(default_factory=list)
    sd_m: list[FloatArray] = field(default_factory=list)
    single: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Soundings that came one by one since somebody asked for all of them, after those in the columns."""

    def sound(self, points: FloatArray, headings_rad: FloatArray | None = None) -> None:
        """Sound from vehicle positions (n, 3); there is no echo where the terrain is unknown.

        ``headings_rad`` (n,), clockwise from north, say where beams to the sides point; without them, or where they are
        NaN, only the beam down has an echo.
        """
        bottom = self.terrain.depth_at(points[:, 0], points[:, 1])
        aside = np.zeros(len(points), dtype=np.bool_)
        if self.beams is not None and headings_rad is not None:
            aside = np.isfinite(headings_rad)
            for point, heading in zip(points[aside], headings_rad[aside], strict=True):
                self._ping(self.beams, point, float(heading))
        heard = np.isfinite(bottom) & ~aside
        points, bottom = points[heard], bottom[heard]
        depth = self.sensor.measure(points[:, 2], bottom, self.rng)
        self.east_m.append(points[:, 0])
        self.north_m.append(points[:, 1])
        self.depth_m.append(depth)
        self.sd_m.append(self.sensor.sd_m(points[:, 2], depth))

    def add(self, east_m: float, north_m: float, depth_m: float, sd_m: float) -> None:
        """Take in one sounding that a vehicle took by itself."""
        self.single.append((east_m, north_m, depth_m, sd_m))

    def _ping(self, beams: Multibeam, point: FloatArray, heading_rad: float) -> None:
        def floor(en_m: FloatArray) -> FloatArray:
            return self.terrain.depth_at(en_m[..., 0], en_m[..., 1])

        echoes = beams.sound(point, Attitude(heading_rad), floor, self.terrain.cell_m, self.rng)
        self.east_m.append(echoes.east_m)
        self.north_m.append(echoes.north_m)
        self.depth_m.append(echoes.depth_m)
        self.sd_m.append(echoes.sd_m)

    @property
    def soundings(self) -> Soundings:
        """All of them."""
        columns = (self.east_m, self.north_m, self.depth_m, self.sd_m)
        if self.single:
            for column, values in zip(columns, np.array(self.single).T, strict=True):
                column.append(values)
            self.single.clear()
        for column in columns:
            column[:] = [np.concatenate(column)] if column else [np.zeros(0)]
        return Soundings(*(column[0] for column in columns))


def along(start: FloatArray, end: FloatArray, sampling: Sampling, since_m: float = 0.0) -> tuple[FloatArray, float]:
    """Return the positions (n, 3) at which a vehicle sounds on the leg, its start left out, and the way since the last.

    ``since_m`` is that way at the start: a sounder does not restart with each leg.
    """
    if sampling == "step":
        return end[None], 0.0
    gap, length = SPEED_MPS / SOUNDING_RATE_HZ, float(np.linalg.norm(end - start))
    at = np.arange(gap - since_m, length + 1e-9, gap)
    points = start + (at / max(length, 1e-12))[:, None] * (end - start)
    return points, length - float(at[-1]) if len(at) else since_m + length


def default_map(soundings: Soundings, grid: Grid) -> BathymetricMap:
    """Return the default map, its kernel chosen by the likelihood."""
    return GaussianProcessMap(claims=False).fit(soundings).predict(grid)


def stationary_map(soundings: Soundings, grid: Grid) -> BathymetricMap:
    """Return what a Gaussian process with a Matern 3/2 kernel and learned hyperparameters makes of the soundings."""
    return GaussianProcessMap("matern32", nonstationary=False, claims=False).fit(soundings).predict(grid)


def rmse_m(estimate: BathymetricMap, terrain: Terrain) -> tuple[float, float]:
    """Return the root mean square and the L2 norm of the error over all cells whose true depth is known."""
    centres = estimate.grid.centres_m
    difference = estimate.depth_m.ravel() - terrain.depth_at(centres[:, 0], centres[:, 1])
    difference = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(difference**2))), float(np.linalg.norm(difference))


@dataclass(frozen=True)
class SurveyTrack:
    """A survey that was flown: positions after every step (steps + 1, vehicles, 3), soundings and planning times."""

    positions_m: FloatArray
    soundings: Soundings
    plan_s: FloatArray

    @property
    def distance_m(self) -> FloatArray:
        """Travelled by each vehicle, (vehicles,)."""
        return np.asarray(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=2).sum(axis=0))


class MapSoFar:
    """A planner's view of the sea floor, brought up to date ``MAPS`` times in a mission.

    Attributes
    ----------
    belief
        What is known; an oracle is given it from the beginning.
    """

    def __init__(self, grid: Grid, known: Belief | None = None) -> None:
        self.belief = unknown_belief(grid) if known is None else known
        self._grid, self._fixed = grid, known is not None
        self._gp = GaussianProcessMap(claims=False)
        self._verdict: OutlierReport | None = None
        self._maps = self._learned = 0

    def renew(self, log: Log, part: float) -> bool:
        """Make a map when it is time, after this ``part`` of the mission; whether one was made."""
        learns = part >= LEARN_AT[min(self._learned, len(LEARN_AT) - 1)] and self._learned < len(LEARN_AT)
        if not self._fixed and len(log.soundings) and (learns or int(part * MAPS) > self._maps):
            estimate = self._gp.fit(log.soundings, learn=learns).predict(self._grid)
            self.belief, self._verdict = belief_of(estimate), self._gp.outliers_
            self._maps, self._learned = int(part * MAPS), self._learned + learns
            return True
        return False

    def sounded(self, log: Log) -> tuple[FloatArray, FloatArray]:
        """Return where the map has soundings (n, 2), and where it left them out (k, 2)."""
        soundings = log.soundings
        doubted = np.zeros(len(soundings), dtype=np.bool_)
        if self._verdict is not None:
            doubted[: len(self._verdict.rejected)] = self._verdict.rejected
        places = np.column_stack([soundings.east_m, soundings.north_m])
        return places[~doubted], places[doubted]


def fly_planner(
    scenario: SurveyScenario,
    planner: str,
    options: PlannerOptions,
    progress: Callable[[int], None] = lambda step: None,
    known: Belief | None = None,
) -> SurveyTrack:
    """Run the closed loop: belief from the default map, planner, legs, soundings.

    ``progress`` is called every step. An oracle is given ``known`` instead of what it has sounded.
    """
    sensor = SingleBeam(scenario.relative_noise)
    chooser = create_planner(planner, options, sensor)
    rng, log = np.random.default_rng([scenario.seed, 0]), scenario.log(1)
    positions = scenario.starts_m
    log.sound(positions)
    so_far = MapSoFar(scenario.belief_grid, known)
    names = tuple(f"auv-{k + 1}" for k in range(scenario.vehicles))
    headings, since = np.full(scenario.vehicles, np.nan), np.zeros(scenario.vehicles)
    history, times = [positions], []
    budget_m = scenario.steps * scenario.max_step_m
    left_m = np.full(scenario.vehicles, budget_m)
    by_metres = scenario.sampling == "continuous"
    step = 0
    while (left_m > LEAST_LEFT_M).any() and step < LONGEST * scenario.steps:
        step += 1
        so_far.renew(log, 1.0 - float(left_m.mean()) / budget_m)
        sounded_m, doubtful_m = so_far.sounded(log)
        situation = Situation(
            min(step, scenario.steps),
            scenario.steps,
            names,
            positions,
            headings,
            so_far.belief,
            sounded_m,
            scenario.constraints,
            doubtful_en_m=doubtful_m,
            moving=left_m > LEAST_LEFT_M if by_metres else None,
            left_m=left_m if by_metres else None,
        )
        begun = time.perf_counter()
        proposal = chooser.propose(situation, rng)
        times.append(time.perf_counter() - begun)
        leg = proposal.positions - positions
        moved = np.hypot(leg[:, 0], leg[:, 1]) > 1e-6
        headings = np.where(moved, np.arctan2(leg[:, 0], leg[:, 1]), headings)
        for i, heading in enumerate(headings):
            if moved[i] or not by_metres:
                points, since[i] = along(positions[i], proposal.positions[i], scenario.sampling, since[i])
                log.sound(points, np.full(len(points), heading))
        positions = proposal.positions
        left_m = left_m - (np.linalg.norm(leg, axis=1) if by_metres else scenario.max_step_m)
        history.append(positions)
        progress(min(step, scenario.steps))
        if by_metres and not moved.any():
            break
    return SurveyTrack(np.array(history), log.soundings, np.array(times))


def fly_routes(
    log: Log, starts_m: FloatArray, routes: list[FloatArray], distance_m: float, spacing_m: float
) -> FloatArray:
    """Fly given routes from ``starts_m`` (n, 3) for at most ``distance_m`` each; return the distances flown (n,).

    Soundings are taken every ``spacing_m`` and go to ``log``.
    """
    flown = np.zeros(len(routes))
    for i, (start, route) in enumerate(zip(starts_m, routes, strict=True)):
        corners = np.vstack([start[:2], route])
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        flown[i] = min(distance_m, float(at[-1]))
        stops = np.arange(0.0, flown[i] + 1e-9, spacing_m)
        points = np.column_stack([np.interp(stops, at, corners[:, k]) for k in (0, 1)])
        part = np.clip(np.searchsorted(at, stops, side="left") - 1, 0, max(0, len(corners) - 2))
        leg = np.diff(corners, axis=0)[part] if len(corners) > 1 else np.full((len(stops), 2), np.nan)
        headings = np.where(np.hypot(leg[:, 0], leg[:, 1]) > 1e-9, np.arctan2(leg[:, 0], leg[:, 1]), np.nan)
        log.sound(np.column_stack([points, np.full(len(points), start[2])]), headings)
    return flown


def unknown_belief(grid: Grid) -> Belief:
    """Return what is known before the first sounding: nothing."""
    xy = grid.centres_m
    n = len(xy)
    extent = float(np.ptp(xy, axis=0).max())
    return Belief(
        xy,
        np.full(n, np.nan),
        np.full(n, np.inf),
        np.zeros(n, dtype=np.bool_),
        np.ones(n),
        correlation_length_m=0.2 * extent,
    )


def belief_of(estimate: BathymetricMap) -> Belief:
    """Return the planner's view of a map: its nodes are the landmarks, roughness their weight."""
    n = estimate.depth_m.size
    return Belief(
        estimate.grid.centres_m,
        estimate.depth_m.ravel(),
        estimate.planning_sd_m.ravel(),
        np.zeros(n, dtype=np.bool_),
        np.where(np.isfinite(estimate.roughness), estimate.roughness, 1.0).ravel(),
        estimate.correlation_length_m,
    )
