"""JSON made into values: first bounded, then read in pieces, so that other threads are not held up."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from json import JSONDecodeError, JSONDecoder
from json.decoder import JSONArray, JSONObject  # type: ignore[attr-defined]
from typing import Any

WINDOW = 262_144
"""Characters that the decoder gets at once: it lets no other thread run meanwhile."""

_BLANKS = re.compile(r"[ \t\n\r]*")
_LONGEST_WORD = 16
"""Nothing that a piece cuts in two looks wrong earlier before its end: names of numbers and escapes are shorter."""
_SURROGATES = re.compile("[\ud800-\udfff]")
# Every escape in its turn, so that an escaped backslash is none before "u0000".
_ESCAPE = re.compile(
    rb"\\(?:u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}|(?P<bad>u0000|u[dD][89a-fA-F])|.)", re.DOTALL
)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object. Raises NameTwiceError when a name stands in it twice: all values but the last would be lost."""
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        raise NameTwiceError(next(name for name in names if names.count(name) > 1))
    return found


_decoder = JSONDecoder()
_strict_decoder = JSONDecoder(object_pairs_hook=_once)
_scan_once: Callable[[str, int], tuple[Any, int]] = _decoder.scan_once  # type: ignore[attr-defined]


@dataclass(frozen=True)
class Bounds:
    """How much JSON may hold beyond its length in bytes.

    Attributes
    ----------
    values
        Entries of lists and objects, lists and objects themselves.
    texts
        Names of fields and texts.
    """

    values: int = 400_000
    texts: int = 20_000

    def excess(self, body: bytes) -> str:
        """Return what there is too much of, counted too high rather than too low; empty when all is well."""
        if body.count(b'"') > 2 * self.texts:
            return f"more than {self.texts} names and texts"
        if body.count(b",") + body.count(b"[") + body.count(b"{") > self.values:
            return f"more than {self.values} values"
        return ""


def parse(body: bytes) -> Any:
    """Return the value that JSON text in UTF-8 stands for.

    Long text is read one window after the other: no list in it may have a longer entry, other than in an entry. It is
    what vehicles send; what people describe is shorter, and refused where it says something twice.

    Raises
    ------
    NameTwiceError
        When an object in text of at most one window has a name twice.
    JSONDecodeError, UnicodeDecodeError
        When it is none.
    RecursionError, ValueError
        When it is nested too deep, or has a number of thousands of digits.
    """
    text = body.decode("utf-8-sig")
    begin = _BLANKS.match(text).end()  # type: ignore[union-attr]
    if len(text) <= WINDOW:
        return _strict_decoder.decode(text)
    try:
        found, end = _member(text, begin)
    except StopIteration as stop:
        raise JSONDecodeError("Expecting value", text, stop.value) from None
    end = _BLANKS.match(text, end).end()  # type: ignore[union-attr]
    if end != len(text):
        raise JSONDecodeError("Extra data", text, end)
    return found


def _member(text: str, index: int) -> tuple[Any, int]:
    """Return the value that begins at an index, and where it ends; only entries of lists are read by the decoder."""
    begin = text[index : index + 1]
    if begin == "{":
        return JSONObject((text, index + 1), True, _member, None, None, {})  # type: ignore[no-any-return]
    if begin == "[":
        return JSONArray((text, index + 1), _Window().entry)  # type: ignore[no-any-return]
    return _scan_once(text, index)


class _Window:
    """Reads the entries of a list from pieces of the text."""

    def __init__(self) -> None:
        self._first = 0
        self._piece = ""

    def entry(self, text: str, index: int) -> tuple[Any, int]:
        """Return the entry that begins at an index, and where it ends."""
        found = self._inside(text, index)
        if found is None:
            self._first, self._piece = index, text[index : index + WINDOW]
            found = self._inside(text, index)
        if found is None:
            raise EntryTooLongError(f"one entry of a list has more than {WINDOW} characters")
        return found

    def _inside(self, text: str, index: int) -> tuple[Any, int] | None:
        """Return the entry and its end if the piece has all of it. Raises JSONDecodeError, StopIteration if wrong."""
        inside = index - self._first
        size = len(self._piece)
        if inside >= size:
            return None
        last = self._first + size == len(text)
        try:
            value, end = _scan_once(self._piece, inside)
        except StopIteration as stop:
            if last or stop.value + _LONGEST_WORD < size:
                raise StopIteration(self._first + stop.value) from None
            return None
        except JSONDecodeError as error:
            whole = error.pos + _LONGEST_WORD < size and not error.msg.startswith("Unterminated")
            if last or whole:
                raise JSONDecodeError(error.msg, text, self._first + error.pos) from None
            return None
        # A number near the end of a piece may go on in the next one.
        return (value, self._first + end) if last or end + _LONGEST_WORD < size else None


class NameTwiceError(ValueError):
    """A name stands twice in one object; the error's argument is the name."""


class Unreadable(str):
    """Stands for an entry of a list that cannot be read, and says why."""


class EntryTooLongError(ValueError):
    """One entry of a list is longer than what is read at once."""


def may_be_unstorable(body: bytes) -> bool:
    """Tell whether JSON holds an escaped NUL or half of a surrogate pair; raw ones it cannot hold."""
    return b"\\u" in body and any(found["bad"] for found in _ESCAPE.finditer(body))


def unstorable(parsed: Any) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield path and text of every text and name with a NUL or a lone surrogate, in no order."""
    pending: list[tuple[tuple[Any, ...], Any]] = [((), parsed)]
    while pending:
        path, value = pending.pop()
        if isinstance(value, str):
            if _is_unstorable(value):
                yield _names(path), value
        elif isinstance(value, dict):
            for key, item in value.items():
                if _is_unstorable(key):
                    yield _names(path), key
                if isinstance(item, str | dict | list):
                    pending.append(((path, key), item))
        elif isinstance(value, list):
            pending.extend(((path, i), item) for i, item in enumerate(value) if isinstance(item, str | dict | list))


def _names(path: tuple[Any, ...]) -> tuple[str, ...]:
    """Return a path, kept as pairs of what came before and the last name, as names."""
    names = []
    while path:
        path, name = path
        names.append(str(name))
    return tuple(reversed(names))


def _is_unstorable(text: str) -> bool:
    return "\0" in text or _SURROGATES.search(text) is not None
