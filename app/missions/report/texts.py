"""The report's words, all of them in the catalogue ``texts.toml``, and how numbers are written beside them."""

import string
import tomllib
from datetime import UTC, datetime
from enum import StrEnum
from functools import cache
from importlib.resources import files

Catalogue = dict[str, dict[str, str]]
"""By a text's name its wording in each language."""

NONE = "–"
"""Stands where there is no value."""


class Language(StrEnum):
    """A language that reports are written in."""

    EN = "en"
    PT = "pt"


DECIMAL_POINTS = {Language.EN: ".", Language.PT: ","}
GROUPED_FROM = 10_000
NARROW_SPACE = "\u202f"
DEGREES = "°"
"""The unit that no space is before."""


@cache
def catalogue() -> Catalogue:
    """Return every text by its name."""
    return tomllib.loads(files(__package__).joinpath("texts.toml").read_text(encoding="utf-8"))


def placeholders(text: str) -> set[str]:
    """Return what is filled into a text."""
    return {field for _, field, _, _ in string.Formatter().parse(text) if field is not None}


class Texts:
    """The words and numbers of one language."""

    def __init__(self, language: Language) -> None:
        self.language = language
        self._catalogue = catalogue()

    def __call__(self, name: str, **values: object) -> str:
        """Return a text with values filled in. Raises KeyError for a name that the catalogue does not have."""
        return self._catalogue[name][self.language].format(**values)

    def of(self, group: str, name: str) -> str:
        """Return the word for a value of an enumeration; the value itself where the catalogue has none."""
        found = self._catalogue.get(f"{group}_{name}")
        return name.replace("_", " ") if found is None else found[self.language]

    def number(self, value: float | None, decimals: int = 0, unit: str = "", *, signed: bool = False) -> str:
        """Return a number with so many decimals as the language writes it, and its unit."""
        if value is None:
            return NONE
        rounded = round(value, decimals) + 0.0  # no minus before a zero
        sign = "+" if signed and rounded > 0 else ""
        grouping = "," if abs(rounded) >= GROUPED_FROM else ""
        text = f"{rounded:{sign}{grouping}.{decimals}f}".replace("-", "−").replace(",", NARROW_SPACE)
        text = text.replace(".", DECIMAL_POINTS[self.language])
        return f"{text}\u00a0{unit}" if unit and unit != DEGREES else f"{text}{unit}"

    def moment(self, value: str | float | None) -> str:
        """Return a time, given as ISO 8601 or in Unix seconds, to the second, UTC."""
        if value is None:
            return NONE
        try:
            at = datetime.fromisoformat(value) if isinstance(value, str) else datetime.fromtimestamp(value, UTC)
        except (ValueError, OverflowError, OSError):
            return str(value)
        return f"{at.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"
