"""JSON as it is listed in a report."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from imc_bridge.printable import printable

LISTED_WIDTH = 100
"""Characters of a line."""


def listing(value: Any, indent: str = "") -> str:
    """Return JSON with a line for each field; lists of numbers flow."""
    deeper = indent + "  "
    if isinstance(value, Mapping) and value:
        fields = (f"{deeper}{_flat(name)}: {listing(inner, deeper)}" for name, inner in value.items())
        return "{\n" + ",\n".join(fields) + f"\n{indent}}}"
    if isinstance(value, Sequence) and not isinstance(value, str) and value:
        if any(isinstance(entry, Mapping) for entry in value):
            return "[\n" + ",\n".join(deeper + listing(entry, deeper) for entry in value) + f"\n{indent}]"
        flat = _flat(value)
        return flat if '"' in flat else _wrapped(flat, deeper)
    return _flat(value)


def _flat(value: Any) -> str:
    """Return JSON in one line; letters of other languages stay unless some character is not fit to be shown."""
    text = json.dumps(value, ensure_ascii=False)
    return text if printable(text) == text else json.dumps(value)


def _wrapped(text: str, indent: str) -> str:
    """Return flat JSON without texts in lines that are not too long."""
    words, lines = text.split(", "), [""]
    for number, word in enumerate(words):
        piece = word + (", " if number < len(words) - 1 else "")
        if lines[-1] and len(indent) + len(lines[-1]) + len(piece) > LISTED_WIDTH:
            lines.append("")
        lines[-1] += piece
    return f"\n{indent}".join(line.rstrip() if index < len(lines) - 1 else line for index, line in enumerate(lines))
