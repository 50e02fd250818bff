"""The map of a swath survey: the mean of the soundings in each cell, and nothing invented between."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from app.arrays import BoolArray, FloatArray
from app.mapping.slope import gradient, scatter_m
from app.mapping.swath.density import DensityGrid
from app.mapping.types import BathymetricMap

MODEL = "mean of the soundings in each cell"

GUESS_GROWTH = 0.15
"""Metres of standard deviation for each metre away from the nearest cell with a sounding."""

BRIDGED_CELLS = 2.0
"""A cell without a sounding that is no farther from one counts as supported by it."""


def gridded_map(density: DensityGrid) -> BathymetricMap | None:
    """Return the map; None where nothing was sounded.

    A cell's deviation joins that of its mean, what the spread within it leaves of a few soundings, what its soundings
    share, and what uncertain positions do on a slope. A gap that is bridged from both sides is filled in a straight
    line. Elsewhere the depth without a sounding is that of the nearest cell, the less sure the farther and the steeper;
    beyond what is bridged no claim is made of it.
    """
    if not density.ensonified.any():
        return None
    mask, cell_m = density.mask, density.grid.cell_m
    depth, sd, spread = density.depth_m, density.sd_m, density.spread_m
    count = density.count
    sounded = count > 0
    filled, gap = _over_gaps(depth, sounded)
    between = ~sounded & (gap <= 2.0 * BRIDGED_CELLS + 1.0)
    slope = gradient(filled, cell_m, np.hypot(sd, spread / np.sqrt(np.maximum(count, 1))))
    sd = np.hypot(sd, scatter_m(spread, slope, cell_m) / np.sqrt(np.maximum(count, 1)))
    aside = density.horizontal_sd_m
    away, nearest = distance_transform_edt(~sounded, return_indices=True)
    at = tuple(nearest)
    shared = np.hypot(density.shared_sd_m[at], np.nan_to_num(aside[at]) * slope[at])
    sd = np.hypot(sd[at], shared)
    depth = _inside(np.where(between, filled, depth[at]), mask)
    steeper = np.where(between, 0.0, slope[at])
    sd = _inside(np.hypot(sd, np.hypot(GUESS_GROWTH, steeper) * away * cell_m), mask)
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
        correlation_length_m=5.0 * cell_m,
        model=MODEL,
        bound_sd_m=_inside(bound, mask),
        precision=np.where(mask, density.precision, 0.0),
        horizontal_sd_m=np.where(sounded & mask, aside, np.nan) if np.isfinite(aside).any() else None,
        shared_sd_m=np.where(sounded & mask, shared, np.nan),
    )


def _over_gaps(depth_m: FloatArray, sounded: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return depths in a straight line over each gap, and how many cells its sides lie apart, (rows, cols) both.

    Along the grid or across it, wherever the gap is shorter; NaN, and infinite, where it has no two sides.
    """
    along, gap = _over_gaps_of_rows(depth_m, sounded)
    across, other = (layer.T for layer in _over_gaps_of_rows(depth_m.T, sounded.T))
    shortest = np.minimum(gap, other)
    line = np.where(other < gap, across, along)
    return np.where(sounded, depth_m, np.where(np.isfinite(shortest), line, np.nan)), shortest


def _over_gaps_of_rows(depth_m: FloatArray, sounded: BoolArray) -> tuple[FloatArray, FloatArray]:
    last = depth_m.shape[1] - 1
    cols = np.broadcast_to(np.arange(last + 1), depth_m.shape)
    before = np.maximum.accumulate(np.where(sounded, cols, -1), axis=1)
    after = last - np.maximum.accumulate(np.where(sounded, last - cols, -1)[:, ::-1], axis=1)[:, ::-1]
    inside = (before >= 0) & (after <= last)
    one = np.take_along_axis(depth_m, np.maximum(before, 0), axis=1)
    two = np.take_along_axis(depth_m, np.minimum(after, last), axis=1)
    gap = np.where(inside, after - before, np.inf)
    return one + (two - one) * (cols - before) / np.maximum(gap, 1.0), gap


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
