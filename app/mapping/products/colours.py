"""One colour scale for pictures and overlays."""

import cmocean
import numpy as np
from matplotlib.colors import Colormap

from app.mapping.types import BathymetricMap, FloatArray

DEPTH_COLOURS: Colormap = cmocean.cm.deep
UNCERTAINTY_COLOURS: Colormap = cmocean.cm.amp
DIFFERENCE_COLOURS: Colormap = cmocean.cm.balance


def palette(layer: str) -> Colormap:
    """Return the colours of a layer: depths, differences of either sign, or amounts of something."""
    return {"depth": DEPTH_COLOURS, "difference": DIFFERENCE_COLOURS}.get(layer, UNCERTAINTY_COLOURS)


def depth_range(bathymetry: BathymetricMap) -> tuple[float, float]:
    """Whole metres that hold 98 % of the depths: a range that does not flicker while a map grows.

    Raises
    ------
    ValueError
        When no cell has a depth.
    """
    known = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
    if known.size == 0:
        raise ValueError("the map has no depth in any cell; give the range to be shown")
    low, high = np.percentile(known, [1.0, 99.0])
    bottom = float(np.floor(low))
    return bottom, max(float(np.ceil(high)), bottom + 1.0)


def scaled(values: FloatArray, range_m: tuple[float, float]) -> FloatArray:
    """Values as fractions of the range, clipped to [0, 1]; NaN stays.

    Raises
    ------
    ValueError
        When the range is empty or not finite.
    """
    low, high = range_m
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ValueError(f"range_m is ({low}, {high}); the first number must be the smaller one, both finite")
    return np.clip((values - low) / (high - low), 0.0, 1.0)
