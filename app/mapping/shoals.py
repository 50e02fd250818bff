"""How likely something shallower than a depth lies in a cell: rocks between lines, which no sounding has met."""

import numpy as np
from scipy.stats import t as student_t

from app.arrays import FloatArray
from app.mapping.types import BathymetricMap

DEGREES_OF_FREEDOM = 3.0
"""Of Student's t: errors of maps have much heavier tails than normal ones. Measured by ``benchmarks.mapping.shoals``."""


def shoal_chance(bathymetry: BathymetricMap, shoal_depth_m: float, common_sd_m: float = 0.0) -> FloatArray:
    """Return the chance that the bottom is shallower than a depth somewhere in each cell, (rows, cols), 0 to 1.

    The shallowest place of a cell is taken to lie as far above the map's depth as the cell is inclined: half a cell's
    rise to the east plus half of that to the north. How far it may be off is Student's t, scaled by the cell's
    deviation, by how far its neighbours lie off a plane through it, which is what it may hide within, and by what all
    soundings share.

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
    depth, sd = bathymetry.depth_m, bathymetry.sd_m
    supported = np.isfinite(depth) & np.isfinite(bathymetry.claim_sd_m)
    rise, bend = _rise_and_bend(depth)
    scale = np.sqrt(sd**2 + bend**2 + common_sd_m**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = (depth - rise - shoal_depth_m) / scale
    return np.where(supported, student_t.sf(beyond, DEGREES_OF_FREEDOM), np.nan)


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
