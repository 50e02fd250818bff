"""What one survey alone found of a site, and the same on another grid."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from app.arrays import BoolArray, FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.types import BathymetricMap, Grid

FINEST = 8
"""A cell is sampled at most at so many times so many places."""

ROWS_AT_ONCE = 512


@dataclass(frozen=True)
class Survey:
    """What one survey alone found; every layer has shape (rows, cols).

    Attributes
    ----------
    depth_m, sd_m
        Depth, positive down, and its standard deviation without what the whole survey shares; NaN where nothing was
        found.
    sounded
        Where the survey sounded; elsewhere its soundings support the depth.
    time_s
        When it was made, Unix seconds.
    shared_sd_m
        Standard deviation of what all its depths share, such as the water level.
    correlation_length_m
        How far its errors belong together: taken to be as far as depths do, which is the most they can.
    """

    grid: Grid
    depth_m: FloatArray
    sd_m: FloatArray
    sounded: BoolArray
    time_s: float
    shared_sd_m: float = 0.0
    correlation_length_m: float = 0.0

    @property
    def known(self) -> BoolArray:
        """Return where it found a depth, (rows, cols)."""
        return np.isfinite(self.depth_m)

    @property
    def variance_m2(self) -> FloatArray:
        """Return the variance of its depths, what they share included, (rows, cols)."""
        return np.asarray(self.sd_m**2 + self.shared_sd_m**2)


def survey_of(own: BathymetricMap, time_s: float, shared_sd_m: float) -> Survey:
    """Return what a map that was made of one survey's soundings alone knows of the floor.

    Nothing is known where no sounding supports the map: there it only continues what it saw.
    """
    supported = own.sounded if own.bound_sd_m is None else own.sounded | np.isfinite(own.bound_sd_m)
    known = supported & np.isfinite(own.depth_m) & np.isfinite(own.sd_m)
    return Survey(
        grid=own.grid,
        depth_m=np.where(known, own.depth_m, np.nan),
        sd_m=np.where(known, own.sd_m, np.nan),
        sounded=own.sounded & known,
        time_s=time_s,
        shared_sd_m=shared_sd_m,
        correlation_length_m=own.correlation_length_m,
    )


def resample(survey: Survey, frame: LocalFrame, grid: Grid, onto: LocalFrame) -> Survey:
    """Return a survey of the frame ``frame`` on a grid of the frame ``onto``.

    Depths between the survey's cells are interpolated; at the edge of what it knows the nearest cell's is taken. A
    larger cell has the mean of what is known in it, and none where that is less than half of it. The deviation is the
    mean one: errors of neighbouring cells belong together.
    """
    same_frame = (frame.origin_lat_deg, frame.origin_lon_deg) == (onto.origin_lat_deg, onto.origin_lon_deg)
    if same_frame and survey.grid == grid:
        return survey
    places = min(FINEST, max(1, round(grid.cell_m / survey.grid.cell_m)))
    offsets_m = ((np.arange(places) + 0.5) / places - 0.5) * grid.cell_m
    shape = (grid.rows, grid.cols)
    depth, sd, sounded = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=bool)
    for first in range(0, grid.rows, ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        north, east = np.meshgrid(grid.north_m[rows], grid.east_m, indexing="ij")
        sums, number = np.zeros((3, *north.shape)), np.zeros(north.shape)
        for up_m in offsets_m:
            for right_m in offsets_m:
                at = east + right_m, north + up_m
                found = _sampled(survey, at if same_frame else frame.to_local(*onto.to_geographic(*at)))
                there = np.isfinite(found[0])
                sums += np.where(there, found, 0.0)
                number += there
        enough = number >= max(1.0, 0.5 * places**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth[rows], sd[rows] = np.where(enough, sums[:2] / number, np.nan)
        sounded[rows] = enough & (sums[2] > 0.0)
    return Survey(grid, depth, sd, sounded, survey.time_s, survey.shared_sd_m, survey.correlation_length_m)


def _sampled(survey: Survey, at: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return depth, deviation and whether it was sounded at places, (3, ...); NaN where nothing is known."""
    grid = survey.grid
    row = (at[1] - grid.south_m) / grid.cell_m - 0.5
    col = (at[0] - grid.west_m) / grid.cell_m - 0.5
    nearest = np.rint(row).astype(int), np.rint(col).astype(int)
    within = (nearest[0] >= 0) & (nearest[0] < grid.rows) & (nearest[1] >= 0) & (nearest[1] < grid.cols)
    cell = tuple(np.where(within, index, 0) for index in nearest)
    known = within & survey.known[cell]
    between = [map_coordinates(layer, [row, col], order=1, cval=np.nan) for layer in (survey.depth_m, survey.sd_m)]
    of_cell = survey.depth_m[cell], survey.sd_m[cell]
    found = [np.where(np.isfinite(fine), fine, coarse) for fine, coarse in zip(between, of_cell, strict=True)]
    return np.where(known, np.array([*found, survey.sounded[cell]], dtype=float), np.nan)
