"""A survey area in the frame of its lines: along them and across."""

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import distance_transform_edt

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage

STEEP_BLOCK, STEEP, FEWEST_RISES = 0.25, 0.95, 4
"""Steep is what so large a share of all ground is not, between blocks of this part of the depth; of fewer rises nothing
is said."""

NEVER_BETWEEN = 0.7
"""Places so many cells apart, in rows of any direction, leave no cell out."""


@dataclass(frozen=True)
class Flying:
    """How vehicles fly over the area.

    Attributes
    ----------
    sonar
    depth_m
        Depth of travel where the bottom leaves room.
    min_altitude_m
        Least height above the bottom.
    radius_m
        Of the turning circle.
    overlap
        Share of a swath's half that is sounded twice, on the safe side.
    """

    sonar: SwathSonar
    depth_m: float
    min_altitude_m: float
    radius_m: float
    overlap: float

    def altitude_m(self, bottom_m: FloatArray) -> FloatArray:
        """Return how high above the bottom a vehicle flies over ground of that depth."""
        travels_m = np.clip(bottom_m - self.min_altitude_m, 0.0, self.depth_m)
        return np.asarray(np.maximum(bottom_m - travels_m, 0.0))

    def half_width_m(self, bottom_m: FloatArray) -> FloatArray:
        """Return how far to either side the bottom is seen over ground of that depth."""
        return self.sonar.half_width_m(self.altitude_m(bottom_m))


@dataclass(frozen=True)
class Axes:
    """The frame of lines in a direction, anticlockwise from east: ``along`` them, and ``across`` to their left."""

    direction_rad: float

    def turned(self, en_m: FloatArray) -> FloatArray:
        """Return places (..., 2), east and north, as along and across."""
        cos, sin = np.cos(self.direction_rad), np.sin(self.direction_rad)
        east, north = en_m[..., 0], en_m[..., 1]
        return np.stack([cos * east + sin * north, cos * north - sin * east], axis=-1)

    def to_en(self, turned_m: FloatArray) -> FloatArray:
        """Return places (..., 2), along and across, as east and north."""
        cos, sin = np.cos(self.direction_rad), np.sin(self.direction_rad)
        along, across = turned_m[..., 0], turned_m[..., 1]
        return np.stack([cos * along - sin * across, sin * along + cos * across], axis=-1)


