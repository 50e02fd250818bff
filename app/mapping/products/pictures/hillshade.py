"""Light and shadow of a sea floor, for pictures."""

import numpy as np

from app.arrays import FloatArray
from app.mapping.layers import gradient

AZIMUTH_DEG, HEIGHT_DEG = 315.0, 45.0
"""Light comes from the north-west, half way up, as on charts."""

MOST_EXAGGERATED = 10
STEEP = 0.5
"""Of the steeper slopes after heights were exaggerated."""


def exaggeration(depth_m: FloatArray, cell_m: float) -> int:
    """Return by how much heights are exaggerated so that a floor shows its form: 1 on steep ones, more on flat ones."""
    slope = np.hypot(*gradient(depth_m, cell_m))
    known = slope[np.isfinite(slope)]
    steep = float(np.percentile(known, 90)) if known.size else 0.0
    return int(np.clip(round(STEEP / steep), 1, MOST_EXAGGERATED)) if steep > 0.0 else 1


def hillshade(depth_m: FloatArray, cell_m: float, exaggerated: float = 1.0) -> FloatArray:
    """Return how much light falls on each cell, (rows, cols), row 0 south: 1 on level ground, 0 in shadow.

    Cells whose slope is not known are lit like level ground; what faces the light is brighter than 1.
    """
    azimuth, height = np.radians([AZIMUTH_DEG, HEIGHT_DEG])
    east, north = (exaggerated * part for part in gradient(depth_m, cell_m))
    # The normal of a floor whose depth grows to the east leans to the east.
    lit = east * np.sin(azimuth) * np.cos(height) + north * np.cos(azimuth) * np.cos(height) + np.sin(height)
    light = lit / np.sqrt(1.0 + east**2 + north**2) / np.sin(height)
    return np.where(np.isfinite(light), np.maximum(light, 0.0), 1.0)
