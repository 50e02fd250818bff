"""The papers' Gaussian interpolation (AURO15 eq. 1-3), incremental."""

import math

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.mapping.counting import cell_numbers
from app.mapping.neighbours import nearest
from app.mapping.types import BathymetricMap, BoolArray, FloatArray, Grid, Soundings

REACH = 4.0
"""Kernel widths beyond which a sounding says nothing (its weight there is 1e-7)."""

GAP_LIMIT = 0.1
CV_SOUNDINGS = 1000
CV_NEIGHBOURS = 64
ROUGHNESS_PRIOR_WEIGHT = 4.0


class GaussianInterpolator:
    """A live grid: depth is the mean of all soundings, weighted by a Gaussian of the distance.

    ``z(x) = sum_i z_i phi_i(x) / sum_i phi_i(x)``, ``phi_i(x) = exp(-|x - x_i|^2 / width^2) / sd_i^2``:
    AURO15's basis functions (3) with a width instead of the unit 1, normalised to a partition of unity, and
    precise soundings counting for more. Only sums are kept, so a new sounding costs the same however many
    there are already.

    Parameters
    ----------
    grid
        Where the map is kept.
    width_m
        Width of the kernel; ``choose_width`` finds one from the data.
    """

    def __init__(self, grid: Grid, width_m: float) -> None:
        if not (math.isfinite(width_m) and width_m > 0.0):
            raise ValueError(f"width_m is {width_m}; it must be positive")
        self.grid = grid
        self.width_m = width_m
        shape = (grid.rows, grid.cols)
        # sums of phi, phi z, phi z^2 and phi^2; depths are counted from the first sounding for precision
        self._sums = np.zeros((4, *shape))
        self._count = np.zeros(shape, np.int64)
        self._reference: float | None = None

    def add(self, soundings: Soundings) -> None:
        """Take in new soundings; those out of reach of the grid change nothing.

        Raises
        ------
        ValueError
            When a value is not finite or a standard deviation not positive; nothing is taken in then.
        """
        if len(soundings) == 0:
            return
        soundings.check()
        if self._reference is None:
            self._reference = float(soundings.depth_m[0])
        _scatter(
            self._sums,
            (soundings.east_m - self.grid.west_m) / self.grid.cell_m - 0.5,
            (soundings.north_m - self.grid.south_m) / self.grid.cell_m - 0.5,
            soundings.depth_m - self._reference,
            1.0 / soundings.sd_m**2,
            self.width_m / self.grid.cell_m,
        )
        cells = cell_numbers(self.grid, soundings)
        np.add.at(self._count.reshape(-1), cells[cells >= 0], 1)

    @property
    def depth_m(self) -> FloatArray:
        """Depth, (rows, cols); NaN out of reach of all soundings."""
        if self._reference is None:
            return np.full(self._count.shape, np.nan)
        weight, first = self._sums[:2]
        return np.asarray(self._reference + _divide(first, weight))

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviation, (rows, cols); NaN out of reach of all soundings.

        The error of the weighted mean: stated sounding errors (growing as the weights fall off), and the
        scatter of the soundings about the mean over the effective number of soundings.
        """
        weight, _, _, squares = self._sums
        return np.sqrt(_divide(np.ones_like(weight), weight) + self._scatter() * _divide(squares, weight**2))

    def _scatter(self) -> FloatArray:
        weight, first, second, _ = self._sums
        return np.maximum(_divide(second, weight) - _divide(first, weight) ** 2, 0.0)

    def to_map(self, mask: BoolArray | None = None) -> BathymetricMap:
        """Return the map; cells where ``mask`` (rows, cols) is False are NaN."""
        wanted = np.ones(self._count.shape, np.bool_) if mask is None else mask
        if wanted.shape != self._count.shape:
            raise ValueError(f"mask has shape {wanted.shape}; the grid has {self._count.shape}")
        weight, _, _, squares = self._sums
        scatter = self._scatter()
        known = wanted & np.isfinite(scatter)
        typical = float(scatter[known].mean()) if known.any() else 0.0
        roughness = np.ones(self._count.shape)
        if typical > 0.0:
            effective = np.where(known, weight**2 / np.where(squares > 0.0, squares, 1.0), 0.0)
            relative = np.where(known, scatter / typical, 1.0)
            roughness = (ROUGHNESS_PRIOR_WEIGHT + effective * relative) / (ROUGHNESS_PRIOR_WEIGHT + effective)
            roughness /= float(roughness[wanted].mean())
        return BathymetricMap(
            grid=self.grid,
            depth_m=np.where(wanted, self.depth_m, np.nan),
            sd_m=np.where(wanted, self.sd_m, np.nan),
            count=self._count.copy(),
            sounded=self._count > 0,
            roughness=np.where(wanted, roughness, np.nan),
            correlation_length_m=self.width_m,
            model="Gaussian interpolation",
        )


def choose_width(soundings: Soundings, grid: Grid) -> float:
    """Kernel width by cross-validation at the distances that the grid asks for.

    Soundings are predicted from those that are farther away than a cell typically is from its nearest
    sounding (the median over the cells within ``GAP_LIMIT`` of the grid's diagonal): along a densely sounded
    track the nearest neighbours say nothing about the gaps between tracks. Deterministic; at most
    ``CV_SOUNDINGS`` are predicted.

    Raises
    ------
    ValueError
        When there is no sounding.
    """
    soundings.check()
    if len(soundings) == 0:
        raise ValueError("soundings is empty; a kernel width needs soundings")
    points = np.column_stack([soundings.east_m, soundings.north_m])
    tree = cKDTree(points)
    gap, _ = nearest(tree, grid.centres_m, 1)
    diagonal = math.hypot(grid.rows, grid.cols) * grid.cell_m
    gap = gap[gap <= max(GAP_LIMIT * diagonal, float(gap.min()))]
    hole = max(float(np.median(gap)), 0.25 * grid.cell_m)
    candidates = hole * np.geomspace(0.75, 8.0, 20)  # narrower ones would leave gaps between the tracks empty
    order = np.lexsort((soundings.depth_m, soundings.east_m, soundings.north_m))
    rows = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), CV_SOUNDINGS)).astype(np.int64))]
    distance, index = nearest(tree, points[rows], len(points) if len(points) < 512 else 512)
    outside = distance >= hole
    keep = outside & (np.cumsum(outside, axis=1) <= CV_NEIGHBOURS)
    usable = keep.any(axis=1)
    if not usable.any():
        return float(hole)
    distance, index, keep, rows = distance[usable], index[usable], keep[usable], rows[usable]
    precision = np.where(keep, 1.0 / soundings.sd_m[index] ** 2, 0.0)
    closest = np.where(keep, distance, np.inf).min(axis=1, keepdims=True)
    losses = []
    for width in candidates:
        # the weights' common factor cancels in the mean; leaving it out avoids underflow
        weight = precision * np.exp(np.minimum((closest**2 - distance**2) / width**2, 0.0))
        estimate = (weight * soundings.depth_m[index]).sum(axis=1) / weight.sum(axis=1)
        losses.append(float(np.mean((estimate - soundings.depth_m[rows]) ** 2)))
    return float(candidates[int(np.argmin(losses))])


def _divide(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.divide(a, b, out=np.full_like(a, np.nan), where=b > 0.0)


@njit(cache=True, nogil=True)
def _scatter(
    sums: FloatArray, col: FloatArray, row: FloatArray, depth: FloatArray, precision: FloatArray, width: float
) -> None:
    rows, cols = sums.shape[1], sums.shape[2]
    reach = REACH * width
    side = int(2.0 * reach) + 2
    along_col = np.empty(side)
    for i in range(len(depth)):
        r0 = max(math.ceil(row[i] - reach), 0)
        r1 = min(math.floor(row[i] + reach), rows - 1)
        c0 = max(math.ceil(col[i] - reach), 0)
        c1 = min(math.floor(col[i] + reach), cols - 1)
        for c in range(c0, c1 + 1):
            t = (c - col[i]) / width
            along_col[c - c0] = math.exp(-t * t)
        z = depth[i]
        for r in range(r0, r1 + 1):
            t = (r - row[i]) / width
            f = precision[i] * math.exp(-t * t)
            for c in range(c0, c1 + 1):
                w = f * along_col[c - c0]
                sums[0, r, c] += w
                sums[1, r, c] += w * z
                sums[2, r, c] += w * z * z
                sums[3, r, c] += w * w