@dataclass
class LineRaster:
    """The area in the frame of its lines; arrays have shape (along, across).

    Attributes
    ----------
    axes
    corner_m : (2,)
        Along and across of the outer corner of cell (0, 0).
    cell_m
    open
        What is still to be ensonified.
    wanted
        What the area is.
    depth_m
        Depth of the bottom, everywhere: where it is unknown as shoal as it has to be reckoned with.
    likely_m
        The same, where it is unknown that of the closest known place: by it lines are counted and shared out.
    """

    axes: Axes
    corner_m: FloatArray
    cell_m: float
    open: BoolArray
    wanted: BoolArray
    depth_m: FloatArray
    likely_m: FloatArray
    _half_widths: dict[Flying, FloatArray] = field(default_factory=dict)
    _likely_half_widths: dict[Flying, FloatArray] = field(default_factory=dict)

    def half_width_m(self, flying: Flying) -> FloatArray:
        """Return how far to either side the bottom is seen over each cell."""
        if flying not in self._half_widths:
            self._half_widths[flying] = flying.half_width_m(self.depth_m)
        return self._half_widths[flying]

    def likely_half_width_m(self, flying: Flying) -> FloatArray:
        """Return how far to either side the bottom is likely seen over each cell."""
        if flying not in self._likely_half_widths:
            self._likely_half_widths[flying] = flying.half_width_m(self.likely_m)
        return self._likely_half_widths[flying]

    def work_m(self, flying: Flying) -> FloatArray:
        """Return how much of a line each cell takes, by the width that is likely seen over it."""
        return np.asarray(self.cell_m**2 / np.maximum(2.0 * self.likely_half_width_m(flying), self.cell_m))

    @property
    def along_m(self) -> FloatArray:
        """Centres of the columns."""
        return np.asarray(self.corner_m[0] + (np.arange(self.open.shape[0]) + 0.5) * self.cell_m)

    @property
    def across_m(self) -> FloatArray:
        """Centres across the lines."""
        return np.asarray(self.corner_m[1] + (np.arange(self.open.shape[1]) + 0.5) * self.cell_m)

    def rows_of(self, across_m: FloatArray) -> IntArray:
        """Return the cells across the lines that places lie in, the outermost for places beyond."""
        rows = np.floor((across_m - self.corner_m[1]) / self.cell_m).astype(np.int64)
        return np.asarray(np.clip(rows, 0, self.open.shape[1] - 1))

    def columns_of(self, along_m: FloatArray) -> IntArray:
        """Return the cells along the lines that places lie in, the outermost for places beyond."""
        columns = np.floor((along_m - self.corner_m[0]) / self.cell_m).astype(np.int64)
        return np.asarray(np.clip(columns, 0, self.open.shape[0] - 1))

    def under(self, path_m: FloatArray, flying: Flying) -> BoolArray:
        """Return what a path (k, 2), east and north, sees: across itself, wherever it leads."""
        turned = self.axes.turned(path_m)
        steps = np.diff(turned, axis=0)
        lengths = np.hypot(*steps.T)
        apart_m = NEVER_BETWEEN * self.cell_m
        at = np.arange(0.5 * apart_m, max(float(lengths.sum()), apart_m), apart_m)
        begins = np.concatenate([[0.0], np.cumsum(lengths)])
        piece = np.clip(np.searchsorted(begins, at, side="right") - 1, 0, len(lengths) - 1)
        towards = steps[piece] / np.maximum(lengths[piece], 1e-9)[:, None]
        places = turned[piece] + (at - begins[piece])[:, None] * towards
        below_m = self.depth_m[self.columns_of(places[:, 0]), self.rows_of(places[:, 1])]
        widest_m = float(flying.half_width_m(below_m).max(initial=0.0)) * 1.5 + self.cell_m
        aside_m = np.arange(-widest_m, widest_m + apart_m, apart_m)
        seen = np.zeros_like(self.open)
        beside = places[:, None] + aside_m[:, None] * np.stack([-towards[:, 1], towards[:, 0]], axis=-1)[:, None]
        i = np.floor((beside[..., 0] - self.corner_m[0]) / self.cell_m).astype(np.int64)
        j = np.floor((beside[..., 1] - self.corner_m[1]) / self.cell_m).astype(np.int64)
        inside = (i >= 0) & (i < self.open.shape[0]) & (j >= 0) & (j < self.open.shape[1])
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        travels_m = (below_m - flying.altitude_m(below_m))[:, None]
        near = np.abs(aside_m) <= flying.sonar.half_width_m(np.maximum(self.depth_m[i, j] - travels_m, 0.0))
        near &= inside
        seen[i[near], j[near]] = True
        return seen

    def seen(self, columns: IntArray, across_m: FloatArray, flying: Flying) -> BoolArray:
        """Return what a line sees, (n, across): in ``columns`` (n,) it lies at ``across_m`` (n,)."""
        below_m = self.depth_m[columns, self.rows_of(across_m)]
        travels_m = below_m - flying.altitude_m(below_m)
        down_m = np.maximum(self.depth_m[columns] - travels_m[:, None], 0.0)
        aside_m = np.abs(self.across_m - across_m[:, None])
        near = aside_m <= flying.sonar.half_width_m(down_m)
        return np.asarray(near)


SHOALING, SHOALING_OF_STEEP = (0.01, 0.1), 1.0
"""Metres by which unknown ground is presumed to rise a metre away from known ground, least and most: so many times what
the steepest known ground does. Lines rather begin too close."""


