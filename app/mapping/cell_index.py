"""Which cell a sounding falls into, and soundings cell by cell."""

import numpy as np
from numba import njit

from app.arrays import IntArray
from app.mapping.types import Grid, Soundings


def cell_numbers(grid: Grid, soundings: Soundings) -> IntArray:
    """Row-major cell number of each sounding, (n,); -1 outside. The far edges belong to the last cells."""
    # Not compiled: the confined process that reads files of strangers calls it, too.
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
