"""The papers' scenario without a network: a team in the cube [-1, 1]^3 over a known terrain, ranging to landmarks.

Lengths have no unit there; the fields keep their metre names. Heights above the sea floor are negative depths.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation import LandmarkEstimator, Landmarks, RangeSensor, in_sight, landmark_sets
from app.evaluation.explore.keep_out import draw_keep_out
from app.evaluation.explore.team_changes import TeamSchedule, launch_site
from app.exploration.communication.messages import MAX_LANDMARKS, MAX_VEHICLES
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.objective import Objective, ObjectiveWeights, VehicleProgress, objective
from app.exploration.core.problem import Belief
from simulator.floors.terrain import Terrain

CLEARANCE = 0.05
MAX_STEP = 0.05
COM_RANGE = 0.3
DEEPEST, SHALLOWEST = 1.0, 0.2
CEILING = -1.0
START_HEIGHT = 0.2
START_CORNER, START_SPREAD = -0.8, 0.1
NO_CHANGES = TeamSchedule()


@dataclass(frozen=True, eq=False)
class CubeTerrain:
    """A terrain cast into the cube: the longer side to [-1, 1], depths linearly to [0.2, 1]."""

    terrain: Terrain

    @property
    def half(self) -> FloatArray:
        """Half the extent in x and y, (2,)."""
        size = np.array([self.terrain.width_m, self.terrain.height_m])
        return np.asarray(size / size.max())

    @property
    def area(self) -> FloatArray:
        """The terrain's rectangle, (4, 2)."""
        x, y = self.half
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])

    def depth_at(self, xy: FloatArray) -> FloatArray:
        """Return depths at positions (..., 2); NaN where the terrain is unknown."""
        t = self.terrain
        metres = (np.asarray(xy) / self.half + 1.0) / 2.0 * np.array([t.width_m, t.height_m])
        metres = np.clip(metres, 0.0, [t.width_m, t.height_m])
        return self._cast(t.depth_at(metres[..., 0], metres[..., 1]))

    @cached_property
    def raster(self) -> FloatArray:
        """Depths at the cell centres, (rows, cols); NaN where unknown."""
        return self._cast(self.terrain.z_m)

    @property
    def cell(self) -> float:
        """Side of a cell of the raster."""
        return 2.0 * self.terrain.cell_m / max(self.terrain.width_m, self.terrain.height_m)

    @property
    def known_cells(self) -> FloatArray:
        """Centres and depths (n, 3) of the cells whose depth is known, row by row."""
        rows, cols = np.nonzero(np.isfinite(self.raster))
        centres = np.column_stack([cols + 0.5, rows + 0.5]) * self.cell - self.half
        return np.column_stack([centres, self.raster[rows, cols]])

    def in_sight(self, positions: FloatArray, landmarks: FloatArray) -> BoolArray:
        """Return which vehicle (n, 3) sees which landmark (m, 3) over the terrain, (n, m)."""
        west, south = (float(x) for x in -self.half)
        return in_sight(positions, landmarks, self.raster, west, south, self.cell)

    def _cast(self, depth_m: FloatArray) -> FloatArray:
        t = self.terrain
        relief = max(t.max_depth_m - t.min_depth_m, 1e-12)
        return np.asarray(SHALLOWEST + (DEEPEST - SHALLOWEST) * (depth_m - t.min_depth_m) / relief)


