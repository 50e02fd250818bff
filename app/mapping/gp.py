"""The default map: a nonstationary Gaussian process, kriged locally."""

import math
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from app.mapping.counting import count_per_cell
from app.mapping.gaussian import GaussianInterpolator
from app.mapping.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging import Conditioned, krige_holes, tile_rows
from app.mapping.levels import two_levels
from app.mapping.likelihood import Hyperparameters, RestrictedLikelihood, spread_subset
from app.mapping.neighbours import nearest
from app.mapping.outliers import OutlierReport, flag_outliers
from app.mapping.roughness import HOLE_NEIGHBOURS, HoleErrors, hole_errors, local_ratio, neighbours_beyond
from app.mapping.scales import LocalScales, Stretch, local_scales, stretch_from_relief, uniform_scales
from app.mapping.types import BathymetricMap, BoolArray, FloatArray, Grid, IntArray, Soundings

TILE_CELLS = 4
COARSE_FACTOR = 3.0  # side of the squares of merged soundings over that of single ones
FIRST_MAP_CELLS = 32  # of the coarse map that shows the grain, along the longer side
REACH_OF_ROUGHNESS = 0.1  # of the extent

LENGTH_FACTORS = (1.0, 1.5, 2.2, 3.3)
LENGTHEN_FROM = 30  # soundings; fewer cannot choose
CHOICE_POINTS = 400
CHOICE_MARGIN = 0.02  # a longer length must predict better by this much
GAP_FACTOR = 1.5  # radius of the holes over the median distance of places to their nearest sounding


