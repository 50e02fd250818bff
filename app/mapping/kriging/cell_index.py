"""Which cell a sounding falls into, and soundings cell by cell."""

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.mapping.types import Grid, Soundings


def cell_numbers(grid: Grid, soundings: Soundings) -> IntArray:
    """Row-major cell number of each sounding, (n,); -1 outside. The far edges belong to the last cells."""
    return _numbers(soundings.east_m, soundings.north_m, grid.west_m, grid.south_m, grid.cell_m, grid.rows, grid.cols)


def count_per_cell(grid: Grid, soundings: Soundings) -> IntArray:
    """Soundings in each cell, shape (rows, cols)."""
    cells = cell_numbers(grid, soundings)
    count = np.bincount(cells[cells >= 0], minlength=grid.rows * grid.cols)
    return count.reshape(grid.rows, grid.cols).astype(np.int64)


@njit(cache=True, nogil=True)
def cell_by_cell(cells: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Order things by their cells, of which there are ``count`` (a counting sort).

    Parameters
    ----------
    cells : (n,)
        Each one's cell, 0 to ``count`` - 1.

    Returns
    -------
    order : (n,)
        Their rows, cell by cell; within a cell as given.
    first : (count + 1,)
        Where each cell begins in ``order``, and where the last one ends.
    """
    first = np.zeros(count + 1, np.int64)
    for cell in cells:
        first[cell + 1] += 1
    for c in range(count):
        first[c + 1] += first[c]
    free = first[:-1].copy()
    order = np.empty(len(cells), np.int64)
    for i in range(len(cells)):
        order[free[cells[i]]] = i
        free[cells[i]] += 1
    return order, first


@njit(cache=True, nogil=True)
def _numbers(
    east: FloatArray, north: FloatArray, west: float, south: float, cell_m: float, rows: int, cols: int
) -> IntArray:
    cells = np.empty(len(east), np.int64)
    for i in range(len(east)):
        col = cols - 1.0 if east[i] == west + cols * cell_m else np.floor((east[i] - west) / cell_m)
        row = rows - 1.0 if north[i] == south + rows * cell_m else np.floor((north[i] - south) / cell_m)
        inside = 0.0 <= col < cols and 0.0 <= row < rows
        cells[i] = np.int64(row) * cols + np.int64(col) if inside else -1
    return cells