@dataclass(frozen=True, eq=False)
class ExploreScenario:
    """The papers' experiment; constants of MED13 and AURO15, where they are silent those that reproduce them.

    Attributes
    ----------
    terrain : Terrain
        Cast into the cube.
    robots : int
        Size of the team at the start.
    landmarks : int or None
        How many, spread at random; None: one in the middle of every cell of known depth (AURO15's "every pixel").
    steps : int
        Length of the run.
    seed : int
        Of everything random.
    com_range : float
        Each vehicle has another within it.
    keep_out_fraction : float
        Part of the area covered by keep-out zones; no landmarks there.
    changes : TeamChanges
        Vehicles that are lost and that join.
    line_of_sight : bool
        Whether the true sea floor hides what lies behind it.
    capacity : int or None
        Most landmark entries in a message between a vehicle and the station; None: all knowledge is shared.
    message_loss : float
        Probability that a message is lost; only with a capacity.
    estimator : LandmarkEstimator or None
        What makes depths of ranges; None: the default, with the scenario's sensor.
    """

    terrain: Terrain
    robots: int = 3
    landmarks: int | None = 1100
    steps: int = 500
    seed: int = 0
    com_range: float = COM_RANGE
    sensor: RangeSensor = RangeSensor()  # noqa: RUF009 - frozen
    keep_out_fraction: float = 0.0
    changes: TeamSchedule = NO_CHANGES
    line_of_sight: bool = False
    capacity: int | None = None
    message_loss: float = 0.0
    estimator: LandmarkEstimator | None = None

    def __post_init__(self) -> None:
        self.changes.check(self.robots, self.steps)
        self._check_messages()
        _ = self.constraints  # draws the zones, which may not fit

    def _check_messages(self) -> None:
        if self.capacity is None:
            if self.message_loss > 0.0:
                raise ValueError("message loss: only messages of a limited capacity can be lost; set a capacity too")
            return
        count = np.isfinite(self.terrain.z_m).sum() if self.landmarks is None else self.landmarks
        if count > MAX_LANDMARKS:
            raise ValueError(f"capacity: messages can name {MAX_LANDMARKS} landmarks, not {count}; use fewer landmarks")
        vehicles = self.robots + sum(number for number, _ in self.changes.joining)
        if vehicles > MAX_VEHICLES:
            raise ValueError(
                f"capacity: messages can name {MAX_VEHICLES} vehicles, not {vehicles}; "
                f"let {vehicles - MAX_VEHICLES} fewer join or take part, or leave the capacity out"
            )

    @cached_property
    def constraints(self) -> Constraints:
        """The limits in the cube."""
        cube = CubeTerrain(self.terrain)
        middle = START_CORNER * cube.half
        return Constraints(
            cube.area,
            draw_keep_out(
                cube.half,
                self.keep_out_fraction,
                np.array([middle - START_SPREAD, middle + START_SPREAD]),
                np.random.default_rng([self.seed, 3]),
            ),
            max_step_m=MAX_STEP,
            min_depth_m=CEILING,
            max_depth_m=DEEPEST,
            min_altitude_m=CLEARANCE,
            com_range_m=self.com_range,
        )


