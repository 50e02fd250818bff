"""Beams that did not meet the bottom: fish, bubbles, double echoes."""

import numpy as np
from scipy.ndimage import median_filter

from app.arrays import BoolArray, FloatArray
from app.mapping.swath.pings import Pings

NEIGHBOURS = 9
"""Beams of a ping whose median tells where the bottom is."""

FAR_M, FAR_OF_DEPTH = 0.6, 0.12
"""A beam is a spike when it is farther from that than the larger of these: metres, and share of the height above it."""


def spikes(pings: Pings) -> BoolArray:
    """Return which beams (n, b) lie far above or below their neighbours in the same ping.

    Steps of the bottom are wider than a few beams and stay; a single beam, or a few, on a wreck's mast do not.
    """
    down = pings.range_m.astype(np.float64) * np.cos(pings.angle_rad)
    filled = _filled(down)
    middle = median_filter(filled, size=(1, NEIGHBOURS), mode="mirror")
    far = np.maximum(FAR_M, FAR_OF_DEPTH * middle)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.isfinite(down) & (np.abs(down - middle) > far))


def _filled(down: FloatArray) -> FloatArray:
    """Return the heights with that of the nearest beam before it, or after it, where nothing was detected."""
    known = np.isfinite(down)
    columns = np.arange(down.shape[1])
    before = np.maximum.accumulate(np.where(known, columns, -1), axis=1)
    last = down.shape[1] - 1
    after = last - np.maximum.accumulate(np.where(known[:, ::-1], columns, -1), axis=1)[:, ::-1]
    index = np.where(before >= 0, before, np.minimum(after, last))
    filled = np.take_along_axis(down, index, axis=1)
    return np.nan_to_num(filled, nan=0.0)
