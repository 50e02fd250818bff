"""Legends of layers as small pictures."""

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.mapping.layers import Fit
from app.mapping.products.pictures.colours import CLASS_COLOURS, palette

RANGE_PX, CLASSES_PX = (130, 190), (240, 70)
"""Width and height of legends with a range of values, and of those with two classes."""

_MARGIN, _BAR, _TITLE, _LINE, _TEXT_PX = 8, 18, 24, 22, 12
_TICKS = 5
_INK = (30, 30, 30, 255)


def range_legend(title: str, unit: str, range_: tuple[float, float], fit: Fit) -> bytes:
    """Return a bar of the colours between the values of the first (above) and of the last one, as PNG."""
    picture, draw, font = _sheet(f"{title} ({unit})", RANGE_PX)
    height = RANGE_PX[1] - _TITLE - 2 * _MARGIN - _TEXT_PX
    colours = palette(fit)(np.linspace(0.0, 1.0, height), bytes=True)[:, None, :]
    bar = Image.fromarray(np.ascontiguousarray(np.repeat(colours, _BAR, axis=1)))
    top = _TITLE + _MARGIN
    picture.paste(bar, (_MARGIN, top))
    for share in np.linspace(0.0, 1.0, _TICKS).tolist():
        value = range_[0] + share * (range_[1] - range_[0])
        y = top + share * (height - 1)
        draw.line([(_MARGIN + _BAR, y), (_MARGIN + _BAR + 4, y)], fill=_INK)
        draw.text((_MARGIN + _BAR + 8, y), f"{value:.4g}", fill=_INK, font=font, anchor="lm")
    return _png(picture)


def class_legend(title: str, words: Sequence[str]) -> bytes:
    """Return the colours of classes 1, 2 and so on with their words, as PNG."""
    picture, draw, font = _sheet(title, CLASSES_PX)
    for number, (word, colour) in enumerate(zip(words, CLASS_COLOURS[1:], strict=False)):
        top = _TITLE + number * _LINE
        draw.rectangle([(_MARGIN, top), (_MARGIN + _BAR, top + 14)], fill=(*colour, 255))
        draw.text((_MARGIN + _BAR + 8, top + 7), word, fill=_INK, font=font, anchor="lm")
    return _png(picture)


def _sheet(title: str, size: tuple[int, int]) -> tuple[Image.Image, ImageDraw.ImageDraw, ImageFont.FreeTypeFont]:
    picture = Image.new("RGBA", size, (255, 255, 255, 255))
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(_TEXT_PX)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType: install its wheel")
    draw.text((_MARGIN, _TITLE // 2 + 1), title, fill=_INK, font=font, anchor="lm")
    return picture, draw, font


def _png(picture: Image.Image) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, "PNG")
    return stream.getvalue()
