"""Near-duplicate soundings merged into precision-weighted ones: dense tracks need no dense matrices."""

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.mapping.types import Soundings

SQUARES_EACH, FEW_SQUARES = 8, 65_536
"""Up to so many squares for each sounding, or so many in all, are kept in a table; more are found by sorting."""


@njit(cache=True, nogil=True)
def squares(east: FloatArray, north: FloatArray, west: float, south: float, cell_m: float, columns: int) -> IntArray:
    """Return the row-major number of each sounding's square, (n,)."""
    square = np.empty(len(east), np.int64)
    for i in range(len(east)):
        square[i] = np.int64((north[i] - south) / cell_m) * columns + np.int64((east[i] - west) / cell_m)
    return square


def merge_soundings(soundings: Soundings, cell_m: float) -> tuple[Soundings, IntArray]:
    """Merge all soundings of one square of side ``cell_m`` into one.

    Position and depth are means weighted by precision (1 / sd^2), so that a plane stays a plane; the merged
    standard deviation is that of the weighted mean of independent soundings.

    Returns
    -------
    merged : Soundings
        Ordered by square (south-west to north-east), so the result does not depend on the order of the input.
    group : (n,)
        For each sounding the row of ``merged`` that it went into.
    """
    if len(soundings) == 0:
        return soundings, np.zeros(0, np.int64)
    # Squares are counted from a fixed corner of the data itself: the result moves with the data.
    west, south = float(soundings.east_m.min()), float(soundings.north_m.min())
    columns = int((float(soundings.east_m.max()) - west) / cell_m) + 1
    rows = int((float(soundings.north_m.max()) - south) / cell_m) + 1
    square = squares(soundings.east_m, soundings.north_m, west, south, cell_m, columns)
    if rows * columns <= max(SQUARES_EACH * len(soundings), FEW_SQUARES):
        groups = _number_in_place(square, rows * columns)
        group = square
    else:
        found, group = np.unique(square, return_inverse=True)
        groups, group = len(found), group.astype(np.int64)
    # Counted from the smallest: keeps the weighted sums small, hence exact for constant values.
    shallowest = float(soundings.depth_m.min())
    merged = _means(
        soundings.east_m, soundings.north_m, soundings.depth_m, soundings.sd_m, group, groups, west, south, shallowest
    )
    return Soundings(*merged), group


@njit(cache=True, nogil=True)
def _number_in_place(square: IntArray, squares: int) -> int:
    """Put in place of each square its number among those that hold a sounding; return how many these are."""
    number = np.full(squares, -1, np.int64)
    for i in range(len(square)):
        number[square[i]] = 0
    groups = 0
    for s in range(squares):
        if number[s] == 0:
            number[s] = groups
            groups += 1
    for i in range(len(square)):
        square[i] = number[square[i]]
    return groups


@njit(cache=True, nogil=True)
def _means(
    east: FloatArray,
    north: FloatArray,
    depth: FloatArray,
    sd: FloatArray,
    group: IntArray,
    groups: int,
    west: float,
    south: float,
    shallowest: float,
) -> FloatArray:
    """Return each group's weighted means of east, north and depth, and their deviation: (4, groups)."""
    sums = np.zeros((4, groups))
    for i in range(len(group)):
        g = group[i]
        precision = 1.0 / (sd[i] * sd[i])
        sums[0, g] += precision * (east[i] - west)
        sums[1, g] += precision * (north[i] - south)
        sums[2, g] += precision * (depth[i] - shallowest)
        sums[3, g] += precision
    for g in range(groups):
        total = sums[3, g]
        sums[0, g] = west + sums[0, g] / total
        sums[1, g] = south + sums[1, g] / total
        sums[2, g] = shallowest + sums[2, g] / total
        sums[3, g] = 1.0 / np.sqrt(total)
    return sums
