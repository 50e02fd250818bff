"""One colour scale for pictures and overlays."""

from typing import TYPE_CHECKING, Final

import numpy as np

from app.arrays import FloatArray
from app.mapping.layers import Fit, Palette
from app.mapping.types import BathymetricMap

if TYPE_CHECKING:
    from matplotlib.colors import Colormap


def palette(fit: Fit) -> "Colormap":
    """Return the colours of a layer by how its range follows its values."""
    # They bring all of Matplotlib: a quarter of the service's start, before anyone has asked for a picture.
    import cmocean

    colours: Colormap = {Fit.DATA: cmocean.cm.deep, Fit.ABOUT_ZERO: cmocean.cm.balance}.get(fit, cmocean.cm.amp)
    return colours


VIOLET = "fbf7fd f1e6f7 e3cef0 d1b1e6 bc90da a56fcb 8c50b8 72369f 582183 3f1064"
CLASSES = "b03a2e f4c450 2e7d6e"
"""The page's own palettes, low values first."""


def page_colours(name: Palette) -> "Colormap":
    """Return the colours that the page shows a layer in. Raises KeyError for layers that are drawn otherwise."""
    import cmocean
    from matplotlib.colors import LinearSegmentedColormap, ListedColormap

    violet, classes = ([f"#{colour}" for colour in own.split()] for own in (VIOLET, CLASSES))
    found: dict[Palette, Colormap] = {
        Palette.VIOLET: LinearSegmentedColormap.from_list("violet", violet),
        Palette.CLASSES: ListedColormap(classes),
        Palette.MATTER: cmocean.cm.matter,
        Palette.BALANCE: cmocean.cm.balance,
        Palette.DEEP: cmocean.cm.deep,
    }
    return found[name]


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


CLASS_COLOURS: Final = ((176, 58, 46), (244, 196, 80), (46, 125, 110))
"""Of layers by classes: missed, too few, enough; as the page has them."""
