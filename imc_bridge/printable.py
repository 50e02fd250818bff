"""Texts of strangers, made fit to be shown: nothing in them moves a cursor, begins a line or turns the writing."""

from __future__ import annotations

import re

_HARMFUL = re.compile(
    "["
    "\x00-\x1f\x7f-\x9f"  # C0, DEL, C1: terminals obey them
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # show a text in another order than it has
    "\u2028\u2029"  # begin a line
    "\ufeff\ufff9-\ufffb\U000e0000-\U000e007f"  # are not seen at all
    "\ud800-\udfff\ufffe\uffff"  # are no characters: neither UTF-8 nor XML has them
    "]"
)
_NAMED = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}


def printable(text: str, *, keep: str = "", most: int | None = None) -> str:
    r"""Return a text with every control character escaped, as ``\x1b`` or ``\u202e``.

    That are C0, C1 and DEL, marks of the writing's direction, separators of lines, invisible marks, and what is no
    character. All else stays, letters of every language included.

    Parameters
    ----------
    text
    keep
        Characters that are let through all the same, such as line breaks.
    most
        Longest result, in characters; None: any.
    """
    if most is not None:
        text = text[:most]
    shown = _HARMFUL.sub(lambda found: found[0] if found[0] in keep else _escaped(found[0]), text)
    return shown if most is None else shown[:most]


def _escaped(character: str) -> str:
    code = ord(character)
    if character in _NAMED:
        return _NAMED[character]
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
