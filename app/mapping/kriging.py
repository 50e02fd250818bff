"""Local kriging: every tile of the grid is predicted from its nearest soundings only."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.mapping.kernels import KERNEL_CODES, KernelName, cholesky_in_place, paciorek, solve_lower_in_place
from app.mapping.levels import TwoLevels
from app.mapping.likelihood import Trend
from app.mapping.scales import LocalScales
from app.mapping.types import BoolArray, FloatArray, Grid, IntArray


@njit(cache=True, nogil=True)
def krige_tiles(
    kind: int,
    points: FloatArray,
    residual: FloatArray,
    noise: FloatArray,
    metric: FloatArray,
    amplitude: FloatArray,
    basis: FloatArray,
    trend_covariance: FloatArray,
    tiles: IntArray,
    neighbours: IntArray,
    targets: FloatArray,
    target_metric: FloatArray,
    target_amplitude: FloatArray,
    target_basis: FloatArray,
    wanted: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Kriging of trend residuals, with the trend's own uncertainty in the variance.

    Parameters
    ----------
    kind
        Code of the correlation function.
    points : (n, 2), residual : (n,), noise : (n,), metric : (n, 4), amplitude : (n,), basis : (n, p)
        Soundings: position, depth minus trend, noise variance, squared-length matrix as in ``LocalScales``,
        local standard deviation and trend functions.
    trend_covariance : (p, p)
        Posterior covariance of the trend's coefficients.
    tiles : (n_tiles, m)
        Rows of ``targets`` of each tile, -1 for none.
    neighbours : (n_tiles, k)
        Rows of ``points`` that each tile is predicted from, then -1.
    targets : (q, 2), target_metric : (q, 4), target_amplitude : (q,), target_basis : (q, p), wanted : (q,)
        Where to predict.

    Returns
    -------
    mean, variance : (q,)
        NaN where not wanted.
    """
    q = targets.shape[0]
    p = basis.shape[1]
    mean = np.full(q, np.nan)
    variance = np.full(q, np.nan)
    widest = neighbours.shape[1]
    a = np.empty((widest, widest))
    y = np.empty(widest)
    v = np.empty(widest)
    whitened = np.empty((p, widest))
    for t in range(tiles.shape[0]):
        any_wanted = False
        for c in range(tiles.shape[1]):
            if tiles[t, c] >= 0 and wanted[tiles[t, c]]:
                any_wanted = True
        if not any_wanted:
            continue
        k = 0
        while k < widest and neighbours[t, k] >= 0:
            k += 1
        for i in range(k):
            pi = neighbours[t, i]
            for j in range(i):
                pj = neighbours[t, j]
                dx = points[pi, 0] - points[pj, 0]
                dy = points[pi, 1] - points[pj, 1]
                a[i, j] = amplitude[pi] * amplitude[pj] * paciorek(kind, dx, dy, metric[pi], metric[pj])
            a[i, i] = amplitude[pi] * amplitude[pi] * (1.0 + 1e-9) + noise[pi]
            y[i] = residual[pi]
            for f in range(p):
                whitened[f, i] = basis[pi, f]
        if not cholesky_in_place(a, k):
            continue
        solve_lower_in_place(a, k, y)
        for f in range(p):
            solve_lower_in_place(a, k, whitened[f])
        for c in range(tiles.shape[1]):
            target = tiles[t, c]
            if target < 0 or not wanted[target]:
                continue
            for i in range(k):
                pi = neighbours[t, i]
                dx = points[pi, 0] - targets[target, 0]
                dy = points[pi, 1] - targets[target, 1]
                v[i] = (
                    amplitude[pi] * target_amplitude[target] * paciorek(kind, dx, dy, metric[pi], target_metric[target])
                )
            solve_lower_in_place(a, k, v)
            estimate = 0.0
            explained = 0.0
            for i in range(k):
                estimate += v[i] * y[i]
                explained += v[i] * v[i]
            spread = max(target_amplitude[target] * target_amplitude[target] - explained, 0.0)
            for f in range(p):
                rf = target_basis[target, f]
                for i in range(k):
                    rf -= v[i] * whitened[f, i]
                for g in range(f + 1):
                    rg = target_basis[target, g]
                    for i in range(k):
                        rg -= v[i] * whitened[g, i]
                    spread += (1.0 if f == g else 2.0) * rf * rg * trend_covariance[f, g]
            mean[target] = estimate
            variance[target] = max(spread, 0.0)
    return mean, variance


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
    points, residual, noise, metric, amplitude
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

    def predict(
        self, grid: Grid, scales: LocalScales, wanted: BoolArray, neighbours: tuple[int, int], side: int
    ) -> tuple[FloatArray, FloatArray]:
        """Return depth and its variance, (rows, cols) each, NaN where not ``wanted``.

        Parameters
        ----------
        scales
            Of all cells, row-major.
        neighbours
            Fine and coarse soundings used per tile.
        side
            Tiles are ``side`` x ``side`` cells.
        """
        tiles, middle = tile_rows(grid, side)
        near = self.levels.neighbours(middle, *neighbours)
        points = self.levels.points
        targets = grid.centres_m
        mean, variance = krige_tiles(
            KERNEL_CODES[self.kernel],
            points,
            self.levels.soundings.depth_m - self.trend(points),
            self.noise_variance,
            self.scales.scaled_metric(self.length_m),
            self.amplitude_m * self.scales.amplitude,
            self.trend.basis(points),
            self.trend.covariance,
            tiles,
            near,
            targets,
            scales.scaled_metric(self.length_m),
            self.amplitude_m * scales.amplitude,
            self.trend.basis(targets),
            wanted.ravel(),
        )
        shape = (grid.rows, grid.cols)
        return (mean + self.trend(targets)).reshape(shape), variance.reshape(shape)
