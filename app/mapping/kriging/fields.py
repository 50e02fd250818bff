"""Slowly varying quantities on a coarse grid, read anywhere by bilinear interpolation."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from app.arrays import FloatArray, IntArray
from app.mapping.types import Grid


@dataclass(frozen=True)
class Field:
    """Values at the centres of a coarse grid; beyond the outermost centres the nearest value holds.

    Attributes
    ----------
    grid : Grid
    values : (k, rows, cols)
        ``k`` quantities.
    """

    grid: Grid
    values: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """Interpolate at ``points`` (m, 2): (k, m)."""
        row = (points[:, 1] - self.grid.south_m) / self.grid.cell_m - 0.5
        col = (points[:, 0] - self.grid.west_m) / self.grid.cell_m - 0.5
        return np.array([map_coordinates(part, [row, col], order=1, mode="nearest") for part in self.values])

    def over(self, grid: Grid) -> FloatArray:
        """Interpolate at the centres of another grid: (k, rows, cols)."""
        row, along_row = _places((grid.north_m - self.grid.south_m) / self.grid.cell_m - 0.5, self.grid.rows)
        col, along_col = _places((grid.east_m - self.grid.west_m) / self.grid.cell_m - 0.5, self.grid.cols)
        along_row = along_row[:, None]
        lines = self.values[:, row] * (1.0 - along_row) + self.values[:, row + 1] * along_row
        return np.asarray(lines[:, :, col] * (1.0 - along_col) + lines[:, :, col + 1] * along_col)


def _places(at: FloatArray, n: int) -> tuple[IntArray, FloatArray]:
    """Number of the knot before each place (at most ``n - 2``), and the part of the way to the next."""
    at = np.clip(at, 0.0, n - 1.0)
    before = np.minimum(at.astype(np.int64), n - 2)
    return before, at - before


def coarse_grid(low: FloatArray, high: FloatArray, cell_m: float) -> Grid:
    """Return the grid of two or more cells each way that covers the rectangle from ``low`` to ``high``, (2,) each."""
    cols, rows = (max(2, int(np.ceil(side / cell_m - 1e-9))) for side in high - low)
    return Grid(float(low[0]), float(low[1]), cell_m, rows, cols)
