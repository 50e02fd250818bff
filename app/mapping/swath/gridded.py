"""The map of a swath survey: the mean of the soundings in each cell, and nothing invented between."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt, uniform_filter

from app.arrays import BoolArray, FloatArray
from app.mapping.swath.density import DensityGrid
from app.mapping.types import BathymetricMap

MODEL = "mean of the soundings in each cell"

GUESS_GROWTH = 0.15
"""Metres of standard deviation for each metre away from the nearest cell with a sounding."""

SMOOTHED_CELLS = 5
"""Depths are smoothed over so many cells to tell the slope: the scatter of soundings is none."""

BRIDGED_CELLS = 2.0
"""A cell without a sounding that is no farther from one counts as supported by it."""


def gridded_map(density: DensityGrid) -> BathymetricMap | None:
    """Return the map; None where nothing was sounded.

    A cell's deviation joins that of its mean, the spread within it, which a few soundings do not average out, what its
    soundings share, and what uncertain positions do on a slope. Where nothing was sounded the depth is that of the
    nearest cell, less and less sure; no claim is made of it.
    """
    if not density.ensonified.any():
        return None
    mask = density.mask
    depth, sd, spread = density.depth_m, density.sd_m, density.spread_m
    count = density.count
    with np.errstate(divide="ignore", invalid="ignore"):
        sd = np.hypot(sd, spread / np.sqrt(np.maximum(count, 1)))
    aside = density.horizontal_sd_m
    sounded = count > 0
    away, nearest = distance_transform_edt(~sounded, return_indices=True)
    away_m = away * density.grid.cell_m
    at = tuple(nearest)
    shared = np.hypot(density.shared_sd_m[at], aside[at] * gradient(depth[at], density.grid.cell_m))
    sd = np.hypot(sd[at], shared)
    depth = _inside(depth[at], mask)
    sd = _inside(np.hypot(sd, GUESS_GROWTH * away_m), mask)
    bound = np.where(away <= BRIDGED_CELLS, sd, np.inf)
    spread = np.where(sounded, spread, np.nan)
    rough = np.ones_like(depth)
    usual = float(np.nanmean(spread)) if np.isfinite(spread).any() else 0.0
    if usual > 0.0:
        rough = np.where(sounded, spread / usual, 1.0)
    return BathymetricMap(
        grid=density.grid,
        depth_m=depth,
        sd_m=sd,
        count=np.where(mask, count, 0),
        sounded=sounded & mask,
        roughness=_inside(rough, mask),
        correlation_length_m=5.0 * density.grid.cell_m,
        model=MODEL,
        bound_sd_m=_inside(bound, mask),
        precision=np.where(mask, density.precision, 0.0),
        horizontal_sd_m=np.where(sounded & mask, aside, np.nan) if np.nanmax(aside) > 0.0 else None,
        shared_sd_m=np.where(sounded & mask, shared, np.nan),
    )


def gradient(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return how much deeper it becomes per metre, (rows, cols), of depths smoothed over five cells."""
    smooth = uniform_filter(depth_m, SMOOTHED_CELLS, mode="nearest")
    slopes = [np.gradient(smooth, cell_m, axis=axis) for axis in (0, 1) if depth_m.shape[axis] > 1]
    return np.asarray(np.sqrt(sum((slope**2 for slope in slopes), np.zeros_like(depth_m))))


def area_of(bathymetry: BathymetricMap) -> BoolArray:
    """Return which cells of a map of swaths belong to its area, seen or not."""
    return np.asarray(np.isfinite(bathymetry.roughness))


def without_guesses(bathymetry: BathymetricMap) -> BathymetricMap:
    """Return a map of swaths as it is shown: with no depth where nothing speaks for one."""
    seen = np.isfinite(bathymetry.claim_sd_m)
    return replace(
        bathymetry,
        depth_m=np.where(seen, bathymetry.depth_m, np.nan),
        sd_m=np.where(seen, bathymetry.sd_m, np.nan),
    )


def is_of_swaths(bathymetry: BathymetricMap) -> bool:
    """Return whether a map is such a one, alone or with what was known before."""
    return bathymetry.model.startswith(MODEL)


def _inside(values: FloatArray, mask: BoolArray) -> FloatArray:
    return np.where(mask, values, np.nan)
