"""The papers' scenario without a network: a team in the cube [-1, 1]^3 over a known terrain, ranging to landmarks.

Lengths have no unit there; the fields keep their metre names. Heights above the sea floor are negative depths.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.estimation import LandmarkEstimator, Landmarks, RangeSensor, landmark_sets
from app.exploration.constraints import Constraints
from app.exploration.objective import Objective, VehicleProgress, objective
from app.exploration.problem import Belief
from simulator.terrain import Terrain

FloatArray = NDArray[np.float64]

CLEARANCE = 0.05
MAX_STEP = 0.05
COM_RANGE = 0.3
DEEPEST, SHALLOWEST = 1.0, 0.2
CEILING = -1.0
START_HEIGHT = 0.2


@dataclass(frozen=True)
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
        relief = max(t.max_depth_m - t.min_depth_m, 1e-12)
        fraction = (t.depth_at(metres[..., 0], metres[..., 1]) - t.min_depth_m) / relief
        return np.asarray(SHALLOWEST + (DEEPEST - SHALLOWEST) * fraction)


@dataclass(frozen=True)
class ExploreScenario:
    """The papers' experiment; constants of MED13 and AURO15, where they are silent those that reproduce them.

    Attributes
    ----------
    terrain : Terrain
        Cast into the cube.
    robots, landmarks, steps : int
        Team size, number of landmarks (spread at random), length of the run.
    seed : int
        Of landmarks, start and noise.
    com_range : float
        Each vehicle has another within it.
    """

    terrain: Terrain
    robots: int = 3
    landmarks: int = 1100
    steps: int = 500
    seed: int = 0
    com_range: float = COM_RANGE
    sensor: RangeSensor = RangeSensor()  # noqa: RUF009 - frozen

    @property
    def constraints(self) -> Constraints:
        """The limits in the cube."""
        return Constraints(
            CubeTerrain(self.terrain).area,
            max_step_m=MAX_STEP,
            min_depth_m=CEILING,
            max_depth_m=DEEPEST,
            min_altitude_m=CLEARANCE,
            com_range_m=self.com_range,
        )


class World:
    """The truth: where the bottom is, what the sensors hear. ``landmarks`` is what the team knows."""

    def __init__(self, scenario: ExploreScenario) -> None:
        self.scenario = scenario
        self.cube = CubeTerrain(scenario.terrain)
        rng = np.random.default_rng([scenario.seed, 0])
        xy = self._scatter(rng)
        self.truth = np.column_stack([xy, self.cube.depth_at(xy)])
        self.landmarks = Landmarks.unknown(xy)
        self.estimator = LandmarkEstimator(scenario.sensor)
        start = -0.8 * self.cube.half + rng.uniform(-0.1, 0.1, (scenario.robots, 2))
        floor = np.nan_to_num(self.cube.depth_at(start), nan=DEEPEST)
        self.positions = np.column_stack([start, floor - START_HEIGHT])

    def _scatter(self, rng: np.random.Generator) -> FloatArray:
        """Return landmarks spread evenly at random over the known terrain."""
        n, chosen = self.scenario.landmarks, np.zeros((0, 2))
        while len(chosen) < n:
            xy = rng.uniform(-1.0, 1.0, (2 * n, 2)) * self.cube.half
            chosen = np.vstack([chosen, xy[np.isfinite(self.cube.depth_at(xy))]])
        return chosen[:n]

    def measure(self, positions: FloatArray, landmarks: Landmarks, rng: np.random.Generator) -> Landmarks:
        """Return what is known after every vehicle has ranged to what it sees from ``positions``."""
        visible_by = self.scenario.sensor.visible(positions, self.truth)
        for j, position in enumerate(positions):
            index = np.flatnonzero(visible_by[j])
            ranges = self.scenario.sensor.measure(position, self.truth[index], rng)
            landmarks = self.estimator.update(landmarks, j, position, index, ranges)
        return landmarks

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
        self, positions: FloatArray, landmarks: Landmarks, before: int, progress: list[VehicleProgress]
    ) -> Objective:
        """Return eq. (9) at a configuration after its measurements, with what the landmarks are known to be."""
        points = np.column_stack([landmarks.xy_m, landmarks.depth_m])
        sets = landmark_sets(landmarks, self.scenario.sensor.visible(positions, self.truth))
        earlier, last = progress[-2:] if len(progress) >= 2 else (None, None)
        return objective(positions, points, sets, before, earlier, last)
