"""The default map: a nonstationary Gaussian process, kriged locally."""

import copy
import math
from dataclasses import replace
from functools import cache
from typing import Literal, Self

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.cell_index import count_per_cell
from app.mapping.gaussian import GaussianInterpolator
from app.mapping.gaussian_process.calibration import (
    APART_UNITS,
    MISSES_RANGE,
    Calibration,
    HeldOutSoundings,
    across_gaps,
    checked_log_scale,
    error_ratio,
    hold_out_beyond,
    misses,
    mixed,
    predicted_without,
    together,
    uncalibrated,
)
from app.mapping.gaussian_process.learning import ROUGHEST, choose_kernel, conditioned, lengthen, likelihood_of
from app.mapping.gaussian_process.reach import (
    FACTOR_STEP,
    LEAST_IN_STRIP,
    TESTS,
    UNCHECKED_FACTOR,
    Reach,
    likely_factor,
    likely_square,
    radii,
    reach,
    strip_neighbours,
)
from app.mapping.gaussian_process.roughness import hole_errors, local_ratio
from app.mapping.gaussian_process.support import support
from app.mapping.gross_errors.outliers import OutlierReport, flag_outliers
from app.mapping.kriging.fields import Field, coarse_grid
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging.kriging import Conditioned
from app.mapping.kriging.levels import two_levels
from app.mapping.kriging.likelihood import Hyperparameters, spread_subset
from app.mapping.kriging.neighbours import nearest
from app.mapping.kriging.scales import LocalScales, local_scales, stretch_from_relief, uniform_scales
from app.mapping.types import BathymetricMap, Grid, Soundings

COARSE_FACTOR = 3.0  # side of the squares of merged soundings over that of single ones
LEAST_RESOLUTION = 100  # squares of single soundings along the extent; more where there are more soundings

# lengths in squares of single soundings
HOLE_UNITS = 8.0
REACH_UNITS = 10.0  # how far roughness is carried where nothing was sounded
RELIEF_UNITS = 3.125  # cell of the coarse map that shows grain and edges
MOST_RELIEF_CELLS = 256
MOST_RATIO_CELLS = 128
MISSES_CELLS = 16  # along the longer side; as many as the checked soundings can tell apart

LEAST_HOLES, MOST_HOLES, SOUNDINGS_PER_HOLE = 800, 4000, 10
CHECK_POINTS = 800
BEYOND_UNITS = 25.0  # how far beyond the soundings predictions are checked

SMALL_GRID_CELLS = 60_000
NEIGHBOURS_OF_SMALL_GRIDS = (32, 64)
NEIGHBOURS_OF_LARGE_GRIDS = (32, 24)
SOUNDINGS_PER_TILE_OF_SMALL_GRIDS, SOUNDINGS_PER_TILE_OF_LARGE_GRIDS = 6, 10
TILE_RANGE = (4, 16)

MORE_IN_NOISE = 2  # times as many points to learn from, where the relief is smaller than the soundings' noise
REFINEMENT_GAIN = 5.0  # of log likelihood, to consider the nonstationary process
FULL_TRUST_GAIN = 0.04  # by which part it must predict better to be trusted alone

OF_SOUNDINGS = (
    "soundings_",
    "outliers_",
    "trend_",
    "_levels",
    "_plain",
    "_refined",
    "_rough",
    "_support",
    "_log_ratio",
    "_scale_fields",
    "_calibration",
    "_reach",
)
"""What every fit makes anew, however large."""


