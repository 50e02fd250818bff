"""How likely something shallower than a depth lies in a cell: rocks between lines, which no sounding has met."""

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.special import stdtr

from app.arrays import BoolArray, FloatArray
from app.mapping.swath.density import LEAST_SOUNDINGS
from app.mapping.types import BathymetricMap

DEGREES_OF_FREEDOM = 3.0
"""Of Student's t: errors of maps have much heavier tails than normal ones; see ``benchmarks.mapping.shoals``."""


AROUND_CELLS = 9
"""A rock is what rises above the mean of so many by so many cells."""

MISSED_FACTOR = 2.0
"""So many times as often as a sounded cell shows a rock one lies somewhere in a cell: a line meets it rarely on top."""

MOST_HIDDEN = 0.1
"""What more cells than that share is no rock but the relief, which the deviation covers."""

TAIL_EXPONENT = 3.0
"""Rocks higher than all that were sounded become rarer with this power of their height, like the tail of t."""


def shoal_chance(bathymetry: BathymetricMap, shoal_depth_m: float, common_sd_m: float = 0.0) -> FloatArray:
    """Return the chance that the bottom is shallower than a depth somewhere in each cell, (rows, cols), 0 to 1.

    The shallowest place of a cell is taken to lie as far above the map's depth as the cell is inclined: half a cell's
    rise to the east plus half of that to the north. How far it may be off is Student's t, scaled by the cell's
    deviation, by how far its neighbours lie off a plane through it, which is what it may hide within, and by what all
    soundings share. It is at least the chance of a rock that no line has met, in cells with fewer than
    :data:`LEAST_SOUNDINGS` soundings: cells between lines hide as many rocks as those that were sounded show.

    Parameters
    ----------
    shoal_depth_m
        Below the map's datum, positive down.
    common_sd_m
        Standard deviation of what all soundings share.

    Returns
    -------
    chance
        NaN outside the area, and where no sounding supports the cell: nothing is known there, which is not safe.
    """
    depth = bathymetry.depth_m
    supported = np.isfinite(depth) & np.isfinite(bathymetry.claim_sd_m)
    chance = stdtr(DEGREES_OF_FREEDOM, -deviations_above(bathymetry, shoal_depth_m, common_sd_m))
    hidden = supported & (bathymetry.count < LEAST_SOUNDINGS)
    height = (depth - _rise_and_bend(depth)[0] - shoal_depth_m)[hidden]
    chance[hidden] = np.maximum(chance[hidden], rock_chance(height, rises_m(bathymetry)))
    return np.where(supported, chance, np.nan)


def deviations_above(bathymetry: BathymetricMap, shoal_depth_m: float, common_sd_m: float = 0.0) -> FloatArray:
    """Return by how many of its deviations a cell's shallowest place would lie too deep to be shoal, (rows, cols)."""
    rise, bend = _rise_and_bend(bathymetry.depth_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(bathymetry.sd_m**2 + bend**2 + common_sd_m**2)
        return np.asarray((bathymetry.depth_m - rise - shoal_depth_m) / scale)


def rises_m(bathymetry: BathymetricMap) -> FloatArray:
    """Return how far each sounded cell rises above the mean of those around it, metres, ascending.

    Cells whose surroundings are not all known are left out: on a slope their mean lies to one side.
    """
    depth = bathymetry.depth_m
    known: BoolArray = np.isfinite(depth)
    if not known.any():
        return np.zeros(0)
    middle = float(depth[known].mean())
    share, total = (
        uniform_filter(values, AROUND_CELLS, mode="constant")
        for values in (known.astype(float), np.where(known, depth - middle, 0.0))
    )
    rise = middle + total - depth
    return np.asarray(np.sort(rise[bathymetry.sounded & known & (share > 1.0 - 1e-9)]))


def rock_chance(height_m: FloatArray, rises: FloatArray) -> FloatArray:
    """Return the chance that a cell hides a rock of at least a height, (n,), after the rises of sounded cells."""
    highest = float(rises[-1]) if len(rises) else 0.0
    if highest <= 0.0:
        return np.zeros_like(height_m)
    as_high = len(rises) - np.searchsorted(rises, height_m)
    rarer = np.minimum(highest / np.maximum(height_m, highest), 1.0) ** TAIL_EXPONENT
    return np.minimum(MISSED_FACTOR * (as_high + 1.0) * rarer / (len(rises) + 1.0), MOST_HIDDEN)


def _rise_and_bend(depth_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far a cell's corner rises above its middle, and by how much its neighbours lie off a plane, metres.

    Where a neighbour is unknown its opposite is taken to continue the plane; where both are, the axis adds nothing.
    """
    rise, bend = np.zeros_like(depth_m), np.zeros_like(depth_m)
    for axis in (0, 1):
        pad = [(1, 1) if a == axis else (0, 0) for a in (0, 1)]
        steps = np.diff(np.pad(depth_m, pad, constant_values=np.nan), axis=axis)
        behind, ahead = (np.take(steps, range(a, a + depth_m.shape[axis]), axis=axis) for a in (0, 1))
        behind, ahead = np.where(np.isnan(behind), ahead, behind), np.where(np.isnan(ahead), behind, ahead)
        rise += np.nan_to_num(np.abs(behind + ahead)) / 4.0
        bend += np.nan_to_num(ahead - behind) ** 2 / 4.0
    return rise, np.sqrt(bend)
