"""A map of this mission's soundings together with what was known before."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray
from app.mapping.cell_index import count_per_cell
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.types import BathymetricMap, Grid, Soundings


def prior_map(prior: Soundings, grid: Grid, mask: BoolArray) -> BathymetricMap:
    """Return the map of imported soundings alone; none of its cells counts as sounded.

    No cell is better known than the nearest sounding was: errors of an older map or survey belong together, so many
    of its depths do not average them away.
    """
    model = GaussianProcessMap(reject_outliers=False).fit(prior)
    found = model.predict(grid, mask)
    _, nearest = cKDTree(np.column_stack([prior.east_m, prior.north_m])).query(grid.centres_m)
    stated = prior.sd_m[nearest].reshape(grid.rows, grid.cols)
    none = np.zeros((grid.rows, grid.cols), np.int64)

    def at_least_stated(sd_m: FloatArray) -> FloatArray:
        return np.where(np.isnan(sd_m), np.nan, np.maximum(sd_m, stated))

    return replace(
        found,
        sd_m=at_least_stated(found.sd_m),
        process_sd_m=at_least_stated(found.planning_sd_m),
        bound_sd_m=at_least_stated(found.claim_sd_m),
        count=none,
        sounded=none > 0,
        prior=mask & (count_per_cell(grid, prior) > 0),
    )


def fuse(measured: BathymetricMap, prior: BathymetricMap) -> BathymetricMap:
    """Return the mean of two maps weighted by their precision, with the standard deviation that follows.

    The measured map counts for less the farther a cell is from its soundings: a model learned from few of them
    knows its own amplitude badly, and must not overrule what was known there. Its deviation grows by
    exp(d^2 / (2 l^2)) at distance d, l being its correlation length.
    """
    distrust = np.exp(np.minimum(0.5 * (_distance_m(measured) / measured.correlation_length_m) ** 2, 50.0))
    precision, known = (measured.planning_sd_m * distrust) ** -2.0, prior.planning_sd_m**-2.0
    total = precision + known
    return replace(
        measured,
        depth_m=(precision * measured.depth_m + known * prior.depth_m) / total,
        sd_m=_together(measured.sd_m * distrust, prior.sd_m),
        process_sd_m=total**-0.5,
        bound_sd_m=_together(measured.claim_sd_m * distrust, prior.claim_sd_m),
        prior=prior.prior,
        precision=None,
        shared_sd_m=None,
        model=f"{measured.model}; with imported soundings ({prior.model})",
    )


def _together(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the deviation of the mean of two depths weighted by their precision; they may be infinite."""
    with np.errstate(divide="ignore"):
        return np.asarray((one**-2.0 + other**-2.0) ** -0.5)


def _distance_m(bathymetry: BathymetricMap) -> FloatArray:
    """Return how far each cell is from the nearest sounded one; 0 everywhere when the soundings lie outside."""
    if not bathymetry.sounded.any():
        return np.zeros(bathymetry.depth_m.shape)
    cells = distance_transform_edt(~bathymetry.sounded)
    return np.asarray(cells, np.float64) * bathymetry.grid.cell_m