class GaussianProcessMap:
    """Depth and its uncertainty by Gaussian-process regression on soundings.

    The sea floor is a plane plus a process with correlation ``kernel`` (by default as smooth as the soundings
    suggest; where they do not surround a place, Matern 3/2). Length,
    amplitude and the factor on the stated noise variances are learned by restricted maximum likelihood on some
    of the soundings. Then the process becomes nonstationary (Paciorek and Schervish 2006)
    in two ways. Every sounding is predicted across a hole, eight sides of the merged squares in radius; how far these
    predictions miss, place by place, is the local roughness: correlation gets shorter where the bottom is rough,
    longer where it is smooth. And a first, stationary map shows along which direction the sea floor varies least;
    correlation gets longer in that direction and shorter across, so that an edge seen on two survey lines is
    continued between them.

    Prediction is local: every tile of the grid is kriged from its nearest soundings.

    Parameters
    ----------
    kernel
        ``auto`` (default: Matern 3/2 or a smoother one, by likelihood), ``matern32``, ``matern52``,
        ``exponential`` or ``gaussian``.
    nonstationary
        False for one length and amplitude everywhere.
    neighbours
        How many soundings, and how many merged ones farther away, each tile of the grid is predicted from.
    learning_points
        Bound on the soundings used to learn the hyperparameters; twice as many where the relief is smaller than
        their noise.
    merge_m
        Side of the squares whose soundings are merged into one; by default 1/100 of the extent of the
        soundings, less where there are many.
    reject_outliers
        Leave out soundings that ``flag_outliers`` rejects.
    least_merge_m
        The squares of merged soundings do not get smaller than that however many soundings there are, unless 1/100 of
        the extent is; 0: no bound.
    calibrate
        False leaves depths and deviations as the process alone predicts them: they are not checked against soundings
        that were held out.
    claims
        False saves the checks that only ``claim_sd_m`` needs, which is infinite then; nothing else depends on them.

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
        kernel: KernelName | Literal["auto"] = "auto",
        *,
        nonstationary: bool = True,
        neighbours: tuple[int, int] | None = None,
        learning_points: int = 350,
        merge_m: float | None = None,
        least_merge_m: float = 0.0,
        reject_outliers: bool = True,
        calibrate: bool = True,
        claims: bool = True,
    ) -> None:
        if kernel != "auto" and kernel not in KERNEL_CODES:
            raise ValueError(f"kernel is {kernel!r}; it must be auto or one of {', '.join(KERNEL_CODES)}")
        self.kernel = kernel
        self.nonstationary = nonstationary
        self.neighbours = neighbours
        self.learning_points = learning_points
        self.merge_m = merge_m
        self.least_merge_m = least_merge_m
        self.reject_outliers = reject_outliers
        self.calibrate = calibrate
        self.claims = claims

    def fit(self, soundings: Soundings, *, learn: bool = True) -> Self:
        """Take in all soundings so far.

        Parameters
        ----------
        learn
            False keeps the hyperparameters of an earlier fit (they are learned when there was none) and only
            takes in the soundings: much cheaper, right for most steps of a mission.

        Raises
        ------
        ValueError
            When there is no sounding, or one that is not finite or has no positive standard deviation.
        """
        soundings.check()
        if len(soundings) == 0:
            raise ValueError("soundings is empty; a map needs at least one sounding")
        start = getattr(self, "stationary_hyperparameters_", None)
        rough = getattr(self, "_rough_hyperparameters", None)
        self.outliers_: OutlierReport | None = None
        if self.reject_outliers:
            kernel = ROUGHEST if self.kernel == "auto" else self.kernel
            self.outliers_ = flag_outliers(soundings, kernel=kernel, hyperparameters=rough or start)
            start = start or self.outliers_.hyperparameters
            soundings = soundings.take(~self.outliers_.rejected)
        self.soundings_ = soundings
        extent = max(float(np.ptp(soundings.east_m)), float(np.ptp(soundings.north_m)), 1e-3)
        resolution = math.sqrt(len(soundings))
        if self.least_merge_m > 0.0:
            resolution = min(resolution, extent / self.least_merge_m)
        self._unit_m = self.merge_m or extent / max(LEAST_RESOLUTION, resolution)
        self._levels = two_levels(soundings, self._unit_m, COARSE_FACTOR * self._unit_m)
        learn = learn or not hasattr(self, "hyperparameters_")
        points = self.learning_points if learn else getattr(self, "_learned_from", self.learning_points)
        subset = spread_subset(self._levels.fine_tree, points)
        uniform = uniform_scales(len(self._levels.soundings))
        if learn:
            if self.kernel == "auto":
                self.kernel_, start = choose_kernel(self._levels, REACH_UNITS * self._unit_m)
            else:
                self.kernel_ = self.kernel
        likelihood = likelihood_of(self._levels, self.kernel_, subset, uniform, learn=learn)
        if learn:
            self.stationary_hyperparameters_, least = likelihood.maximise(start)
            if self.stationary_hyperparameters_.amplitude_m < float(np.median(self._levels.fine.sd_m)):
                # The relief drowns in noise: few points tell too little of its length.
                points *= MORE_IN_NOISE
                subset = spread_subset(self._levels.fine_tree, points)
                likelihood = likelihood_of(self._levels, self.kernel_, subset, uniform, learn=True)
                self.stationary_hyperparameters_, least = likelihood.maximise(self.stationary_hyperparameters_)
            self._learned_from = points
            self.refinement_ = 0.0
        self._plain = conditioned(self._levels, self.kernel_, self.stationary_hyperparameters_, likelihood, uniform)
        self._refined: Conditioned | None = None
        self._rough = self._rough_process(subset, learn=learn)
        cell = max(RELIEF_UNITS * self._unit_m, extent / MOST_RELIEF_CELLS)
        self._support = support(self._levels, cell, BEYOND_UNITS * self._unit_m)
        ratio = self._local_ratio()
        self._log_ratio = Field(ratio.grid, np.log(ratio.values))
        relief = self._coarse_relief(extent)
        self._scale_fields = _scale_fields(
            ratio, self._levels.points[: self._levels.n_fine], stretch_from_relief(*relief)
        )
        if self.nonstationary and (learn or self.refinement_ > 0.0):
            scales = _scales(self._scale_fields.at(self._levels.points))
            likelihood = likelihood_of(self._levels, self.kernel_, subset, scales, learn=learn)
            if learn:
                hyper, value = likelihood.maximise(self.stationary_hyperparameters_)
                self._refined_hyperparameters = lengthen(
                    self._levels, self.kernel_, hyper, likelihood, scales, REACH_UNITS * self._unit_m
                )
                self.refinement_ = float(value < least - REFINEMENT_GAIN)
            if self.refinement_ > 0.0:
                self._refined = conditioned(
                    self._levels, self.kernel_, self._refined_hyperparameters, likelihood, scales
                )
        self._calibration: Calibration | None = None
        if self.calibrate:
            self._calibration = uncalibrated(*relief, self._levels.fine_tree, self._levels.fine.sd_m, self._support)
        if learn:
            self._check()
        best = self._refined if self._refined is not None and self.refinement_ >= 0.5 else self._plain
        self.hyperparameters_ = (
            self._refined_hyperparameters if best is self._refined else self.stationary_hyperparameters_
        )
        self.trend_ = best.trend
        if self._calibration is not None:
            self._calibration = self._checked(self._calibration)
        self._reach: Reach | None = reach(self._levels, self._unit_m, self._factor) if self.calibrate else None
        return self

    def learned(self) -> Self:
        """Return what was learned, without the soundings: fit it with ``learn=False`` for the same predictions."""
        bare = copy.copy(self)
        for name in OF_SOUNDINGS:
            bare.__dict__.pop(name, None)
        return bare

    def _rough_process(self, subset: IntArray, *, learn: bool) -> Conditioned | None:
        """What is believed where soundings do not surround a place; None where the kernel is not smoother than that."""
        if learn:
            self._rough_hyperparameters: Hyperparameters | None = None
        if self.kernel != "auto" or self.kernel_ == ROUGHEST:
            return None
        known = None if learn else self._rough_hyperparameters
        uniform = uniform_scales(len(self._levels.soundings))
        likelihood = likelihood_of(self._levels, ROUGHEST, subset, uniform, learn=known is None)
        if known is None:
            known, _ = likelihood.maximise(self.stationary_hyperparameters_)
            self._rough_hyperparameters = known
        return conditioned(self._levels, ROUGHEST, known, likelihood, uniform)

    def _coarse_relief(self, extent: float) -> tuple[Grid, FloatArray]:
        """A coarse stationary map, depth minus trend: shows the grain and the edges of the sea floor."""
        cell = max(RELIEF_UNITS * self._unit_m, extent / MOST_RELIEF_CELLS)
        grid = coarse_grid(self._levels.fine_tree.mins, self._levels.fine_tree.maxes, cell)
        everywhere = np.ones((grid.rows, grid.cols), np.bool_)
        first, _ = self._plain.predict(grid, None, everywhere, NEIGHBOURS_OF_LARGE_GRIDS, 2)
        return grid, first - self._plain.trend(grid.centres_m).reshape(grid.rows, grid.cols)

    def _local_ratio(self) -> Field:
        """How variable the sea floor is, place by place, from predicting soundings across holes."""
        hyper = self.stationary_hyperparameters_
        fine, n = self._levels.fine, self._levels.n_fine
        count = min(max(LEAST_HOLES, n // SOUNDINGS_PER_HOLE), MOST_HOLES)
        errors = hole_errors(
            KERNEL_CODES[self.kernel_],
            self._levels.fine_tree,
            fine.depth_m - self._plain.trend(self._levels.points[:n]),
            hyper.noise_scale * fine.sd_m**2,
            uniform_scales(n).scaled_metric(hyper.length_m),
            np.full(n, hyper.amplitude_m),
            np.unique(np.linspace(0, n - 1, min(n, count)).astype(np.int64)),
            HOLE_UNITS * self._unit_m,
        )
        carried_m = REACH_UNITS * self._unit_m
        low, high = self._levels.fine_tree.mins, self._levels.fine_tree.maxes
        margin = 4.0 * carried_m  # beyond it the ratio has returned to what holds without soundings
        cell = max(RELIEF_UNITS * self._unit_m, float((high - low).max()) / MOST_RATIO_CELLS)
        grid = coarse_grid(low - margin, high + margin, cell)
        return Field(grid, local_ratio(errors, grid.centres_m, carried_m).reshape(1, grid.rows, grid.cols))

    def _check(self) -> None:
        """Hold soundings out: how far to trust the nonstationary process, and the factors on deviations."""
        n = self._levels.n_fine
        rows = np.unique(np.linspace(0, n - 1, min(n, CHECK_POINTS)).astype(np.int64))
        near = across_gaps(self._levels, rows, NEIGHBOURS_OF_LARGE_GRIDS)
        held_out = predicted_without(self._plain, rows, near)
        if self._refined is not None:
            refined = predicted_without(self._refined, rows, near)
            gain = 1.0 - error_ratio(refined, held_out)
            self.refinement_ = float(np.clip(gain / FULL_TRUST_GAIN, 0.0, 1.0))
            held_out = mixed(refined, held_out, self.refinement_)
        if self._calibration is not None:
            farthest = BEYOND_UNITS * self._unit_m
            wide = across_gaps(self._levels, rows, NEIGHBOURS_OF_LARGE_GRIDS, farthest)
            self._learn_calibration(self._calibration, together(held_out, self._predicted(rows, wide)))
            beyond = hold_out_beyond(self._rough or self._plain, rows, NEIGHBOURS_OF_LARGE_GRIDS, farthest)
            calibration = replace(self._calibration, misses=self.misses_)
            log_scale = checked_log_scale(beyond, calibration.variance_factor(beyond.points_m))
            self.log_scale_beyond_ = max(self.log_scale_, log_scale)
            self._factor = self._checked_factor(self._calibration) if self.claims else UNCHECKED_FACTOR

    def _checked(self, calibration: Calibration) -> Calibration:
        """Return the calibration with what the checks found."""
        return replace(
            calibration,
            misses=self.misses_,
            log_scale=self.log_scale_,
            log_scale_beyond=self.log_scale_beyond_,
            noise_scale=self.hyperparameters_.noise_scale,
        )

    def _learn_calibration(self, calibration: Calibration, held_out: HeldOutSoundings) -> None:
        """Learn from held-out soundings where the map misses by more than elsewhere, and by how much on the whole."""
        steepness = calibration.steepness_factor(held_out.points_m)
        found, reach = misses(held_out, steepness), REACH_UNITS * self._unit_m
        low, high = self._levels.fine_tree.mins, self._levels.fine_tree.maxes
        grid = coarse_grid(low, high, max(float((high - low).max()), 1e-3) / MISSES_CELLS)
        ratio = np.clip(local_ratio(found, grid.centres_m, reach), *MISSES_RANGE)
        self.misses_ = Field(grid, np.log(ratio).reshape(1, grid.rows, grid.cols))
        of_others = local_ratio(found, held_out.points_m, reach, APART_UNITS * self._unit_m)
        self.log_scale_ = checked_log_scale(held_out, steepness * np.clip(of_others, *MISSES_RANGE))

    def _checked_factor(self, calibration: Calibration) -> float:
        """Hold soundings out over longer and longer distances: which factor on the deviation that leaves possible."""
        n = self._levels.n_fine
        rows = np.unique(np.linspace(0, n - 1, min(n, TESTS)).astype(np.int64))
        squares = []
        for radius in radii(self._levels, self._unit_m, FACTOR_STEP):
            holes = self._levels.neighbours_beyond(
                self._levels.points[rows], np.full(len(rows), radius), *NEIGHBOURS_OF_LARGE_GRIDS
            )
            strips = strip_neighbours(self._levels, rows, radius)
            enough = (strips >= 0).sum(axis=1) >= LEAST_IN_STRIP
            for held_out in (self._predicted(rows, holes), self._predicted(rows[enough], strips[enough])):
                factor = calibration.steepness_factor(held_out.points_m)
                square = likely_square(held_out, factor, self.log_scale_, 2.0 * radius)
                squares += [] if square is None else [square]
        return likely_factor(squares)

    def _predicted(self, rows: IntArray, neighbours: IntArray) -> HeldOutSoundings:
        """Predict soundings from others as the map would."""
        plain = predicted_without(self._plain, rows, neighbours)
        if self._refined is None or self.refinement_ == 0.0:
            return plain
        return mixed(predicted_without(self._refined, rows, neighbours), plain, self.refinement_)

    def _scales_over(self, grid: Grid) -> LocalScales:
        return _scales(self._scale_fields.over(grid).reshape(3, -1))

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
        neighbours = self.neighbours or (NEIGHBOURS_OF_SMALL_GRIDS if _small(grid) else NEIGHBOURS_OF_LARGE_GRIDS)
        depth, variance = self._predict(grid, wanted, neighbours)
        deviation = even = np.sqrt(variance)
        if self._calibration is not None:
            deviation, even = self._calibration.deviations(grid, variance)
        process_sd, bound = None, None
        if self._reach is not None:
            distance = nearest(self._levels.fine_tree, grid.centres_m, 1)[0].reshape(shape)
            depth, moved = self._reach.plausible(depth, distance, grid.cell_m)
            deviation = np.hypot(deviation, moved)
            process_sd = deviation
            bound = self._reach.bound(np.hypot(even, moved), distance, grid.cell_m)
            deviation = self._reach.deviation(deviation, distance)
        if not self.claims:
            bound = np.full(shape, np.inf)
        count = count_per_cell(grid, self.soundings_)
        roughness = np.where(wanted, np.exp(self._log_ratio.over(grid)[0]), np.nan)
        kind = "nonstationary" if self.refinement_ > 0.0 else "stationary"
        return BathymetricMap(
            grid=grid,
            depth_m=depth,
            sd_m=deviation,
            count=count,
            sounded=count > 0,
            roughness=roughness / np.nanmean(roughness) if wanted.any() else roughness,
            correlation_length_m=self.hyperparameters_.length_m,
            model=f"{kind} Gaussian process, {self.kernel_}",
            process_sd_m=process_sd,
            bound_sd_m=bound,
        )

    def _predict(self, grid: Grid, wanted: BoolArray, neighbours: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Depth and variance, (rows, cols), averaged over the processes as far as each is trusted."""
        side = self._tile_cells(grid)
        depth, variance = self._predict_between(grid, wanted, neighbours, side)
        if self._rough is None:
            return depth, variance
        surrounded = self._support.over(grid)[0]
        beyond = wanted & (surrounded < 1.0)
        rough = self._rough.predict(grid, None, beyond, neighbours, side)
        both = _averaged((depth, variance), rough, surrounded)
        return np.where(beyond, both[0], depth), np.where(beyond, both[1], variance)

    def _predict_between(
        self, grid: Grid, wanted: BoolArray, neighbours: tuple[int, int], side: int
    ) -> tuple[FloatArray, FloatArray]:
        """Depth and variance by the chosen kernel."""
        weight = self.refinement_
        if self._refined is None or weight == 0.0:
            return self._plain.predict(grid, None, wanted, neighbours, side)
        refined = self._refined.predict(grid, self._scales_over, wanted, neighbours, side)
        if weight == 1.0:
            return refined
        return _averaged(refined, self._plain.predict(grid, None, wanted, neighbours, side), weight)

    def _tile_cells(self, grid: Grid) -> int:
        """Side of the tiles: few soundings in each, so that all its cells have much the same nearest ones."""
        soundings = SOUNDINGS_PER_TILE_OF_SMALL_GRIDS if _small(grid) else SOUNDINGS_PER_TILE_OF_LARGE_GRIDS
        side = math.sqrt(soundings) * self._unit_m / grid.cell_m
        return int(np.clip(round(side), *TILE_RANGE))