class World:
    """The truth: where the bottom is, what the sensors measure. ``landmarks`` is what the team knows.

    ``team`` (n_vehicles,) are the numbers of the vehicles that are there, counted from 0 in the order of their joining,
    which never change their meaning; ``positions`` (n_vehicles, 3) is where these are.
    """

    def __init__(self, scenario: ExploreScenario) -> None:
        self.scenario = scenario
        self.cube = CubeTerrain(scenario.terrain)
        rng = np.random.default_rng([scenario.seed, 0])
        self.truth = self._scatter(rng)
        self.landmarks = Landmarks.unknown(self.truth[:, :2])
        self.estimator = scenario.estimator or LandmarkEstimator(scenario.sensor)
        start = START_CORNER * self.cube.half + rng.uniform(-START_SPREAD, START_SPREAD, (scenario.robots, 2))
        floor = np.nan_to_num(self.cube.depth_at(start), nan=DEEPEST)
        self.positions = np.column_stack([start, floor - START_HEIGHT])
        self.team = np.arange(scenario.robots)
        self._joined = scenario.robots
        self._launches = np.random.default_rng([scenario.seed, 4])

    def _scatter(self, rng: np.random.Generator) -> FloatArray:
        """Return landmarks (n, 3) on the known terrain outside the keep-out zones, at random or one per cell."""
        constraints, n = self.scenario.constraints, self.scenario.landmarks
        if n is None:
            cells = self.cube.known_cells
            return cells[inside_area(constraints, cells[:, :2])]
        chosen = np.zeros((0, 3))
        while len(chosen) < n:
            xy = rng.uniform(-1.0, 1.0, (2 * n, 2)) * self.cube.half
            drawn = np.column_stack([xy, self.cube.depth_at(xy)])
            chosen = np.vstack([chosen, drawn[np.isfinite(drawn[:, 2]) & inside_area(constraints, xy)]])
        return chosen[:n]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles that are there, in the order of ``positions``."""
        return names_of(self.team)

    def change_team(self, step: int) -> None:
        """Take away and add the vehicles that the scenario loses and joins when a step begins."""
        changes = self.scenario.changes
        stays = ~np.isin(self.team + 1, list(changes.lost_at(step)))
        self.team, self.positions = self.team[stays], self.positions[stays]
        for _ in range(changes.joining_at(step)):
            heights = self.cube.depth_at(self.positions[:, :2]) - self.positions[:, 2]
            site = launch_site(self.positions, heights, self.scenario.constraints, self.cube.depth_at, self._launches)
            self.positions = np.vstack([self.positions, site])
            self.team = np.append(self.team, self._joined)
            self._joined += 1

    def visible(self, positions: FloatArray) -> BoolArray:
        """Return which landmark is seen from which position (n, 3), as a matrix (n, n_landmarks)."""
        near = self.scenario.sensor.visible(positions, self.truth)
        if not self.scenario.line_of_sight:
            return near
        for position, seen in zip(positions, near, strict=True):
            seen[seen] = self.cube.in_sight(position[None], self.truth[seen])[0]
        return near

    def measure(self, positions: FloatArray, landmarks: Landmarks, rng: np.random.Generator) -> Landmarks:
        """Return what is known after every vehicle of the team has ranged to what it sees from ``positions``."""
        visible_by = self.visible(positions)
        for number, position, seen in zip(self.team, positions, visible_by, strict=True):
            index = np.flatnonzero(seen)
            ranges = self.scenario.sensor.measure(position, self.truth[index], rng)
            landmarks = self.estimator.update(landmarks, int(number), position, index, ranges)
        return landmarks

    def broken(self, positions: FloatArray) -> int:
        """Return how many vehicles break a constraint by going from where they are to ``positions`` (n, 3).

        What was broken before does not count while the move lessens it. The clearance above the true bottom is kept by
        the altimeters; what the lift costs shows in the length of the step and in the links.
        """
        violations = self.scenario.constraints.violations(self.names, self.positions, positions, Bottom.unknown())
        return len({violation.vehicle for violation in violations})

    def clear(self, positions: FloatArray) -> FloatArray:
        """Return the configuration, vehicles lifted to the clearance above the true bottom as their altimeters do."""
        floor = self.cube.depth_at(positions[:, :2])
        lifted = positions.copy()
        lifted[:, 2] = np.fmin(positions[:, 2], floor - CLEARANCE)
        return lifted

    @property
    def belief(self) -> Belief:
        """The planner's view."""
        k = self.landmarks
        return Belief(k.xy_m, k.depth_m, np.sqrt(k.variance_m2), k.accurate, np.ones(len(k.xy_m)), 0.2)

    def evaluate(
        self,
        positions: FloatArray,
        landmarks: Landmarks,
        before: int,
        progress: list[VehicleProgress],
        weights: ObjectiveWeights = ObjectiveWeights(),  # noqa: B008 - frozen
    ) -> Objective:
        """Return eq. (9) at a configuration after its measurements, with what the landmarks are known to be."""
        points = np.column_stack([landmarks.xy_m, landmarks.depth_m])
        sets = landmark_sets(landmarks, self.visible(positions), self.team)
        earlier, last = progress[-2:] if len(progress) >= 2 else (None, None)
        return objective(positions, points, sets, before, earlier, last, weights)


def names_of(vehicles: IntArray) -> tuple[str, ...]:
    """Return the names of vehicles by number, counted from 0."""
    return tuple(f"auv-{k + 1}" for k in vehicles)
