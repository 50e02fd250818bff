"""The papers' Gaussian interpolation (AURO15 eq. 1-3), incremental."""

import itertools
import math

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.cell_index import cell_by_cell, cell_numbers
from app.mapping.kriging.kernels import exp_minus
from app.mapping.kriging.neighbours import nearest
from app.mapping.kriging.supersoundings import merge_soundings
from app.mapping.kriging.threads import each
from app.mapping.types import BathymetricMap, Grid, Soundings

REACH = 4.0
"""Kernel widths beyond which a sounding says nothing (its weight there is 1e-7)."""

MANY_SOUNDINGS = 20_000
"""From so many on, threads share the rows of the grid."""

MODEL = "Gaussian interpolation"

AT_ONCE = 500_000
"""At most so many soundings are taken in at a time: bounds the memory."""

BANDS = 8
BLOCK_CELLS = 16
PADDING = 8

GAP_LIMIT = 0.1
GAP_CELLS = 20_000
CV_SOUNDINGS = 1000
MANY_TO_CHOOSE_BY = 200_000  # from so many on, those within half a cell count as one
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
        # Sums of phi, phi z, phi z^2 (side by side in memory) and of phi^2; depths are counted from the first sounding
        # for precision.
        self._padded_moments = np.zeros((grid.rows, grid.cols + PADDING, 3))
        self._padded_squares = np.zeros((grid.rows, grid.cols + PADDING))
        self._moments = self._padded_moments[:, : grid.cols]
        self._squares = self._padded_squares[:, : grid.cols]
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
        for first in range(0, len(soundings), AT_ONCE):
            self._add(soundings.take(slice(first, first + AT_ONCE)), self._reference)

    def _add(self, soundings: Soundings, reference_m: float) -> None:
        col = (soundings.east_m - self.grid.west_m) / self.grid.cell_m - 0.5
        row = (soundings.north_m - self.grid.south_m) / self.grid.cell_m - 0.5
        depth = soundings.depth_m - reference_m
        precision = 1.0 / soundings.sd_m**2
        width = self.width_m / self.grid.cell_m
        # one block after the other: their cells are still in the processor's cache
        order = _block_order(row, col, self.grid.rows, self.grid.cols)
        row, col, depth, precision = row[order], col[order], depth[order], precision[order]
        bands = [slice(0, self.grid.rows)] if len(soundings) < MANY_SOUNDINGS else _bands(row, self.grid.rows)
        moments, squares = self._padded_moments.reshape(-1), self._padded_squares.reshape(-1)

        def scatter(band: slice) -> None:
            _scatter(
                moments,
                squares,
                self.grid.cols,
                col,
                row,
                depth,
                precision,
                width,
                band.start,
                band.stop,
            )

        each(scatter, bands)
        cells = cell_numbers(self.grid, soundings)
        _count(self._count.reshape(-1), cells)

    @property
    def depth_m(self) -> FloatArray:
        """Depth, (rows, cols); NaN out of reach of all soundings."""
        if self._reference is None:
            return np.full(self._count.shape, np.nan)
        weight, first, _ = self._moments.transpose(2, 0, 1)
        return np.asarray(self._reference + _divide(first, weight))

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviation, (rows, cols); NaN out of reach of all soundings.

        The error of the weighted mean: stated sounding errors (growing as the weights fall off), and the
        scatter of the soundings about the mean over the effective number of soundings.
        """
        weight = self._moments[..., 0]
        return np.sqrt(_divide(np.ones_like(weight), weight) + self._scatter() * _divide(self._squares, weight**2))

    def values_at(self, cells: BoolArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return depth, standard deviation and count, (k,) each, where ``cells`` (rows, cols) is True, row by row."""
        weight, first, second = self._moments[cells].T
        squares = self._squares[cells]
        mean = _divide(first, weight)
        scatter = np.maximum(_divide(second, weight) - mean**2, 0.0)
        sd = np.sqrt(_divide(np.ones_like(weight), weight) + scatter * _divide(squares, weight**2))
        return np.asarray((self._reference or 0.0) + mean), sd, self._count[cells]

    def _scatter(self) -> FloatArray:
        weight, first, second = self._moments.transpose(2, 0, 1)
        return np.maximum(_divide(second, weight) - _divide(first, weight) ** 2, 0.0)

    def to_map(self, mask: BoolArray | None = None) -> BathymetricMap:
        """Return the map; cells where ``mask`` (rows, cols) is False are NaN."""
        wanted = np.ones(self._count.shape, np.bool_) if mask is None else mask
        if wanted.shape != self._count.shape:
            raise ValueError(f"mask has shape {wanted.shape}; the grid has {self._count.shape}")
        weight, squares = self._moments[..., 0], self._squares
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
            model=MODEL,
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
    if len(soundings) > MANY_TO_CHOOSE_BY:
        soundings, _ = merge_soundings(soundings, 0.5 * grid.cell_m)
    points = np.column_stack([soundings.east_m, soundings.north_m])
    tree = cKDTree(points)
    gap, _ = nearest(tree, grid.centres_m[:: max(1, grid.rows * grid.cols // GAP_CELLS)], 1)
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


def _bands(row: FloatArray, rows: int) -> list[slice]:
    """Cut the grid's rows into bands for the threads, about as many soundings (at the rows ``row``) in each."""
    cuts = np.quantile(row, np.linspace(0.0, 1.0, BANDS + 1)[1:-1])
    edges = np.unique(np.concatenate([[0], np.clip(np.round(cuts), 0, rows).astype(np.int64), [rows]]))
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]


@njit(cache=True, nogil=True)
def _block_order(row: FloatArray, col: FloatArray, rows: int, cols: int) -> IntArray:
    """Order of the soundings by blocks of cells, row-major; within a block as given."""
    down = rows // BLOCK_CELLS + 1
    across = cols // BLOCK_CELLS + 1
    block = np.empty(len(row), np.int64)
    for i in range(len(row)):
        r = int(min(max(row[i], 0.0), rows - 1.0)) // BLOCK_CELLS
        c = int(min(max(col[i], 0.0), cols - 1.0)) // BLOCK_CELLS
        block[i] = r * across + c
    return cell_by_cell(block, down * across)[0]


@njit(cache=True, nogil=True)
def _count(count: IntArray, cells: IntArray) -> None:
    for i in range(len(cells)):
        if cells[i] >= 0:
            count[cells[i]] += 1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _bell(first: float, per_width: float, out: FloatArray, n: int) -> None:
    """Write ``exp(-(d / width)^2)`` for the distances ``first``, ``first + 1``, ..."""
    for j in range(np.uint64(n)):
        t = (first + np.float64(j)) * per_width
        out[j] = exp_minus(t * t)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _add_multiple(into: FloatArray, first: int, factor: float, line: FloatArray, n: int) -> None:
    # unsigned numbers: a sign would have to be looked at for every element
    start = np.uint64(first)
    for j in range(np.uint64(n)):
        into[start + j] += factor * line[j]


@njit(cache=True, nogil=True)
def _scatter(
    moments: FloatArray,
    squares: FloatArray,
    cols: int,
    col: FloatArray,
    row: FloatArray,
    depth: FloatArray,
    precision: FloatArray,
    width: float,
    first_row: int,
    past_row: int,
) -> None:
    """Add the soundings' weights to the rows from ``first_row`` up to before ``past_row``.

    ``moments`` is (rows * (cols + PADDING) * 3,), ``squares`` (rows * (cols + PADDING),). The kernel is a product of a
    factor per axis, so a sounding costs an exponential per row and per column of its stencil, not one per cell; what
    is left is adding multiples of one short line to others. The line is filled up with zeros to whole groups of
    ``PADDING`` cells, which vector instructions add without a remainder.
    """
    reach = REACH * width
    side = int(2.0 * reach) + 3 + PADDING
    line = np.zeros(3 * side)
    line_squares = np.zeros(side)
    along_row = np.empty(side)
    along_col = np.empty(side)
    per_width = 1.0 / width
    for i in range(len(depth)):
        y, x, z = row[i], col[i], depth[i]
        r0 = max(math.ceil(y - reach), first_row)
        r1 = min(math.floor(y + reach), past_row - 1)
        c0 = max(math.ceil(x - reach), 0)
        c1 = min(math.floor(x + reach), cols - 1)
        if r1 < r0 or c1 < c0:
            continue
        n = c1 - c0 + 1
        padded = (n + PADDING - 1) // PADDING * PADDING
        _bell(c0 - x, per_width, along_row, n)
        for c in range(n):
            w = along_row[c]
            line[3 * c] = w
            line[3 * c + 1] = w * z
            line[3 * c + 2] = w * z * z
            line_squares[c] = w * w
        for c in range(n, padded):
            line[3 * c] = line[3 * c + 1] = line[3 * c + 2] = line_squares[c] = 0.0
        _bell(r0 - y, per_width, along_col, r1 - r0 + 1)
        for r in range(r0, r1 + 1):
            f = precision[i] * along_col[r - r0]
            at = r * (cols + PADDING) + c0
            _add_multiple(moments, 3 * at, f, line, 3 * padded)
            _add_multiple(squares, at, f * f, line_squares, padded)
