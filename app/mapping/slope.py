"""How steep the sea floor is, and how uncertain that makes the mean of a cell's soundings."""

import numpy as np
from scipy.ndimage import uniform_filter

from app.arrays import FloatArray

SMOOTHED_CELLS = 7
"""The slope is that of a plane through so many cells along and across: the scatter of soundings is none."""

_PARALLEL = 1e-3
"""Keeps the plane through cells in one row level across it; in squares of cells."""


def gradient(depth_m: FloatArray, cell_m: float, sd_m: FloatArray | None = None) -> FloatArray:
    """Return how much deeper it becomes per metre, (rows, cols), of a plane through the known cells around each.

    Parameters
    ----------
    depth_m : (rows, cols)
        NaN where it is not known.
    sd_m : (rows, cols)
        How far the depths scatter: what that makes of a level floor is taken off.
    """
    known = np.isfinite(depth_m)
    place: tuple[FloatArray, ...] = tuple(np.indices(depth_m.shape, dtype=np.float64))
    row, col = place
    depth = np.where(known, depth_m - (float(depth_m[known].mean()) if known.any() else 0.0), 0.0)

    def mean(of: FloatArray) -> FloatArray:
        return np.asarray(uniform_filter(np.where(known, of, 0.0), SMOOTHED_CELLS, mode="constant"))

    share = np.maximum(mean(np.ones_like(depth)), 1e-9)
    north, east, level = mean(row) / share, mean(col) / share, mean(depth) / share
    least = _PARALLEL / (SMOOTHED_CELLS**2 * share)
    rows, cols = mean(row**2) / share - north**2 + least, mean(col**2) / share - east**2 + least
    both = mean(row * col) / share - north * east
    by_row, by_col = mean(row * depth) / share - north * level, mean(col * depth) / share - east * level
    whole = rows * cols - both**2
    square: FloatArray = ((cols * by_row - both * by_col) ** 2 + (rows * by_col - both * by_row) ** 2) / whole**2
    if sd_m is not None:
        noise = mean(np.nan_to_num(sd_m) ** 2) / share
        square = square - noise * (rows + cols) / whole / (SMOOTHED_CELLS**2 * share)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)) / cell_m)


def scatter_m(spread_m: FloatArray, slope: FloatArray, cell_m: float) -> FloatArray:
    """Return the deviation of a single sounding from the mean depth of its cell.

    On a slope it lies anywhere in the cell: of a few soundings the spread does not tell that, and that of many holds
    it, so that the larger of the two counts.
    """
    return np.asarray(np.fmax(spread_m, slope * cell_m / np.sqrt(12.0)))