def _scale_fields(ratio: Field, points: FloatArray, log_stretch: Field) -> Field:
    """Logarithm of the roughness, 0 on average over the soundings, and of the stretch, on one grid: (3, rows, cols)."""
    log_ratio = np.log(ratio.values)
    log_ratio -= float(Field(ratio.grid, log_ratio).at(points).mean())
    return Field(ratio.grid, np.concatenate([log_ratio, log_stretch.over(ratio.grid)]))


def _averaged(
    one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray], weight: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Mean and variance of a mixture of two predictions, of which ``one`` has the ``weight``."""
    apart = one[0] - other[0]
    variance = weight * one[1] + (1.0 - weight) * (other[1] + weight * apart**2)
    return other[0] + weight * apart, variance


def _small(grid: Grid) -> bool:
    return grid.rows * grid.cols <= SMALL_GRID_CELLS


def _scales(fields: FloatArray) -> LocalScales:
    return local_scales(np.exp(fields[0]), fields[1:])


@cache
def warm_up() -> None:
    """Compile everything a map needs (or load it from the cache), so that no mission step waits for it."""
    east, north = np.meshgrid(np.arange(4.0), np.arange(4.0))
    depth = 10.0 + 0.1 * east + np.sin(north)
    soundings = Soundings(east.ravel(), north.ravel(), depth.ravel(), np.full(16, 0.1))
    grid = Grid(0.0, 0.0, 1.0, 4, 4)
    # With more soundings than it learns from at once, so that all that learning needs is compiled.
    GaussianProcessMap(learning_points=8).fit(soundings).predict(grid)
    GaussianInterpolator(grid, 1.0).add(soundings)
