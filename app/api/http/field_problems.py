"""What is wrong with the fields of a request, and what would be right: from pydantic's errors to words."""

import difflib
import itertools
import math
import types
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel

from app.api.http.problems import FieldProblem, Problem, instance_of, make_problem
from app.missions.spec.base import NOT_BLANK, SHOWN_PATTERN, FieldError

T = TypeVar("T")

MAX_ERRORS = 50
"""More faults than these in one request are counted but not listed."""

MAX_SHOWN = 200
"""Longer values are shown shortened."""

MAX_SHOWN_ENTRIES = 5
"""Of a list or an object only so many are shown, and so many within each."""

MAX_SUGGESTED = 64
"""To longer names than any field has none is looked for that is like it."""

SUGGESTION = "did you mean"

_EXPECTED = {
    "missing": "a value: the field is required",
    "finite_number": "a finite number, not NaN or infinity",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a smaller whole number",
    "string_type": "text in quotes",
    "string_unicode": "text without lone surrogates",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "list_type": "a list: [...]",
    "tuple_type": "a list: [...]",
    "dict_type": "an object: {...}",
    "model_type": "an object: {...}",
    "model_attributes_type": "an object: {...}",
    "json_invalid": "valid JSON",
}

_BOUNDS = {
    "greater_than": ("a number > {gt}"),
    "greater_than_equal": ("a number ≥ {ge}"),
    "less_than": ("a number < {lt}"),
    "less_than_equal": ("a number ≤ {le}"),
    "string_too_long": ("at most {max_length} characters"),
    "string_too_short": ("at least {min_length} character(s)"),
    "too_long": ("at most {max_length} entries"),
    "too_short": ("at least {min_length} entries"),
    "string_pattern_mismatch": ("text that matches {pattern}"),
    "enum": ("{expected}"),
    "literal_error": ("{expected}"),
}


_PATTERNS = {
    SHOWN_PATTERN: ("It is blank or has several lines", "one line of text that is not blank"),
    NOT_BLANK: ("It is blank", "text that is not blank"),
}
"""What is wrong with texts that do not match, and what would be right."""


def validation_problem(entries: Sequence[Mapping[str, Any]], body_model: object, scope: Mapping[str, Any]) -> Problem:
    """Explain errors of pydantic, the first :data:`MAX_ERRORS` of them; ``body_model`` is what the body should be."""
    listed = [
        field_problem(
            entry,
            location=str(entry["loc"][0]),
            path=entry["loc"][1:],
            model=body_model if entry["loc"][0] == "body" else None,
        )
        for entry in entries[:MAX_ERRORS]
    ]
    return invalid(listed, len(entries), scope)


def invalid(errors: Sequence[FieldProblem], count: int, scope: Mapping[str, Any]) -> Problem:
    """The problem document for ``count`` wrong values, of which ``errors`` are listed."""
    names = ", ".join(error.field for error in errors[:5]) + (", …" if count > 5 else "")
    return make_problem(
        "invalid-request",
        f"{count} value{'s' if count > 1 else ''} cannot be taken: {names}",
        instance=instance_of(scope),
        remedy="Correct the fields listed in errors",
        errors=errors,
    )


def field_problem(
    error: Mapping[str, Any], *, location: str, path: Sequence[str | int], model: object = None
) -> FieldProblem:
    """Explain one error of pydantic; ``model`` is the annotation that ``path`` starts from, for suggestions."""
    kind = error["type"]
    reason, value = error.get("ctx", {}).get("error"), error.get("input")
    if isinstance(reason, FieldError):
        inner = reason.field.split(".")
        path, value = [*path, *inner], value_at(value, inner)
    message = str(error["msg"]).removeprefix("Value error, ")
    if kind == "string_pattern_mismatch" and error.get("ctx", {}).get("pattern") in _PATTERNS:
        message, expected = _PATTERNS[error["ctx"]["pattern"]]
    elif kind in _BOUNDS:
        expected = _BOUNDS[kind].format_map(error.get("ctx", {}))
    elif kind == "extra_forbidden":
        message = "There is no such field"
        expected = suggestion(str(path[-1]), _fields_at(model, path[:-1])) or "no such field"
    elif kind == "value_error":
        # The validators' own messages end with what would be right.
        head, separator, tail = message.rpartition(": ")
        message, expected = (head, tail) if separator else (message, message)
    else:
        expected = _EXPECTED.get(kind, message)
    return FieldProblem(
        location=location,
        field=shortened(".".join(shortened(str(part)) for part in path)) or location,
        value=None if kind == "missing" else plain(value),
        message=shortened(message),
        expected=shortened(expected),
    )


def suggestion(name: str, known: Collection[str]) -> str:
    """Return which of the ``known`` names ``name`` was meant for, or else all of them; nothing without any."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1) if names and len(name) <= MAX_SUGGESTED else []
    return f"{SUGGESTION} {close[0]}?" if close else "one of " + ", ".join(names) if names else ""


def _fields_at(annotation: object, path: Sequence[str | int]) -> set[str]:
    """Names of the fields of the model that ``path`` leads to."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if get_origin(annotation) in (Union, types.UnionType):
        return set().union(*(_fields_at(branch, path) for branch in get_args(annotation)))
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if not path:
            return {field.alias or name for name, field in annotation.model_fields.items()}
        field = annotation.model_fields.get(str(path[0]))
        return _fields_at(field.annotation, path[1:]) if field else set()
    if path and isinstance(path[0], int) and get_args(annotation):
        return _fields_at(get_args(annotation)[0], path[1:])
    return set()


def value_at(value: object, path: Sequence[str]) -> object:
    """Return what a path leads to in JSON; None where it leads nowhere."""
    for part in path:
        if isinstance(value, Mapping):
            value = value.get(part)
        elif isinstance(value, list | tuple) and part.isdecimal() and int(part) < len(value):
            value = value[int(part)]
        else:
            return None
    return value


def plain(value: object) -> Any:
    """Return ``value`` as short JSON: what cannot be written in JSON or is long is shown as shortened text."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        return value if abs(value) < 2**53 else shortened(hex(value))
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return shortened(value)
    return shortened(_outline(value))


def _outline(value: object, depth: int = 3) -> str:
    """Return the beginning of ``value`` as text: what it costs does not grow with the value."""
    if isinstance(value, dict):
        shown = [f"{_outline(k, 0)}: {_outline(v, depth - 1)}" for k, v in _first(value.items())] if depth > 0 else []
        return "{" + ", ".join(shown + ["…"] * (len(value) > len(shown))) + "}"
    if isinstance(value, list | tuple):
        shown = [_outline(entry, depth - 1) for entry in _first(value)] if depth > 0 else []
        return "[" + ", ".join(shown + ["…"] * (len(value) > len(shown))) + "]"
    if isinstance(value, str):
        return repr(shortened(value))
    if isinstance(value, bool | float) or value is None:
        return repr(value)
    return str(plain(value)) if isinstance(value, int) else type(value).__name__


def _first(entries: Iterable[T]) -> Iterator[T]:
    return itertools.islice(entries, MAX_SHOWN_ENTRIES)


def shortened(text: str) -> str:
    """Return the beginning of a text that is long."""
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 1] + "…"
