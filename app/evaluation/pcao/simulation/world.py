"""PCAO18's experiment as it is drawn: a sea floor in the cube, landmarks, starts, a sonar (table I)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt

from app.arrays import FloatArray
from app.estimation.beams import Multibeam
from app.evaluation.explore.world import (
    CEILING,
    CLEARANCE,
    DEEPEST,
    MAX_STEP,
    SHALLOWEST,
    START_CORNER,
    START_HEIGHT,
    START_SPREAD,
    CubeTerrain,
)  # fmt: skip
from app.evaluation.pcao.simulation.kernel import Physics
from simulator.floors.terrain import Terrain

LANDMARKS = 1100
STEPS = 500
ROBOTS = 3
ACCURACY_SD = 0.02
VISIT_CAP = 200
PRIOR_SD = (DEEPEST - SHALLOWEST) / np.sqrt(12.0)
"""Deviation of a depth of which nothing is known but the cube's range."""

SONAR = Multibeam(
    relative_noise=0.1, max_range_m=0.4, beam_width_rad=float(np.radians(20.0)), count=16,
    swath_rad=float(np.radians(120.0)),
)  # fmt: skip
UNIT = 0.1
"""Half of what a vehicle maps to its sides in one pass, which the controller's state is measured in."""


@dataclass(frozen=True, eq=False)
class SeaFloor:
    """A terrain in the cube with everything that compiled functions need."""

    terrain: Terrain
    sonar: Multibeam | None = SONAR

    @cached_property
    def cube(self) -> CubeTerrain:
        """The terrain, cast into the cube."""
        return CubeTerrain(self.terrain)

    @cached_property
    def raster(self) -> FloatArray:
        """Depths at the cells' centres; unknown cells have that of the nearest known one."""
        raster = self.cube.raster
        lacking = ~np.isfinite(raster)
        if not lacking.any():
            return np.ascontiguousarray(raster)
        rows, cols = distance_transform_edt(lacking, return_distances=False, return_indices=True)
        return np.ascontiguousarray(raster[rows, cols])

    @cached_property
    def physics(self) -> Physics:
        """The constants."""
        half, sonar = self.cube.half, self.sonar
        return Physics(
            float(-half[0]), float(-half[1]), self.cube.cell, float(half[0]), float(half[1]), MAX_STEP, CLEARANCE,
            CEILING, sonar.count if sonar else 0, sonar.swath_rad if sonar else 0.0,
            float(np.cos((sonar.beam_width_rad if sonar else 0.0) / 2.0)), sonar.max_range_m if sonar else 0.4,
            sonar.relative_noise if sonar else 0.1, ACCURACY_SD, VISIT_CAP, float(PRIOR_SD), UNIT,
        )  # fmt: skip

    def draw(self, seed: int, robots: int, landmarks: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return landmarks (m, 3), starts (n, 3) and headings (n,) of a seed; the same for every algorithm."""
        rng, cube = np.random.default_rng([seed, 0]), self.cube
        chosen = np.zeros((0, 3))
        while len(chosen) < landmarks:
            xy = rng.uniform(-1.0, 1.0, (2 * landmarks, 2)) * cube.half
            drawn = np.column_stack([xy, cube.depth_at(xy)])
            chosen = np.vstack([chosen, drawn[np.isfinite(drawn[:, 2])]])
        start = START_CORNER * cube.half + rng.uniform(-START_SPREAD, START_SPREAD, (robots, 2))
        floor = np.nan_to_num(cube.depth_at(start), nan=DEEPEST)
        headings = rng.uniform(0.0, 2.0 * np.pi, robots)
        return chosen[:landmarks], np.column_stack([start, floor - START_HEIGHT]), headings
