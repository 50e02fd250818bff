"""Local kriging: every tile of the grid is predicted from its nearest soundings only."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.kriging.kernels import (
    KERNEL_CODES,
    KernelName,
    cholesky_in_place,
    covariance_row,
    paciorek,
    solve_lower_columns_in_place,
    solve_lower_in_place,
)
from app.mapping.kriging.levels import TwoLevels
from app.mapping.kriging.likelihood import Trend
from app.mapping.kriging.scales import LocalScales, uniform_scales
from app.mapping.kriging.threads import each
from app.mapping.types import Grid

STRIP_CELLS = 60_000
"""A grid is predicted in strips of about this many cells: bounds the memory, and threads share the strips."""


class Places(NamedTuple):
    """Places with what the process is like there, m of them.

    Attributes
    ----------
    points : (m, 2)
        East and north, metres.
    metric : (m, 4)
        Squared-length matrix as in ``LocalScales``, metres.
    amplitude : (m,)
        Local standard deviation, metres.
    basis : (m, p)
        Values of the trend's functions.
    """

    points: FloatArray
    metric: FloatArray
    amplitude: FloatArray
    basis: FloatArray


@njit(cache=True, nogil=True)
def krige_tiles(
    kind: int,
    uniform: bool,
    sounded: Places,
    residual: FloatArray,
    noise: FloatArray,
    trend_covariance: FloatArray,
    tiles: IntArray,
    neighbours: IntArray,
    cells: Places,
    wanted: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Kriging of trend residuals, with the trend's own uncertainty in the variance.

    Parameters
    ----------
    kind
        Code of the correlation function.
    uniform
        Metric and amplitude are the same everywhere and no direction is preferred: quicker.
    sounded, residual, noise : (n,)
        Soundings: places, depth minus trend, noise variance.
    trend_covariance : (p, p)
        Posterior covariance of the trend's coefficients.
    tiles : (n_tiles, m)
        Rows of ``cells`` of each tile, -1 for none.
    neighbours : (n_tiles, k)
        Rows of ``sounded`` that each tile is predicted from, then -1.
    cells, wanted : (q,)
        Where to predict.

    Returns
    -------
    mean, variance : (q,)
        NaN where not wanted.
    """
    points, metric, amplitude, basis = sounded
    targets, target_metric, target_amplitude, target_basis = cells
    q = targets.shape[0]
    p = basis.shape[1]
    mean = np.full(q, np.nan)
    variance = np.full(q, np.nan)
    widest = neighbours.shape[1]
    side = tiles.shape[1]
    a = np.empty((widest, widest))
    y = np.empty(widest)
    v = np.empty((widest, side))
    whitened = np.empty((p, widest))
    place = np.empty(7)
    near = np.empty((7, widest))
    within = np.empty((7, side))
    inside = np.empty(side, np.int64)
    for t in range(tiles.shape[0]):
        m = 0
        for c in range(side):
            target = tiles[t, c]
            if target >= 0 and wanted[target]:
                inside[m] = target
                within[0, m], within[1, m] = targets[target, 0], targets[target, 1]
                within[2, m] = target_amplitude[target]
                for f in range(4):
                    within[3 + f, m] = target_metric[target, f]
                m += 1
        if m == 0:
            continue
        k = 0
        while k < widest and neighbours[t, k] >= 0:
            i = neighbours[t, k]
            near[0, k], near[1, k], near[2, k], y[k] = points[i, 0], points[i, 1], amplitude[i], residual[i]
            for f in range(4):
                near[3 + f, k] = metric[i, f]
            for f in range(p):
                whitened[f, k] = basis[i, f]
            k += 1
        for i in range(k):
            for f in range(7):
                place[f] = near[f, i]
            covariance_row(kind, uniform, place, near, i, a[i])
            a[i, i] = place[2] * place[2] * (1.0 + 1e-9) + noise[neighbours[t, i]]
            covariance_row(kind, uniform, place, within, m, v[i])
        if not cholesky_in_place(a, k):
            continue
        solve_lower_in_place(a, k, y)
        for f in range(p):
            solve_lower_in_place(a, k, whitened[f])
        solve_lower_columns_in_place(a, k, v, m)
        _finish_tile(inside[:m], v, y[:k], whitened, trend_covariance, target_basis, within[2], mean, variance)
    return mean, variance


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _finish_tile(
    inside: IntArray,
    v: FloatArray,
    y: FloatArray,
    whitened: FloatArray,
    trend_covariance: FloatArray,
    target_basis: FloatArray,
    amplitude: FloatArray,
    mean: FloatArray,
    variance: FloatArray,
) -> None:
    """Write estimate and variance of a tile's cells, ``v`` (k, cells) and ``y`` (k,) being whitened."""
    m = len(inside)
    p = whitened.shape[0]
    estimate = np.zeros(m)
    explained = np.zeros(m)
    rest = np.empty((p, m))
    for f in range(p):
        for c in range(m):
            rest[f, c] = target_basis[inside[c], f]
    for i in range(len(y)):
        for c in range(m):
            estimate[c] += v[i, c] * y[i]
            explained[c] += v[i, c] * v[i, c]
        for f in range(p):
            w = whitened[f, i]
            for c in range(m):
                rest[f, c] -= v[i, c] * w
    for c in range(m):
        spread = max(amplitude[c] * amplitude[c] - explained[c], 0.0)
        for f in range(p):
            for g in range(f + 1):
                spread += (1.0 if f == g else 2.0) * rest[f, c] * rest[g, c] * trend_covariance[f, g]
        mean[inside[c]] = estimate[c]
        variance[inside[c]] = max(spread, 0.0)