class GaussianProcessMap:
    """Depth and its uncertainty by Gaussian-process regression on soundings.

    The sea floor is a plane plus a process with correlation ``kernel`` (Matern 3/2 by default). Length,
    amplitude and the factor on the stated noise variances are learned by restricted maximum likelihood on at
    most ``learning_points`` soundings. Then the process becomes nonstationary (Paciorek and Schervish 2006)
    in two ways. Every sounding is predicted across a hole of ``hole_m``; how far these predictions miss,
    place by place, is the local roughness: correlation gets shorter where the bottom is rough, longer where
    it is smooth. And a first, stationary map shows along which direction the sea floor varies least;
    correlation gets longer in that direction and shorter across, so that an edge seen on two survey lines is
    continued between them.

    Prediction is local: every tile of the grid is kriged from its nearest soundings.

    Parameters
    ----------
    kernel
        ``matern32`` (default), ``matern52``, ``exponential`` or ``gaussian``.
    nonstationary
        False for one length and amplitude everywhere.
    neighbours
        How many soundings, and how many merged ones farther away, each tile of the grid is predicted from.
    learning_points
        Bound on the soundings used to learn the hyperparameters.
    hole_points
        Bound on the soundings predicted across holes.
    merge_m
        Side of the squares whose soundings are merged into one; by default 1/100 of the extent of the
        soundings.
    reject_outliers
        Leave out soundings that ``flag_outliers`` rejects.
    hole_m
        Radius of the cross-validation holes; by default 8/100 of the extent of the soundings.

    Attributes
    ----------
    hyperparameters_ : Hyperparameters
        As used in the prediction.
    stationary_hyperparameters_ : Hyperparameters
        Before the local refinement.
    trend_ : Trend
        The plane.
    soundings_ : Soundings
        What the map is made of: without the rejected ones.
    outliers_ : OutlierReport or None
        The verdict on every sounding given.
    """

    def __init__(
        self,
        kernel: KernelName = "matern32",
        *,
        nonstationary: bool = True,
        neighbours: tuple[int, int] = (16, 32),
        learning_points: int = 350,
        hole_points: int = 800,
        merge_m: float | None = None,
        hole_m: float | None = None,
        reject_outliers: bool = True,
    ) -> None:
        if kernel not in KERNEL_CODES:
            raise ValueError(f"kernel is {kernel!r}; it must be one of {', '.join(KERNEL_CODES)}")
        self.kernel: KernelName = kernel
        self.nonstationary = nonstationary
        self.neighbours = neighbours
        self.learning_points = learning_points
        self.hole_points = hole_points
        self.merge_m = merge_m
        self.hole_m = hole_m
        self.reject_outliers = reject_outliers

    def fit(self, soundings: Soundings, *, learn: bool = True) -> Self:
        """Take in all soundings so far.

        Parameters
        ----------
        learn
            False keeps the hyperparameters of an earlier fit (they are learned when there was none) and only
            takes in the soundings: much cheaper, right for most steps of a mission. With True an earlier
            fit's values are the starting point.

        Raises
        ------
        ValueError
            When there is no sounding, or one that is not finite or has no positive standard deviation.
        """
        soundings.check()
        if len(soundings) == 0:
            raise ValueError("soundings is empty; a map needs at least one sounding")
        start = getattr(self, "stationary_hyperparameters_", None)
        self.outliers_: OutlierReport | None = None
        if self.reject_outliers:
            self.outliers_ = flag_outliers(soundings, kernel=self.kernel, hyperparameters=start)
            start = self.outliers_.hyperparameters
            soundings = soundings.take(~self.outliers_.rejected)
        self.soundings_ = soundings
        extent = max(float(np.ptp(soundings.east_m)), float(np.ptp(soundings.north_m)), 1e-3)
        fine_m = self.merge_m or extent / 100.0
        self._levels = two_levels(soundings, fine_m, COARSE_FACTOR * fine_m)
        fine = self._levels.soundings.take(np.arange(self._levels.n_fine))
        self._points = np.column_stack([fine.east_m, fine.north_m])
        self._depth = fine.depth_m
        self._variance = fine.sd_m**2
        learn = learn or not hasattr(self, "hyperparameters_")
        subset = spread_subset(self._points, self.learning_points)
        uniform = uniform_scales(len(self._levels.soundings))
        likelihood = self._likelihood(subset, uniform)
        if learn:
            self.stationary_hyperparameters_, _ = likelihood.maximise(start)
        self._process = self._condition(self.stationary_hyperparameters_, likelihood, uniform)
        self._reach = REACH_OF_ROUGHNESS * extent
        self._errors = self._hole_errors(extent)
        self._stretch: Stretch | None = None
        if self.nonstationary:
            ratio = local_ratio(self._errors, self._levels.points, self._reach)
            self._ratio_scale = float(np.exp(np.mean(np.log(ratio))))
            self._stretch = self._find_stretch(extent)
            scales = local_scales(ratio / self._ratio_scale, self._stretch.at(self._levels.points))
            likelihood = self._likelihood(subset, scales)
            if learn:
                start = getattr(self, "hyperparameters_", self.stationary_hyperparameters_)
                hyper, _ = likelihood.maximise(start)
                self.hyperparameters_ = self._lengthen(hyper, likelihood, scales, extent)
            self._process = self._condition(self.hyperparameters_, likelihood, scales)
        else:
            self.hyperparameters_ = self.stationary_hyperparameters_
        self.trend_ = self._process.trend
        return self

    def _likelihood(self, subset: IntArray, scales: LocalScales) -> RestrictedLikelihood:
        return RestrictedLikelihood(
            self.kernel,
            self._points[subset],
            self._depth[subset],
            self._variance[subset],
            scales.take(subset),
        )

    def _condition(self, hyper: Hyperparameters, likelihood: RestrictedLikelihood, scales: LocalScales) -> Conditioned:
        return Conditioned(
            self.kernel,
            self._levels,
            hyper.noise_scale * self._levels.soundings.sd_m**2,
            hyper.length_m,
            hyper.amplitude_m,
            likelihood.trend(hyper),
            scales,
        )

    def _find_stretch(self, extent: float) -> Stretch:
        """Read the grain of the sea floor from a coarse stationary map."""
        low, high = self._points.min(axis=0), self._points.max(axis=0)
        cell = extent / FIRST_MAP_CELLS
        cols, rows = (max(2, math.ceil(s / cell)) for s in high - low)
        grid = Grid(float(low[0]), float(low[1]), cell, rows, cols)
        first, _ = self._process.predict(
            grid, self._scales_at(grid, 2), np.ones((rows, cols), np.bool_), self.neighbours, 2
        )
        return stretch_from_relief(grid, first - self._process.trend(grid.centres_m).reshape(rows, cols))

    def _lengthen(
        self, hyper: Hyperparameters, likelihood: RestrictedLikelihood, scales: LocalScales, extent: float
    ) -> Hyperparameters:
        """Choose the length by how well soundings are predicted across the gaps that the survey leaves.

        Where a sea floor is patchy, the likelihood shortens the length to explain steep places, and the map falls
        back to the trend between the lines. Amplitude grows with length: the variance of short differences stays.
        """
        n = len(self._points)
        west, south = (float(x) for x in self._points.min(axis=0))
        coarse = Grid(west, south, extent / FIRST_MAP_CELLS, FIRST_MAP_CELLS, FIRST_MAP_CELLS)
        gap = nearest(cKDTree(self._points), coarse.centres_m, 1)[0]
        gap = gap[gap < self._reach]
        if n < LENGTHEN_FROM or len(gap) == 0:
            return hyper
        rows = np.unique(np.linspace(0, n - 1, min(n, CHOICE_POINTS)).astype(np.int64))
        near = neighbours_beyond(self._points, rows, GAP_FACTOR * float(np.median(gap)), HOLE_NEIGHBOURS)
        own = scales.take(np.arange(n))
        best, least = hyper, np.inf
        for factor in LENGTH_FACTORS:
            candidate = Hyperparameters(hyper.length_m * factor, hyper.amplitude_m * factor, hyper.noise_scale)
            error, _, _ = krige_holes(
                KERNEL_CODES[self.kernel],
                self._points,
                self._depth - likelihood.trend(candidate)(self._points),
                candidate.noise_scale * self._variance,
                own.scaled_metric(candidate.length_m),
                candidate.amplitude_m * own.amplitude,
                rows,
                near,
            )
            known = np.isfinite(error)
            if not known.any():
                return hyper
            loss = float(np.mean(error[known] ** 2)) * (1.0 if factor == 1.0 else 1.0 + CHOICE_MARGIN)
            if loss < least:
                best, least = candidate, loss
        return best

    def _hole_errors(self, extent: float) -> HoleErrors:
        hyper = self.stationary_hyperparameters_
        n = len(self._points)
        rows = np.unique(np.linspace(0, n - 1, min(n, self.hole_points)).astype(np.int64))
        return hole_errors(
            KERNEL_CODES[self.kernel],
            self._points,
            self._depth - self._process.trend(self._points),
            hyper.noise_scale * self._variance,
            uniform_scales(n).scaled_metric(hyper.length_m),
            np.full(n, hyper.amplitude_m),
            rows,
            self.hole_m or 0.08 * extent,
        )

    def _ratio_at(self, grid: Grid, side: int) -> FloatArray:
        _, middle = tile_rows(grid, side)
        return _spread_over_cells(local_ratio(self._errors, middle, self._reach), grid, side)

    def _scales_at(self, grid: Grid, side: int) -> LocalScales:
        if self._stretch is None:
            return uniform_scales(grid.rows * grid.cols)
        ratio = self._ratio_at(grid, side).ravel() / self._ratio_scale
        return local_scales(ratio, self._stretch.at(grid.centres_m))

    def predict(self, grid: Grid, mask: BoolArray | None = None) -> BathymetricMap:
        """Return the map on ``grid``; cells where ``mask`` (rows, cols) is False stay NaN.

        Raises
        ------
        ValueError
            When called before ``fit`` or when the mask has another shape than the grid.
        """
        if not hasattr(self, "trend_"):
            raise ValueError("the map knows no soundings yet: call fit(soundings) before predict(grid)")
        shape = (grid.rows, grid.cols)
        wanted = np.ones(shape, np.bool_) if mask is None else np.asarray(mask, np.bool_)
        if wanted.shape != shape:
            raise ValueError(f"mask has shape {wanted.shape}; the grid has {shape}")
        depth, variance = self._process.predict(
            grid, self._scales_at(grid, TILE_CELLS), wanted, self.neighbours, TILE_CELLS
        )
        count = count_per_cell(grid, self.soundings_)
        roughness = np.where(wanted, self._ratio_at(grid, TILE_CELLS), np.nan)
        kind = "nonstationary" if self.nonstationary else "stationary"
        return BathymetricMap(
            grid=grid,
            depth_m=depth,
            sd_m=np.sqrt(variance),
            count=count,
            sounded=count > 0,
            roughness=roughness / np.nanmean(roughness) if wanted.any() else roughness,
            correlation_length_m=self.hyperparameters_.length_m,
            model=f"{kind} Gaussian process, {self.kernel}",
        )


