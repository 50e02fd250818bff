"""A document as a PDF: pages with numbers, embedded fonts, and text that can be searched and copied."""

import io
import re
import subprocess
import sys
from base64 import b64encode
from importlib.resources import files
from pathlib import Path
from typing import Any

import orjson

from app.missions.report.document import SVG, Document, Figure, as_json

PAGE_WIDTH_CM, MOST_HEIGHT_CM = 17.0, 15.5
"""Of the page's text, and of a figure in it."""

PROGRAM = str(Path(__file__).with_name("typesetting.py"))
LONGEST_S = 120.0
"""Nothing takes so long."""


def pdf(document: Document) -> bytes:
    """Return the PDF. It is the same for the same document."""
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
    return _typeset(sources, document.made_s)


def _typeset(sources: dict[str, bytes], timestamp: int) -> bytes:
    """Return the PDF that a process of its own makes. Raises RuntimeError with what it said where it fails."""
    import matplotlib as mpl

    # The fonts that come with Matplotlib; for other writings those of the machine.
    fonts = str(Path(mpl.get_data_path(), "fonts", "ttf"))
    texts = {name: content.decode() for name, content in sources.items()}
    asked = orjson.dumps({"sources": texts, "fonts": fonts, "timestamp": timestamp})
    run = subprocess.run(  # noqa: S603 - this program's own file
        [sys.executable, "-P", PROGRAM], input=asked, capture_output=True, timeout=LONGEST_S, check=False
    )
    if run.returncode:
        raise RuntimeError(f"the report cannot be typeset: {run.stderr.decode(errors='replace')[-2000:]}")
    return run.stdout


def _drawing(figure: Figure) -> bytes:
    """Return a figure as SVG: files in memory have to be text."""
    if figure.media_type == SVG:
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
