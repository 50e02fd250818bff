"""Cells by depth: the deeper the water, the larger the cells that soundings and charts ask for."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.slope import gradient, scatter_m
from app.mapping.types import BathymetricMap, Grid

OVERLAP = 0.1
"""A tier begins at depths that are smaller by this share than where the one with half its cell ends."""


@dataclass(frozen=True)
class Tier:
    """Cells of one size.

    Attributes
    ----------
    map
        Its cells; those without a sounding, and those that hold no depth of the tier, have no depth.
    from_m, to_m
        The depths that the tier is for; the former begins within the tier of half its cell.
    least_depth_m : (rows, cols)
        The least depth of the smallest sounded cells in each; NaN where it has no depth.
    """

    map: BathymetricMap
    from_m: float
    to_m: float
    least_depth_m: FloatArray


def doublings(depth_m: FloatArray, cell_m: float, cell_of_depth: float) -> IntArray:
    """Return how often a cell is doubled until it is at least a share of the depth; 0 where that is unknown."""
    asked = np.nan_to_num(depth_m, nan=0.0) * cell_of_depth / cell_m
    # A depth at a tier's very end belongs to it, whatever the rounding of the product.
    return np.asarray(np.ceil(np.log2(np.maximum(asked, 1.0)) - 1e-9), np.int64)


def asked_of(depth_m: FloatArray, cell_m: float, cell_of_depth: float | None) -> IntArray:
    """Return how often the finest cell is doubled for each place, (rows, cols), by the nearest known depth.

    0 everywhere with cells of one size, and where no depth is known at all.
    """
    known = np.isfinite(depth_m)
    if cell_of_depth is None or not known.any():
        return np.zeros(depth_m.shape, np.int64)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return doublings(depth_m[tuple(nearest)], cell_m, cell_of_depth)


def by_depth(
    count: IntArray, area: BoolArray, asked: IntArray, judge: Callable[[IntArray, BoolArray], IntArray | BoolArray]
) -> IntArray:
    """Return what is judged of the cells that each place's depth asks for; 0 outside of the area.

    Parameters
    ----------
    count, area : (rows, cols)
        Soundings in the finest cells, and which of these belong to the area.
    asked : (rows, cols)
        How often the finest cell is doubled for each place.
    judge
        Is given soundings and area of cells of one size, and returns a number for each of them.
    """
    if not asked.any():
        return np.where(area, judge(count, area), 0)
    found = np.zeros(count.shape, np.int64)
    for number in np.unique(asked[area]).tolist():
        times = 2**number
        judged = judge(_total(count, times).astype(np.int64), _any(area, times))
        here = area & (asked == number)
        found[here] = _finer(judged.astype(float), times, area)[here]
    return found


def tiers(bathymetry: BathymetricMap, cell_of_depth: float) -> list[Tier]:
    """Return the tiers that the sounded depths of a map ask for, finest first.

    The cell of each is the map's, doubled until it is at least ``cell_of_depth`` of the tier's depths.
    """
    cell_m = bathymetry.grid.cell_m
    sounded = _sounded(bathymetry)
    depth = np.where(sounded, bathymetry.depth_m, np.nan)
    made = []
    for number in np.unique(doublings(depth[sounded], cell_m, cell_of_depth)).tolist():
        times = 2**number
        to_m = cell_m * times / cell_of_depth
        from_m = (1.0 - OVERLAP) * to_m / 2.0 if number else -np.inf
        asked = sounded & (depth >= from_m) & (doublings(depth, cell_m, cell_of_depth) <= number)
        coarse = coarsened(bathymetry, times)
        model = f"{bathymetry.model}; cells of {cell_m * times:g} m for depths to {to_m:g} m"
        cells = _any(asked, times)
        least = np.where(cells, _least(depth, times), np.nan)
        made.append(Tier(_only(replace(coarse, model=model), cells), from_m, to_m, least))
    return made


def coarsened(bathymetry: BathymetricMap, times: int) -> BathymetricMap:
    """Return the map of cells so many times as large, from the same corner; without soundings they have no depth.

    Where the map has the precision of its cells, this is the very map that its soundings make in the larger ones, but
    for the slopes on which places are uncertain: they remain those of the smaller cells, and where few soundings lie in
    a larger one its own slope counts, too. What a cell's soundings share
    is not averaged out; where the map does not tell it apart, as one that an earlier version stored, that is all but
    the precision. Without precision the cells' errors belong together: their depths and deviations are averaged.
    """
    grid, precision = bathymetry.grid, bathymetry.precision
    fine = _sounded(bathymetry)
    found = _any(fine, times)
    count = _total(np.where(fine, bathymetry.count, 0), times).astype(np.int64)
    weight = np.where(fine, 1.0 if precision is None else precision, 0.0)
    total = np.where(found, _total(weight, times), np.nan)

    def mean(layer: FloatArray) -> FloatArray:
        """Return the means weighted by the soundings' precision, where it is known."""
        return np.asarray(_total(np.where(fine, weight * layer, 0.0), times) / total)

    depth, horizontal = mean(bathymetry.depth_m), bathymetry.horizontal_sd_m
    shared: FloatArray | None = None
    if precision is None:
        deviation = mean(bathymetry.sd_m)
    else:
        # The map's deviation is that of the mean, the spread that so many soundings do not average out, and what
        # they share.
        with np.errstate(divide="ignore"):
            beside = np.maximum(bathymetry.sd_m**2 - 1.0 / precision, 0.0)
        alike = beside if bathymetry.shared_sd_m is None else bathymetry.shared_sd_m**2
        spread = np.maximum(beside - alike, 0.0) * bathymetry.count
        apart = bathymetry.depth_m - _finer(depth, times, fine)
        shared = np.sqrt(mean(alike))
        alone, single = np.sqrt(1.0 / total), np.sqrt(mean(spread + apart**2))
        if times > 1:
            cell_m = grid.cell_m * times
            single = scatter_m(single, gradient(depth, cell_m, alone), cell_m)
        deviation = np.sqrt(alone**2 + single**2 / np.maximum(count, 1) + shared**2)
    area = np.isfinite(bathymetry.roughness)
    with np.errstate(invalid="ignore"):
        roughness = _total(np.nan_to_num(bathymetry.roughness), times) / _total(area, times)
    cell_m = grid.cell_m * times
    return BathymetricMap(
        grid=Grid(grid.west_m, grid.south_m, cell_m, *found.shape),
        depth_m=depth,
        sd_m=deviation,
        count=count,
        sounded=found,
        roughness=roughness,
        correlation_length_m=max(bathymetry.correlation_length_m, 5.0 * cell_m),
        model=bathymetry.model,
        precision=None if precision is None else np.where(found, total, 0.0),
        horizontal_sd_m=None if horizontal is None else np.sqrt(_mean_of_known(horizontal**2, weight, times)),
        shared_sd_m=shared,
    )


