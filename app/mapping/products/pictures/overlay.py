"""Map as a bare picture to lay over a web map."""

import io

import numpy as np
from PIL import Image

from app.arrays import BoolArray, FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import Fit
from app.mapping.products.pictures.colours import palette, scaled
from app.mapping.types import Grid

INTERPOLATED_ALPHA = 0.72
"""Opacity of cells that were not sounded, so that sounded tracks show."""


def overlay_png(values: FloatArray, sounded: BoolArray, range_m: tuple[float, float], fit: Fit = Fit.DATA) -> bytes:
    """Return an RGBA PNG, one pixel per cell, north up, no axes; cells without a value are transparent.

    Parameters
    ----------
    values, sounded
        Of a layer and which cells were sounded, shape (rows, cols), row 0 south.
    range_m
        Values of the first and the last colour. Fixed by the caller: a range that follows the data would make
        successive pictures of a mission incomparable.
    fit
        How the layer's range follows its values, which chooses the palette.
    """
    alpha = np.where(sounded, 1.0, INTERPOLATED_ALPHA)
    fractions = scaled(values, range_m)
    pixels = palette(fit)(np.nan_to_num(fractions), bytes=True)
    pixels[..., 3] = np.where(np.isfinite(fractions), np.round(255 * alpha), 0)
    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(stream, "PNG", compress_level=6)
    return stream.getvalue()


def overlay_corners(grid: Grid, frame: LocalFrame) -> list[tuple[float, float]]:
    """Where the overlay's corners lie: (lon, lat) of north-west, north-east, south-east and south-west.

    The order is that of MapLibre's image source.
    """
    east = grid.west_m + grid.cols * grid.cell_m
    north = grid.south_m + grid.rows * grid.cell_m
    lat, lon = frame.to_geographic(
        np.array([grid.west_m, east, east, grid.west_m]), np.array([north, north, grid.south_m, grid.south_m])
    )
    return [(float(x), float(y)) for x, y in zip(lon, lat, strict=True)]
