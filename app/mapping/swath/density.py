"""Soundings per cell: what was ensonified, how densely, and how deep it is there."""

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.types import Grid

LEAST_SOUNDINGS = 5
"""A node counts as dense with so many soundings; surveys with full coverage are asked for it in 95 % of theirs."""


class DensityGrid:
    """Counts soundings in cells, and keeps their weighted mean and spread: beams come by the million.

    Parameters
    ----------
    grid
    mask : (rows, cols)
        Which cells belong to the area.
    """

    def __init__(self, grid: Grid, mask: BoolArray) -> None:
        self.grid, self.mask = grid, mask
        shape = (grid.rows, grid.cols)
        self.count: IntArray = np.zeros(shape, dtype=np.int64)
        self._weight = np.zeros(shape)
        self._total = np.zeros(shape)
        self._squares = np.zeros(shape)
        self._shared = np.zeros(shape)
        self._aside, self._placed = np.zeros(shape), np.zeros(shape)

    def add(
        self,
        east_m: FloatArray,
        north_m: FloatArray,
        depth_m: FloatArray,
        sd_m: FloatArray,
        shared_sd_m: FloatArray | None = None,
        horizontal_sd_m: FloatArray | None = None,
    ) -> BoolArray:
        """Take soundings in, arrays (n,); return which of them lie on the grid.

        Parameters
        ----------
        sd_m
            Standard deviation of the depth, as far as it differs from sounding to sounding.
        shared_sd_m
            As far as the soundings of a cell share it; None: not at all.
        horizontal_sd_m
            Of each horizontal coordinate; None, or NaN: it is not known.
        """
        cols = np.floor((east_m - self.grid.west_m) / self.grid.cell_m)
        rows = np.floor((north_m - self.grid.south_m) / self.grid.cell_m)
        inside = (cols >= 0) & (cols < self.grid.cols) & (rows >= 0) & (rows < self.grid.rows)
        if not inside.any():
            return np.asarray(inside)
        # Only the rectangle that was hit is touched: a ping covers a sliver of a large area.
        i, j = rows[inside].astype(np.int64), cols[inside].astype(np.int64)
        i0, j0 = int(i.min()), int(j.min())
        part = (slice(i0, int(i.max()) + 1), slice(j0, int(j.max()) + 1))
        shape = self.count[part].shape
        flat, size = (i - i0) * shape[1] + (j - j0), shape[0] * shape[1]
        weight, depth = 1.0 / sd_m[inside] ** 2, depth_m[inside]
        self.count[part] += np.bincount(flat, minlength=size).reshape(shape)
        self._weight[part] += np.bincount(flat, weight, size).reshape(shape)
        self._total[part] += np.bincount(flat, weight * depth, size).reshape(shape)
        self._squares[part] += np.bincount(flat, weight * depth**2, size).reshape(shape)
        if shared_sd_m is not None:
            self._shared[part] += np.bincount(flat, weight * shared_sd_m[inside] ** 2, size).reshape(shape)
        if horizontal_sd_m is not None:
            square = horizontal_sd_m[inside] ** 2
            known = np.isfinite(square)
            self._placed[part] += np.bincount(flat, weight * known, size).reshape(shape)
            self._aside[part] += np.bincount(flat, np.where(known, weight * square, 0.0), size).reshape(shape)
        return np.asarray(inside)

    def copy(self) -> "DensityGrid":
        """Return a copy, to which other soundings may be added."""
        other = DensityGrid.__new__(DensityGrid)
        other.grid, other.mask = self.grid, self.mask
        other.count = self.count.copy()
        for name in ("_weight", "_total", "_squares", "_shared", "_aside", "_placed"):
            setattr(other, name, getattr(self, name).copy())
        return other

    @property
    def ensonified(self) -> BoolArray:
        """Which cells of the area have a sounding."""
        return np.asarray(self.mask & (self.count > 0))

    @property
    def depth_m(self) -> FloatArray:
        """Mean depth of the soundings in each cell, weighted by their precision; NaN without any."""
        unknown = np.full(self._total.shape, np.nan)
        return np.asarray(np.divide(self._total, self._weight, out=unknown, where=self._weight > 0.0))

    @property
    def precision(self) -> FloatArray:
        """Sum of the inverse variances of the soundings in each cell."""
        return self._weight.copy()

    @property
    def spread_m(self) -> FloatArray:
        """Standard deviation of the soundings within each cell; NaN without any."""
        mean = self.depth_m
        with np.errstate(invalid="ignore"):
            squares = self._squares / np.where(self._weight > 0.0, self._weight, np.nan)
            return np.asarray(np.sqrt(np.maximum(squares - mean**2, 0.0)))

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviation of the mean of independent soundings; NaN without any."""
        with np.errstate(divide="ignore"):
            return np.where(self._weight > 0.0, 1.0 / np.sqrt(self._weight), np.nan)

    @property
    def shared_sd_m(self) -> FloatArray:
        """Standard deviation of the depth that a cell's soundings share; NaN without any."""
        return _rms(self._shared, self._weight)

    @property
    def horizontal_sd_m(self) -> FloatArray:
        """Standard deviation of each horizontal coordinate of those soundings of a cell of which it is known.

        NaN without any.
        """
        return _rms(self._aside, self._placed)

    def ensonified_pct(self) -> float:
        """Return the share of the area's cells that have a sounding."""
        return float(100.0 * self.ensonified.sum() / max(int(self.mask.sum()), 1))

    def dense_pct(self, least: int = LEAST_SOUNDINGS) -> float:
        """Return the share of the area's cells that have at least so many soundings."""
        return float(100.0 * (self.mask & (self.count >= least)).sum() / max(int(self.mask.sum()), 1))


def _rms(total: FloatArray, weight: FloatArray) -> FloatArray:
    unknown = np.full(total.shape, np.nan)
    return np.asarray(np.sqrt(np.divide(total, weight, out=unknown, where=weight > 0.0)))