class Rasters:
    """Rasters of areas whose unknown ground rises as steep known ground does.

    Parameters
    ----------
    cell_m
        Their cell, where the coverage's is not coarser.
    guess_m
        Depth that is taken as long as none is known.
    """

    def __init__(self, cell_m: float, guess_m: float) -> None:
        self.cell_m, self.guess_m = cell_m, guess_m
        self._shoaling: tuple[FloatArray, float] | None = None
        """How much the bottom is presumed to rise, and the depths that this follows from."""

    def of(self, coverage: Coverage, direction_rad: float) -> LineRaster:
        """Return an area in the frame of lines in a direction, anticlockwise from east."""
        if self._shoaling is None or self._shoaling[0] is not coverage.depth_m:
            steep = SHOALING_OF_STEEP * steepness(coverage)
            self._shoaling = coverage.depth_m, float(np.clip(steep, *SHOALING))
        return raster_of(coverage, direction_rad, self.cell_m, self.guess_m, self._shoaling[1])


def raster_of(
    coverage: Coverage, direction_rad: float, cell_m: float, guess_m: float, shoaling: float = 0.0
) -> LineRaster:
    """Return an area in the frame of lines in a direction, with cells not finer than those of the grid.

    ``guess_m`` is taken for the depth as long as none is known. Away from known places the bottom is taken to rise by
    ``shoaling``, metres a metre, up to half of its depth.
    """
    axes = Axes(direction_rad)
    wanted_m = axes.turned(coverage.places_m(coverage.wanted))
    cell_m = max(cell_m, coverage.cell_m)
    corner = wanted_m.min(axis=0) - 0.5 * coverage.cell_m
    shape = np.maximum(np.ceil((wanted_m.max(axis=0) + 0.5 * coverage.cell_m - corner) / cell_m - 1e-6), 1).astype(int)

    def cells(places_m: FloatArray) -> tuple[IntArray, IntArray]:
        at = np.floor((places_m - corner) / cell_m).astype(np.int64)
        return np.clip(at[:, 0], 0, shape[0] - 1), np.clip(at[:, 1], 0, shape[1] - 1)

    wanted, still_open = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    wanted[cells(wanted_m)] = True
    still_open[cells(axes.turned(coverage.places_m(coverage.left)))] = True
    known = np.isfinite(coverage.depth_m) & coverage.wanted
    at = cells(axes.turned(coverage.places_m(known)))
    flat = at[0] * shape[1] + at[1]
    count = np.bincount(flat, minlength=int(shape.prod())).reshape(shape)
    total = np.bincount(flat, coverage.depth_m[known], minlength=int(shape.prod())).reshape(shape)
    depth = np.divide(total, count, out=np.full(shape, np.nan), where=count > 0)
    return LineRaster(axes, corner, cell_m, still_open, wanted, *_filled(depth, guess_m, shoaling * cell_m))


def steepness(coverage: Coverage) -> float:
    """Return how much steep known ground rises, metres a metre, between blocks of cells.

    Infinite where hardly any is known.
    """
    known_m = coverage.depth_m[np.isfinite(coverage.depth_m)]
    if not known_m.size:
        return np.inf
    side_m = STEEP_BLOCK * float(np.median(known_m))
    blocks = coverage.coarser(max(1, round(side_m / coverage.cell_m)))
    rises = np.concatenate([np.abs(np.diff(blocks.depth_m, axis=axis)).ravel() for axis in (0, 1)])
    rises = rises[np.isfinite(rises)]
    return float(np.quantile(rises, STEEP)) / blocks.cell_m if len(rises) >= FEWEST_RISES else np.inf


def _filled(depth_m: FloatArray, guess_m: float, rise_m: float) -> tuple[FloatArray, FloatArray]:
    """Return depths where there is none: the closest known one less ``rise_m`` for each cell between, and without."""
    unknown = np.isnan(depth_m)
    if unknown.all():
        return np.full_like(depth_m, guess_m), np.full_like(depth_m, guess_m)
    if not unknown.any():
        return depth_m, depth_m
    away, nearest = distance_transform_edt(unknown, return_indices=True)
    closest_m = depth_m[tuple(nearest)]
    return np.maximum(closest_m - rise_m * away, 0.5 * closest_m), closest_m
