"""Layers of a map as pictures in tiles, for web maps and GIS."""

import io
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.arrays import BoolArray, FloatArray
from app.mapping.coordinates.map_windows import WindowCells
from app.mapping.layers import Fit
from app.mapping.products.pictures.colours import CLASS_COLOURS, palette, scaled
from app.mapping.products.pictures.hillshade import hillshade
from app.mapping.products.pictures.overlay import INTERPOLATED_ALPHA
from app.mapping.types import Grid

Pixels = NDArray[np.uint8]
"""Red, green, blue and opacity, (rows, cols, 4)."""

Words = NDArray[np.uint32]
"""The four bytes of each pixel as one number."""

EXAGGERATION = 3.0
"""Slopes of the sea floor are shown so many times as steep."""

DARKEST, LIGHTEST = 0.45, 1.2
"""Factors of the colour on slopes that are turned away from the light, and towards it."""


def shade(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return how light each cell is on a tile, 1 for level ground and where no slope is known, (rows, cols)."""
    return np.asarray(np.clip(hillshade(depth_m, cell_m, EXAGGERATION), DARKEST, LIGHTEST))


def paint(
    values: FloatArray,
    range_: tuple[float, float],
    fit: Fit,
    *,
    sounded: BoolArray | None = None,
    light: FloatArray | None = None,
) -> Pixels:
    """Return a layer in colours, (rows, cols, 4), row 0 south as its values; cells without a value are transparent.

    Parameters
    ----------
    values : (rows, cols)
    range_
        Values of the first and the last colour.
    sounded : (rows, cols)
        Other cells are a little transparent; None: all are opaque.
    light : (rows, cols)
        What :func:`shade` returned; None: without shading.
    """
    fractions = scaled(values, range_)
    colours = _table(fit)[np.round(255.0 * np.nan_to_num(fractions)).astype(np.uint8)]
    if light is not None:
        colours = np.minimum(colours * light[..., None], 255.0).astype(np.uint8)
    opacity = np.where(sounded, 1.0, INTERPOLATED_ALPHA) if sounded is not None else 1.0
    alpha = np.where(np.isfinite(values), np.round(255.0 * opacity), 0.0).astype(np.uint8)
    return np.dstack([colours, alpha])


def paint_classes(classes: FloatArray) -> Pixels:
    """Return classes 1, 2 and so on in colours, (rows, cols, 4); class 0 and cells without one are transparent."""
    table = np.array([(0, 0, 0, 0), *((*colour, 255) for colour in CLASS_COLOURS[1:])], dtype=np.uint8)
    return table[np.nan_to_num(classes).astype(np.uint8)]


@lru_cache(maxsize=8)
def _table(fit: Fit) -> NDArray[np.uint8]:
    """Return 256 colours, (256, 3)."""
    colours: NDArray[np.uint8] = palette(fit)(np.linspace(0.0, 1.0, 256), bytes=True)[:, :3]
    return colours


def coarser(pixels: Pixels) -> Pixels:
    """Return a picture of half as many cells along each side: what two by two show, as far as they show something."""
    rows, cols = pixels.shape[:2]
    padded = np.pad(pixels, ((0, rows % 2), (0, cols % 2), (0, 0))).astype(np.float32)
    alpha = padded[..., 3:]
    weighted = np.concatenate([padded[..., :3] * alpha, alpha], axis=-1)
    total = weighted[::2, ::2] + weighted[1::2, ::2] + weighted[::2, 1::2] + weighted[1::2, 1::2]
    shown = (alpha > 0)[..., 0]
    number = shown[::2, ::2].astype(np.float32) + shown[1::2, ::2] + shown[::2, 1::2] + shown[1::2, 1::2]
    colours = total[..., :3] / np.maximum(total[..., 3:], 1.0)
    # As opaque as the cells that show something: thin lines stay to be seen.
    opacity = total[..., 3:] / np.maximum(number, 1.0)[..., None]
    return np.round(np.concatenate([colours, opacity], axis=-1)).astype(np.uint8)


def coarser_grid(grid: Grid) -> Grid:
    """Return the grid that :func:`coarser` makes of one; it may reach one cell further to the north and east."""
    return Grid(grid.west_m, grid.south_m, 2.0 * grid.cell_m, -(-grid.rows // 2), -(-grid.cols // 2))


def words_of(pixels: Pixels) -> Words:
    """Return a picture's pixels one after another, and one that is transparent at the end."""
    return np.concatenate([pixels.reshape(-1, 4), np.zeros((1, 4), dtype=np.uint8)]).view(np.uint32)[:, 0]


def window_words(words: Words, cells: WindowCells, onto: Words) -> None:
    """Put what :func:`words_of` returned into the pixels of a window, (height, width), northern row first."""
    rows, cols = cells.source.shape
    # -1, for pixels that show no cell, takes the last.
    onto[cells.top : cells.top + rows, cells.left : cells.left + cols] = words[cells.source]


def window_png(picture: Words) -> bytes:
    """Return the pixels of a window, (height, width), as PNG."""
    stream = io.BytesIO()
    pixels = np.ascontiguousarray(picture).view(np.uint8).reshape(*picture.shape, 4)
    Image.fromarray(pixels).save(stream, "PNG", compress_level=1)
    return stream.getvalue()


@lru_cache(maxsize=4)
def empty_png(width_px: int, height_px: int) -> bytes:
    """Return a picture that shows nothing."""
    return window_png(np.zeros((height_px, width_px), dtype=np.uint32))


def stacked(contents: Sequence[bytes], size: tuple[int, int], background: tuple[int, int, int] | None) -> bytes:
    """Return PNGs over each other as one of the same width and height, the lowest first.

    ``background``: red, green and blue of a ground without any opening; None: transparent where all are.
    """
    if not contents and background is None:
        return empty_png(*size)
    sheet = Image.new("RGBA", size, (*background, 255) if background is not None else (0, 0, 0, 0))
    for content in contents:
        sheet.alpha_composite(Image.open(io.BytesIO(content)).convert("RGBA"))
    stream = io.BytesIO()
    (sheet if background is None else sheet.convert("RGB")).save(stream, "PNG", compress_level=1)
    return stream.getvalue()