def _mean_of_known(layer: FloatArray, weight: FloatArray, times: int) -> FloatArray:
    """Return weighted means over squares of so many cells a side, of those that are known; NaN where none is."""
    known = np.isfinite(layer)
    total = _total(np.where(known, weight, 0.0), times)
    sums = _total(np.where(known, weight * layer, 0.0), times)
    return np.asarray(np.divide(sums, total, out=np.full(total.shape, np.nan), where=total > 0.0))


def _sounded(bathymetry: BathymetricMap) -> BoolArray:
    return np.asarray(bathymetry.sounded & np.isfinite(bathymetry.depth_m))


def _only(bathymetry: BathymetricMap, cells: BoolArray) -> BathymetricMap:
    """Return a map with depths in some of its cells alone."""

    def inside(layer: FloatArray | None) -> FloatArray | None:
        return None if layer is None else np.where(cells, layer, np.nan)

    return replace(
        bathymetry,
        depth_m=np.where(cells, bathymetry.depth_m, np.nan),
        sd_m=np.where(cells, bathymetry.sd_m, np.nan),
        count=np.where(cells, bathymetry.count, 0),
        sounded=bathymetry.sounded & cells,
        roughness=np.where(cells, bathymetry.roughness, np.nan),
        precision=None if bathymetry.precision is None else np.where(cells, bathymetry.precision, 0.0),
        horizontal_sd_m=inside(bathymetry.horizontal_sd_m),
        shared_sd_m=inside(bathymetry.shared_sd_m),
    )


def _total(layer: FloatArray | IntArray | BoolArray, times: int) -> FloatArray:
    """Return the sums over squares of so many cells a side; the last ones may lie partly beyond the map."""
    rows, cols = layer.shape
    padded = np.pad(layer.astype(float), ((0, -rows % times), (0, -cols % times)))
    return np.asarray(padded.reshape(-1, times, padded.shape[1] // times, times).sum(axis=(1, 3)))


def _least(layer: FloatArray, times: int) -> FloatArray:
    """Return the least value in each square of so many cells a side; NaN where none is known."""
    rows, cols = layer.shape
    padded = np.pad(layer, ((0, -rows % times), (0, -cols % times)), constant_values=np.nan)
    return np.asarray(np.fmin.reduce(padded.reshape(-1, times, padded.shape[1] // times, times), axis=(1, 3)))


def _finer(layer: FloatArray, times: int, like: BoolArray) -> FloatArray:
    """Return each value for all the cells that its cell was made of."""
    rows, cols = like.shape
    return np.asarray(np.repeat(np.repeat(layer, times, 0), times, 1)[:rows, :cols])


def _any(cells: BoolArray, times: int) -> BoolArray:
    return _total(cells, times) > 0.0
