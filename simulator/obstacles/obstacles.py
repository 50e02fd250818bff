"""Worlds of obstacles on square cells: where a vehicle may not be, and what its scanner measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from simulator.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class ObstacleWorld:
    """A rectangle of cells, its south-western corner at the origin; row 0 is south, column 0 west.

    Attributes
    ----------
    name : str
        What it is called in reports.
    solid : (rows, cols)
        Cells that an obstacle fills.
    known : (rows, cols)
        Those of them that a plan drawn beforehand (a blueprint, a chart) shows.
    cell_m : float
        Side of a cell.
    entry_m, goal_m, transmitter_m : (2,)
        East and north of the way in and out, of what is looked for, and of the radio on the team's side.
    """

    name: str
    solid: BoolArray
    known: BoolArray
    cell_m: float
    entry_m: FloatArray
    goal_m: FloatArray
    transmitter_m: FloatArray

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent west to east and south to north."""
        rows, cols = self.solid.shape
        return cols * self.cell_m, rows * self.cell_m

    @cached_property
    def _nearest(self) -> NDArray[np.int32]:
        """Row and column of the solid cell closest to each cell, (2, rows, cols)."""
        return np.asarray(distance_transform_edt(~self.solid, return_distances=False, return_indices=True))

    def scan(self, position_m: FloatArray, bearings_rad: FloatArray, reach_m: float) -> FloatArray:
        """Return exact distances (n,) to the first obstacle along bearings (n,) clockwise from north; inf: none.

        The border of the world ends a beam without an echo.
        """
        start = np.asarray(position_m, dtype=np.float64)[:2] / self.cell_m
        return _scan(self.solid, start, np.asarray(bearings_rad, dtype=np.float64), reach_m / self.cell_m) * self.cell_m

    def clearance_m(self, points_m: FloatArray) -> FloatArray:
        """Return distances (n,) from points (n, 2) to the nearest obstacle's edge; 0 inside one and outside the world.

        Exact for the obstacle whose cell is closest by centres, which is within a cell's diagonal of the nearest.
        """
        east, north = np.asarray(points_m, dtype=np.float64).T / self.cell_m
        rows, cols = self.solid.shape
        within = (east >= 0) & (north >= 0) & (east <= cols) & (north <= rows)
        row = np.clip(north.astype(np.int64), 0, rows - 1)
        col = np.clip(east.astype(np.int64), 0, cols - 1)
        if not self.solid.any():
            return np.where(within, np.inf, 0.0)
        r, c = self._nearest[:, row, col]
        away = np.hypot(np.maximum(np.abs(east - c - 0.5) - 0.5, 0.0), np.maximum(np.abs(north - r - 0.5) - 0.5, 0.0))
        return np.where(within, away * self.cell_m, 0.0)


@njit(cache=True, nogil=True)
def _scan(solid: BoolArray, start: FloatArray, bearings: FloatArray, reach: float) -> FloatArray:
    rows, cols = solid.shape
    ranges = np.full(len(bearings), np.inf)
    for k in range(len(bearings)):
        east, north = np.sin(bearings[k]), np.cos(bearings[k])
        col, row = int(np.floor(start[0])), int(np.floor(start[1]))
        step_c, step_r = (1 if east > 0 else -1), (1 if north > 0 else -1)
        per_c = 1.0 / abs(east) if east != 0.0 else np.inf
        per_r = 1.0 / abs(north) if north != 0.0 else np.inf
        next_c = ((col + 1 - start[0]) if east > 0 else (start[0] - col)) * per_c if east != 0.0 else np.inf
        next_r = ((row + 1 - start[1]) if north > 0 else (start[1] - row)) * per_r if north != 0.0 else np.inf
        gone = 0.0
        while gone <= reach and 0 <= row < rows and 0 <= col < cols:
            if solid[row, col]:
                ranges[k] = gone
                break
            if next_c < next_r:
                gone = next_c
                next_c += per_c
                col += step_c
            else:
                gone = next_r
                next_r += per_r
                row += step_r
    return ranges