@njit(cache=True, nogil=True)
def krige_holes(
    kind: int,
    points: FloatArray,
    residual: FloatArray,
    noise: FloatArray,
    metric: FloatArray,
    amplitude: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Predict soundings from other soundings.

    Parameters
    ----------
    points, metric, amplitude
        As in ``Places``.
    residual, noise
        As in ``krige_tiles``.
    rows : (h,)
        The soundings to predict.
    neighbours : (h, k)
        The soundings to predict each from; -1 for none.

    Returns
    -------
    error : (h,)
        Measured minus predicted.
    noise_variance : (h,)
        The part of its variance that the noise of all soundings involved explains.
    model_variance : (h,)
        The part that the model's variability between the soundings explains. Both are NaN, like the error,
        where there is nothing to predict from.
    """
    h = rows.shape[0]
    k = neighbours.shape[1]
    error = np.full(h, np.nan)
    noise_variance = np.full(h, np.nan)
    model_variance = np.full(h, np.nan)
    a = np.empty((k, k))
    w = np.empty(k)
    used = np.empty(k, np.int64)
    for t in range(h):
        target = rows[t]
        n = 0
        for i in range(k):
            if neighbours[t, i] >= 0:
                used[n] = neighbours[t, i]
                n += 1
        if n == 0:
            continue
        s2 = amplitude[target] * amplitude[target]
        for i in range(n):
            pi = used[i]
            for j in range(i):
                pj = used[j]
                dx = points[pi, 0] - points[pj, 0]
                dy = points[pi, 1] - points[pj, 1]
                a[i, j] = amplitude[pi] * amplitude[pj] * paciorek(kind, dx, dy, metric[pi], metric[pj])
            a[i, i] = amplitude[pi] * amplitude[pi] * (1.0 + 1e-9) + noise[pi]
            dx = points[pi, 0] - points[target, 0]
            dy = points[pi, 1] - points[target, 1]
            w[i] = amplitude[pi] * amplitude[target] * paciorek(kind, dx, dy, metric[pi], metric[target])
        if not cholesky_in_place(a, n):
            continue
        solve_lower_in_place(a, n, w)
        explained = 0.0
        for i in range(n):
            explained += w[i] * w[i]
        for i in range(n - 1, -1, -1):  # L^-T: the weights themselves
            s = w[i]
            for j in range(i + 1, n):
                s -= a[j, i] * w[j]
            w[i] = s / a[i, i]
        estimate = 0.0
        propagated = 0.0
        for i in range(n):
            estimate += w[i] * residual[used[i]]
            propagated += w[i] * w[i] * noise[used[i]]
        error[t] = residual[target] - estimate
        noise_variance[t] = noise[target] + propagated
        model_variance[t] = max(s2 - explained - propagated, 1e-12 * s2)
    return error, noise_variance, model_variance


def tile_rows(grid: Grid, side: int) -> tuple[IntArray, FloatArray]:
    """Cut a grid into square tiles.

    Returns
    -------
    tiles : (n_tiles, side * side)
        Row-major cell numbers of each tile, -1 beyond the grid.
    middle : (n_tiles, 2)
        East and north of each tile's middle.
    """
    r0, c0 = np.meshgrid(np.arange(0, grid.rows, side), np.arange(0, grid.cols, side), indexing="ij")
    dr, dc = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    r = r0.reshape(-1, 1) + dr.reshape(1, -1)
    c = c0.reshape(-1, 1) + dc.reshape(1, -1)
    inside = (r < grid.rows) & (c < grid.cols)
    tiles = np.where(inside, r * grid.cols + c, -1).astype(np.int64)
    count = inside.sum(axis=1)
    east = grid.west_m + ((c * inside).sum(axis=1) / count + 0.5) * grid.cell_m
    north = grid.south_m + ((r * inside).sum(axis=1) / count + 0.5) * grid.cell_m
    return tiles, np.column_stack([east, north])


@dataclass(frozen=True)
class Conditioned:
    """A process that knows its soundings, hyperparameters and trend: ready to predict anywhere.

    Attributes
    ----------
    levels
        The soundings, fine ones and coarse ones.
    noise_variance : (n,)
        Of all these, with the learned noise scale.
    scales
        Of all these.
    """

    kernel: KernelName
    levels: TwoLevels
    noise_variance: FloatArray
    length_m: float
    amplitude_m: float
    trend: Trend
    scales: LocalScales

    @cached_property
    def sounded(self) -> Places:
        """All these soundings' places."""
        return self._places(self.levels.points, self.scales)

    @cached_property
    def residual_m(self) -> FloatArray:
        """Their depths without the trend, (n,)."""
        return np.asarray(self.levels.soundings.depth_m - self.trend(self.levels.points))

    def predict(
        self,
        grid: Grid,
        scales_over: Callable[[Grid], LocalScales] | None,
        wanted: BoolArray,
        neighbours: tuple[int, int],
        side: int,
    ) -> tuple[FloatArray, FloatArray]:
        """Return depth and its variance, (rows, cols) each, NaN where not ``wanted``.

        Parameters
        ----------
        scales_over
            Scales of all cells of a grid, row-major; None: the process is stationary, its own scales are uniform.
        neighbours
            Fine and coarse soundings used per tile.
        side
            Tiles are ``side`` x ``side`` cells.
        """
        sounded, residual = self.sounded, self.residual_m
        depth = np.empty((grid.rows, grid.cols))
        variance = np.empty((grid.rows, grid.cols))

        def fill(strip: slice) -> None:
            part = Grid(
                grid.west_m, grid.south_m + strip.start * grid.cell_m, grid.cell_m, strip.stop - strip.start, grid.cols
            )
            tiles, middle = tile_rows(part, side)
            targets = part.centres_m
            scales = uniform_scales(len(targets)) if scales_over is None else scales_over(part)
            mean, spread = krige_tiles(
                KERNEL_CODES[self.kernel],
                scales_over is None,
                sounded,
                residual,
                self.noise_variance,
                self.trend.covariance,
                tiles,
                self.levels.neighbours(middle, *neighbours),
                self._places(targets, scales),
                wanted[strip].ravel(),
            )
            depth[strip] = (mean + self.trend(targets)).reshape(part.rows, part.cols)
            variance[strip] = spread.reshape(part.rows, part.cols)

        height = side * max(1, STRIP_CELLS // (side * grid.cols))
        each(fill, [slice(r, min(r + height, grid.rows)) for r in range(0, grid.rows, height)])
        return depth, variance

    def _places(self, points: FloatArray, scales: LocalScales) -> Places:
        """Return places (m, 2) with what the process is like there, by their scales."""
        return Places(
            points, scales.scaled_metric(self.length_m), self.amplitude_m * scales.amplitude, self.trend.basis(points)
        )