def _spread_over_cells(tile_values: FloatArray, grid: Grid, side: int) -> FloatArray:
    """Interpolate values at the tiles' middles bilinearly (in the logarithm) to all cells: (rows, cols)."""
    n_rows, n_cols = -(-grid.rows // side), -(-grid.cols // side)
    logs = np.log(tile_values).reshape(n_rows, n_cols)

    def weights(n: int, n_tiles: int) -> tuple[IntArray, FloatArray]:
        middle = np.array([(min(side * (t + 1), n) - 1 + side * t) / 2.0 for t in range(n_tiles)])
        at = np.clip(np.arange(n, dtype=float), middle[0], middle[-1])
        low = np.clip(np.searchsorted(middle, at, side="right") - 1, 0, max(n_tiles - 2, 0))
        if n_tiles == 1:
            return low, np.zeros(n)
        return low, (at - middle[low]) / (middle[low + 1] - middle[low])

    r, fr = weights(grid.rows, n_rows)
    c, fc = weights(grid.cols, n_cols)
    r1, c1 = np.minimum(r + 1, n_rows - 1), np.minimum(c + 1, n_cols - 1)
    south = logs[r] * (1.0 - fr)[:, None] + logs[r1] * fr[:, None]
    return np.exp(south[:, c] * (1.0 - fc) + south[:, c1] * fc)


def warm_up() -> None:
    """Compile everything a map needs (or load it from the cache), so that no mission step waits for it."""
    east, north = np.meshgrid(np.arange(4.0), np.arange(4.0))
    depth = 10.0 + 0.1 * east + np.sin(north)
    soundings = Soundings(east.ravel(), north.ravel(), depth.ravel(), np.full(16, 0.1))
    grid = Grid(0.0, 0.0, 1.0, 4, 4)
    GaussianProcessMap().fit(soundings).predict(grid)
    GaussianInterpolator(grid, 1.0).add(soundings)
