"""A document as a web page in one file, without scripts and without anything from elsewhere."""

from base64 import b64encode
from functools import cache
from typing import TYPE_CHECKING

from app.missions.report.document import Document

if TYPE_CHECKING:
    from jinja2 import Template


def html(document: Document) -> bytes:
    """Return the page, UTF-8. All texts are escaped; values of REST stand in ``<data data-of="…">``."""
    return _template().render(document=document).encode()


@cache
def _template() -> "Template":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(__package__, ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["base64"] = lambda content: b64encode(content).decode()
    return environment.get_template("report.html.j2")
