"""Crosslines' beams beside the grid of the main lines: what is wrong with outer beams shows here."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from app.arrays import FloatArray, IntArray
from app.mapping.s44 import Order, max_tvu_m
from app.mapping.types import Grid

BIN_DEG, MAX_DEG = 5.0, 92.5
BINS = round(2 * MAX_DEG / BIN_DEG)
"""The middle one has straight down in its middle."""


@dataclass(frozen=True)
class AngleAgreement:
    """Beams of one bin of angles: beam minus grid, in metres.

    Attributes
    ----------
    from_deg, to_deg
        From straight down in the vehicle, positive to starboard.
    within_pct
        Share whose difference is not larger than the order's largest TVU.
    """

    from_deg: float
    to_deg: float
    count: int
    mean_m: float
    sd_m: float | None
    within_pct: float


def expected_m(grid: Grid, depth_m: FloatArray, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    """Return a grid's depth at places (n,), NaN where unknown: between the centres of four cells, else the cell's own.

    ``depth_m`` (rows, cols) are the depths of the grid's cells.
    """
    col, row = (east_m - grid.west_m) / grid.cell_m - 0.5, (north_m - grid.south_m) / grid.cell_m - 0.5
    between = map_coordinates(depth_m, [row, col], order=1, mode="constant", cval=np.nan)
    i, j = np.rint(row).astype(np.int64), np.rint(col).astype(np.int64)
    inside = (i >= 0) & (i < grid.rows) & (j >= 0) & (j < grid.cols)
    own = np.full(len(between), np.nan)
    own[inside] = depth_m[i[inside], j[inside]]
    return np.where(np.isfinite(between) & np.isfinite(own), between, own)


class BeamCheck:
    """Compares beams with a grid as they come; memory does not grow with their number.

    Parameters
    ----------
    grid
    depth_m : (rows, cols)
        Depths of the main lines alone, NaN where they have none.
    """

    def __init__(self, grid: Grid, depth_m: FloatArray) -> None:
        self._grid, self._depth_m = grid, depth_m
        self._count: IntArray = np.zeros(BINS, dtype=np.int64)
        self._sum, self._squares = np.zeros(BINS), np.zeros(BINS)
        self._within = {order: np.zeros(BINS, dtype=np.int64) for order in Order}

    def add(self, east_m: FloatArray, north_m: FloatArray, depth_m: FloatArray, angle_rad: FloatArray) -> None:
        """Take in beams of crosslines, arrays (n,)."""
        expected = expected_m(self._grid, self._depth_m, east_m, north_m)
        known = np.isfinite(expected) & np.isfinite(depth_m)
        depth, off = depth_m[known], depth_m[known] - expected[known]
        place = np.floor((np.degrees(angle_rad[known]) + MAX_DEG) / BIN_DEG).astype(np.int64)
        place = np.clip(place, 0, BINS - 1)
        self._count += np.bincount(place, minlength=BINS)
        self._sum += np.bincount(place, off, BINS)
        self._squares += np.bincount(place, off**2, BINS)
        for order, counts in self._within.items():
            counts += np.bincount(place[np.abs(off) <= max_tvu_m(depth, order)], minlength=BINS)

    def by_angle(self, order: Order) -> list[AngleAgreement]:
        """Return what was found for each bin of angles that had a beam."""
        return [
            self._summed(slice(b, b + 1), order, b * BIN_DEG - MAX_DEG, (b + 1) * BIN_DEG - MAX_DEG)
            for b in np.flatnonzero(self._count).tolist()
        ]

    def overall(self, order: Order) -> AngleAgreement | None:
        """Return what was found for all angles together; None without a beam."""
        return self._summed(slice(None), order, -MAX_DEG, MAX_DEG) if self._count.any() else None

    def _summed(self, bins: slice, order: Order, from_deg: float, to_deg: float) -> AngleAgreement:
        count = int(self._count[bins].sum())
        mean = float(self._sum[bins].sum()) / count
        variance = max(float(self._squares[bins].sum()) / count - mean**2, 0.0)
        return AngleAgreement(
            from_deg=from_deg,
            to_deg=to_deg,
            count=count,
            mean_m=mean,
            sd_m=float(np.sqrt(variance * count / (count - 1))) if count > 1 else None,
            within_pct=100.0 * int(self._within[order][bins].sum()) / count,
        )
