"""A document as a PDF: pages with numbers, embedded fonts, and text that can be searched and copied."""

import io
import re
from base64 import b64encode
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson

from app.missions.report.document import Document, Figure, as_json

if TYPE_CHECKING:
    import typst

PAGE_WIDTH_CM, MOST_HEIGHT_CM = 17.0, 15.5
"""Of the page's text, and of a figure in it."""


def pdf(document: Document) -> bytes:
    """Return the PDF. It is the same for the same document."""
    import typst

    sources: dict[str, bytes] = {"main.typ": files(__package__).joinpath("report.typ").read_bytes()}
    sections = []
    for section in document.sections:
        blocks = []
        for block in section.blocks:
            plain = as_json(block)
            if isinstance(block, Figure):
                name = f"figure-{len(sources)}.svg"
                drawing = _drawing(block)
                sources[name] = drawing
                plain |= {"file": name} | _size(drawing, block.width)
            blocks.append(plain)
        sections.append({"title": section.title, "blocks": blocks})
    values: dict[str, Any] = {
        name: getattr(document, name) for name in ("language", "title", "subtitle", "author", "footer", "words")
    }
    sources["data.json"] = orjson.dumps(values | {"sections": sections})
    made = typst.compile(sources, format="pdf", font_paths=_fonts(), timestamp=document.made_s)  # type: ignore[call-overload]
    return bytes(made)


def _drawing(figure: Figure) -> bytes:
    """Return a figure as SVG: files in memory have to be text."""
    if figure.media_type == "image/svg+xml":
        return figure.content
    from PIL import Image

    with Image.open(io.BytesIO(figure.content)) as picture:
        size = f'width="{picture.width}" height="{picture.height}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" {size}>'
    link = f"data:{figure.media_type};base64,{b64encode(figure.content).decode()}"
    return f'{head}<image {size} xlink:href="{link}"/></svg>'.encode()


def _size(drawing: bytes, part: float) -> dict[str, float]:
    """Return the size at which a drawing keeps its shape and is neither wider nor higher than a page allows."""
    width, height = re.findall(rb' (?:width|height)="([\d.]+)"', drawing[:400])[:2]
    shape = float(height) / float(width)
    width_cm = min(part * PAGE_WIDTH_CM, MOST_HEIGHT_CM / shape)
    return {"width": width_cm / PAGE_WIDTH_CM, "height": width_cm * shape}


@cache
def _fonts() -> "typst.Fonts":
    """Return the fonts that come with Matplotlib, for other writings those of the machine."""
    import matplotlib as mpl
    import typst

    return typst.Fonts(include_system_fonts=True, font_paths=[str(Path(mpl.get_data_path(), "fonts", "ttf"))])
