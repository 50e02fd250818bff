"""Which cell a sounding falls into."""

import numpy as np

from app.arrays import IntArray
from app.mapping.types import Grid, Soundings


def cell_numbers(grid: Grid, soundings: Soundings) -> IntArray:
    """Row-major cell number of each sounding, (n,); -1 outside. The far edges belong to the last cells."""
    col = np.floor((soundings.east_m - grid.west_m) / grid.cell_m).astype(np.int64)
    row = np.floor((soundings.north_m - grid.south_m) / grid.cell_m).astype(np.int64)
    col[soundings.east_m == grid.west_m + grid.cols * grid.cell_m] = grid.cols - 1
    row[soundings.north_m == grid.south_m + grid.rows * grid.cell_m] = grid.rows - 1
    inside = (col >= 0) & (col < grid.cols) & (row >= 0) & (row < grid.rows)
    return np.where(inside, row * grid.cols + col, -1)


def count_per_cell(grid: Grid, soundings: Soundings) -> IntArray:
    """Soundings in each cell, shape (rows, cols)."""
    cells = cell_numbers(grid, soundings)
    count = np.bincount(cells[cells >= 0], minlength=grid.rows * grid.cols)
    return count.reshape(grid.rows, grid.cols).astype(np.int64)
