"""What a document is made of, whatever file it becomes."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

PNG, SVG = "image/png", "image/svg+xml"


@dataclass(frozen=True)
class Shown:
    """A text of the document.

    Attributes
    ----------
    source
        Where REST has the value that it shows: an answer's name, then fields and numbers of entries, with points
        between; empty for words.
    value
        That value as JSON.
    mono
        Whether every character is to be told from every other, as in checksums.
    """

    text: str
    source: str = ""
    value: str = ""
    mono: bool = False


Text = str | Shown


@dataclass(frozen=True)
class Paragraph:
    """Some words."""

    text: Text
    note: bool = False
    """Whether it says what must not be overlooked."""
    kind: str = "paragraph"


@dataclass(frozen=True)
class Statements:
    """A list of statements."""

    items: Sequence[Text]
    kind: str = "points"


@dataclass(frozen=True)
class Facts:
    """What something is, name by name."""

    items: Sequence[tuple[str, Text]]
    kind: str = "facts"


@dataclass(frozen=True)
class Table:
    """Rows of cells below their columns' names.

    Attributes
    ----------
    numbers
        Columns whose cells stand to the right.
    widths
        Of the columns, in parts of the rest, 0: as wide as it must be; none: as they come.
    left_off
        What is said of rows that there is no place for.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Text]]
    numbers: Sequence[int] = ()
    widths: Sequence[float] = ()
    caption: str = ""
    left_off: str = ""
    kind: str = "table"


@dataclass(frozen=True)
class Figure:
    """A picture: a PNG or an SVG. ``width`` is its part of the page's."""

    content: bytes
    media_type: str
    caption: str
    width: float = 1.0
    kind: str = "figure"


@dataclass(frozen=True)
class Listing:
    """Text that keeps its lines."""

    text: str
    kind: str = "listing"


Block = Paragraph | Statements | Facts | Table | Figure | Listing


@dataclass(frozen=True)
class Section:
    """Blocks under a heading."""

    name: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Document:
    """A whole document.

    Attributes
    ----------
    language
        BCP 47.
    words
        Those of the files themselves: ``page``, ``contents``, ``figure``, ``table``.
    made_s
        When it was made, Unix seconds.
    """

    language: str
    title: str
    subtitle: str
    author: str
    footer: str
    made_s: int
    words: dict[str, str]
    sections: Sequence[Section]


def as_json(block: Block) -> dict[str, Any]:
    """Return a block as plain values; the content of a figure is left out."""
    found = asdict(block)
    found.pop("content", None)
    return found
