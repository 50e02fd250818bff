"""Errors as RFC 9457 problem documents: what was wrong with which field, and what would be right."""

import difflib
import itertools
import json
import math
import sqlite3
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from http import HTTPStatus
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.exc import DBAPIError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import Scope

from app.missions.errors import (
    AlarmNotFoundError,
    ConflictError,
    FileTooLargeError,
    ImportNotFoundError,
    ImportUnavailableError,
    InvalidRequestError,
    MapNotReadyError,
    MissionElsewhereError,
    MissionNotFoundError,
    MissionUnreadableError,
    PingsNotFoundError,
    PingsUnreadableError,
    ProductUnavailableError,
    SiteNotFoundError,
    SoundingNotFoundError,
    TargetNotFoundError,
    VehicleNotFoundError,
)
from app.missions.states import MoveRefusedError
from app.storage.db_errors import trouble_of

T = TypeVar("T")

MEDIA_TYPE = "application/problem+json"
URN = "urn:bathyfleet:problem:"

MAX_ERRORS = 50
"""More faults than these in one request are counted but not listed."""
RETRY_AFTER_S = 5
MAX_SHOWN = 200
"""Longer values are shown shortened."""
MAX_SHOWN_ENTRIES = 5
"""Of a list or an object only so many are shown, and so many within each."""
MAX_SUGGESTED = 64
"""To longer names than any field has none is looked for that is like it."""
SUGGESTION = "did you mean"


class FieldProblem(BaseModel):
    """What is wrong with one value of a request."""

    location: str = Field(description="Where the value was: body, query, path or header")
    field: str = Field(description="Path of the field, for example limits.max_step_m or vehicles.0.name")
    value: Any = Field(description="What was sent, shortened when long; null when it was missing")
    message: str = Field(description="What is wrong with it")
    expected: str = Field(description="What would be right")


class Problem(BaseModel):
    """A problem document (RFC 9457)."""

    model_config = ConfigDict(json_schema_serialization_defaults_required=True)

    type: str = Field(description="Stable name of the kind of problem, a URN")
    title: str = Field(description="The kind of problem in words")
    status: int = Field(description="The HTTP status")
    detail: str = Field(description="What happened here")
    instance: str = Field(description="The path that was asked, with the request's id after #")
    remedy: str = Field(default="", description="What to do about it")
    errors: list[FieldProblem] = Field(default_factory=list, description="The fields that are wrong, if any are")


TITLES: dict[str, tuple[int, str]] = {
    "malformed-body": (400, "The body cannot be read"),
    "invalid-parameter": (400, "A parameter of the address cannot be taken"),
    "unauthenticated": (401, "An access token is needed"),
    "forbidden": (403, "Not allowed"),
    "not-found": (404, "There is no such resource"),
    "mission-not-found": (404, "There is no such mission"),
    "vehicle-not-found": (404, "There is no such vehicle"),
    "site-not-found": (404, "There is no such site"),
    "format-not-found": (404, "There is no such format"),
    "sounding-not-found": (404, "There is no such sounding"),
    "target-not-found": (404, "The mission has no such target"),
    "import-not-found": (404, "There is no such import"),
    "alarm-not-found": (404, "There is no such alarm"),
    "feature-not-found": (404, "There is no such feature"),
    "pings-not-found": (404, "There is no such file of pings"),
    "map-not-ready": (404, "There is no map yet"),
    "method-not-allowed": (405, "The method is not allowed here"),
    "not-acceptable": (406, "None of the accepted media types can be sent"),
    "request-timeout": (408, "The request took too long to arrive"),
    "conflict": (409, "It contradicts the present state"),
    "move-refused": (409, "Not possible in the mission's state"),
    "body-too-large": (413, "The body is too large"),
    "unsupported-media-type": (415, "The body's media type is not supported"),
    "invalid-request": (422, "Some values cannot be taken"),
    "too-many-streams": (429, "Too many live views"),
    "too-many-requests": (429, "Too many requests"),
    "too-many-bytes": (429, "Too much is sent at once"),
    "internal": (500, "Something went wrong inside the service"),
    "mission-unreadable": (500, "A stored mission cannot be opened"),
    "pings-unreadable": (500, "A file of pings is missing or damaged"),
    "too-many-connections": (503, "Too many requests at the same time"),
    "mission-elsewhere": (503, "Another process has the mission"),
    "import-unavailable": (503, "No file can be read now"),
    "product-unavailable": (503, "The file cannot be made now"),
    "overloaded": (503, "Too much is under way"),
    "not-ready": (503, "The service is not ready"),
    "database-unavailable": (503, "The database cannot be used now"),
}
"""Every kind of problem: its status and its title."""


class ProblemError(Exception):
    """Raised by the HTTP edge itself; answered as a problem of ``kind``, a key of :data:`TITLES`."""

    def __init__(self, kind: str, detail: str, *, remedy: str = "", headers: Mapping[str, str] | None = None) -> None:
        super().__init__(detail)
        self.kind = kind
        self.detail = detail
        self.remedy = remedy
        self.headers = dict(headers or {})


def make_problem(
    kind: str, detail: str, *, instance: str, remedy: str = "", errors: Sequence[FieldProblem] = ()
) -> Problem:
    """Fill in a problem document of ``kind``, a key of :data:`TITLES`."""
    status, title = TITLES[kind]
    return Problem(
        type=URN + kind,
        title=title,
        status=status,
        detail=detail,
        instance=instance,
        remedy=remedy,
        errors=list(errors),
    )


def problem_response(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    """Render a problem document; whatever a client sent can be shown in it."""
    # ASCII escapes keep lone surrogates, which a client can smuggle in as \\udXXX, from breaking the answer.
    body = json.dumps(problem.model_dump(mode="python"), allow_nan=False)
    return Response(
        body,
        status_code=problem.status,
        media_type=MEDIA_TYPE,
        headers={"Cache-Control": "no-store", **(headers or {})},
    )


def instance_of(scope: Mapping[str, Any]) -> str:
    """Name the occurrence: the path that was asked and the id of the request, which the log has too."""
    request_id = scope.get("state", {}).get("request_id", "")
    return f"{scope.get('path', '')}#{request_id}" if request_id else str(scope.get("path", ""))


def problems(*kinds: str) -> dict[int | str, dict[str, Any]]:
    """Describe the problems that a route may answer, for the OpenAPI document."""
    responses: dict[int | str, dict[str, Any]] = {}
    for kind in kinds:
        status, title = TITLES[kind]
        entry = responses.setdefault(
            status,
            {
                "description": title,
                "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": {}}},
            },
        )
        if title not in entry["description"]:
            entry["description"] += f"; {title[0].lower()}{title[1:]}"
        entry["content"][MEDIA_TYPE]["examples"][kind] = {"summary": title, "value": example_problem(kind)}
    return responses


BODY_KINDS = ("malformed-body", "body-too-large", "unsupported-media-type", "invalid-request")


def body_problems(*further: str) -> dict[int | str, dict[str, Any]]:
    """Describe the problems that a route with a JSON body may answer: those of bodies, and further ones."""
    return problems(*sorted((*BODY_KINDS, *further), key=lambda kind: TITLES[kind][0]))


def example_problem(kind: str) -> dict[str, Any]:
    """An example of a problem of ``kind``."""
    details: dict[str, tuple[str, str]] = {
        "mission-not-found": ("there is no mission 'b2'", "GET /api/v1/missions lists the missions"),
        "move-refused": (
            "cannot pause a mission that is ready; allowed from: running",
            "Start it first: POST /api/v1/missions/{id}/start",
        ),
        "invalid-request": ("1 value cannot be taken: limits.max_step_m", "Correct the fields listed in errors"),
    }
    detail, remedy = details.get(kind, (TITLES[kind][1], ""))
    errors = [
        FieldProblem(
            location="body",
            field="limits.max_step_m",
            value=-1,
            message="Input should be greater than 0",
            expected="a number > 0",
        )
    ]
    return make_problem(
        kind,
        detail,
        instance="/api/v1/missions#5e1f",
        remedy=remedy,
        errors=errors if kind == "invalid-request" else (),
    ).model_dump(mode="json")


def plain(value: object) -> Any:
    """Return ``value`` as short JSON: what cannot be written in JSON or is long is shown as shortened text."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        return value if abs(value) < 2**53 else _shortened(hex(value))
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return _shortened(value)
    return _shortened(_outline(value))


def _outline(value: object, depth: int = 3) -> str:
    """Return the beginning of ``value`` as text: what it costs does not grow with the value."""
    if isinstance(value, dict):
        shown = [f"{_outline(k, 0)}: {_outline(v, depth - 1)}" for k, v in _first(value.items())] if depth > 0 else []
        return "{" + ", ".join(shown + ["…"] * (len(value) > len(shown))) + "}"
    if isinstance(value, list | tuple):
        shown = [_outline(entry, depth - 1) for entry in _first(value)] if depth > 0 else []
        return "[" + ", ".join(shown + ["…"] * (len(value) > len(shown))) + "]"
    if isinstance(value, str):
        return repr(_shortened(value))
    if isinstance(value, bool | float) or value is None:
        return repr(value)
    return str(plain(value)) if isinstance(value, int) else type(value).__name__


def _first(entries: Iterable[T]) -> Iterator[T]:
    return itertools.islice(entries, MAX_SHOWN_ENTRIES)


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 1] + "…"


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


def field_problem(
    error: Mapping[str, Any], *, location: str, path: Sequence[str | int], model: object = None
) -> FieldProblem:
    """Explain one error of pydantic; ``model`` is the annotation that ``path`` starts from, for suggestions."""
    kind = error["type"]
    message = str(error["msg"]).removeprefix("Value error, ")
    if kind in _BOUNDS:
        expected = _BOUNDS[kind].format_map(error.get("ctx", {}))
    elif kind == "extra_forbidden":
        known = sorted(_fields_at(model, path[:-1]))
        name = str(path[-1])
        close = difflib.get_close_matches(name, known, n=1) if known and len(name) <= MAX_SUGGESTED else []
        message = "There is no such field"
        expected = f"{SUGGESTION} {close[0]}?" if close else "one of " + ", ".join(known) if known else "no such field"
    elif kind == "value_error":
        # The validators' own messages end with what would be right.
        head, separator, tail = message.rpartition(": ")
        message, expected = (head, tail) if separator else (message, message)
    else:
        expected = _EXPECTED.get(kind, message)
    return FieldProblem(
        location=location,
        field=_shortened(".".join(_shortened(str(part)) for part in path)) or location,
        value=None if kind == "missing" else plain(error.get("input")),
        message=_shortened(message),
        expected=_shortened(expected),
    )


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


def _validation_problem(request: Request, error: RequestValidationError) -> Response:
    entries = error.errors()
    body_field = getattr(request.scope.get("route"), "body_field", None)
    body_model = body_field.field_info.annotation if body_field is not None else None
    return problem_response(validation_problem(entries, body_model, request.scope))


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


_KINDS_BY_STATUS = {
    400: "malformed-body",
    404: "not-found",
    405: "method-not-allowed",
    413: "body-too-large",
    415: "unsupported-media-type",
}


def _http_problem(request: Request, error: HTTPException) -> Response:
    method, path = request.method, request.scope["path"]
    if error.status_code == HTTPStatus.NOT_FOUND:
        detail, remedy = f"nothing is at {plain(path)}", "GET /api/openapi.json describes every path"
    elif error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        allowed = (error.headers or {}).get("Allow", "")
        detail, remedy = f"{plain(path)} does not take {method}", f"Use {allowed}" if allowed else ""
    elif error.status_code == HTTPStatus.BAD_REQUEST:
        detail, remedy = "the body is not JSON in UTF-8", "Send the body as valid JSON (RFC 8259)"
    else:
        detail, remedy = str(error.detail), ""
    kind = _KINDS_BY_STATUS.get(error.status_code)
    if kind is None:
        problem = Problem(
            type="about:blank",
            title=HTTPStatus(error.status_code).phrase,
            status=error.status_code,
            detail=detail,
            instance=instance_of(request.scope),
        )
    else:
        problem = make_problem(kind, detail, instance=instance_of(request.scope), remedy=remedy)
    return problem_response(problem, error.headers)


def describe_mission_error(error: Exception) -> tuple[str, str, str]:
    """Return kind, detail and remedy for what the mission service refuses."""
    kinds: Iterable[tuple[type[Exception], str]] = (
        (MissionNotFoundError, "mission-not-found"),
        (VehicleNotFoundError, "vehicle-not-found"),
        (SoundingNotFoundError, "sounding-not-found"),
        (PingsNotFoundError, "pings-not-found"),
        (PingsUnreadableError, "pings-unreadable"),
        (MissionUnreadableError, "mission-unreadable"),
        (TargetNotFoundError, "target-not-found"),
        (ImportNotFoundError, "import-not-found"),
        (AlarmNotFoundError, "alarm-not-found"),
        (SiteNotFoundError, "site-not-found"),
        (ImportUnavailableError, "import-unavailable"),
        (ProductUnavailableError, "product-unavailable"),
        (FileTooLargeError, "body-too-large"),
        (MapNotReadyError, "map-not-ready"),
        (MissionElsewhereError, "mission-elsewhere"),
        (MoveRefusedError, "move-refused"),
        (ConflictError, "conflict"),
        (InvalidRequestError, "invalid-request"),
    )
    kind = next(kind for cls, kind in kinds if isinstance(error, cls))
    remedies = {
        "mission-not-found": "GET /api/v1/missions lists the missions",
        "vehicle-not-found": "GET /api/v1/missions/{id} lists the mission's vehicles",
        "map-not-ready": "Start the mission and let its vehicles measure",
    }
    return kind, str(error), getattr(error, "remedy", "") or remedies.get(kind, "")


def _mission_problem(request: Request, error: Exception) -> Response:
    kind, detail, remedy = describe_mission_error(error)
    errors = []
    if isinstance(error, InvalidRequestError):
        errors.append(
            FieldProblem(
                location=_location_of(request, error.field),
                field=error.field,
                value=None,  # it may name what is on this machine
                message=_shortened(detail),
                expected=_shortened(remedy),
            )
        )
    problem = make_problem(kind, detail, instance=instance_of(request.scope), remedy=remedy, errors=errors)
    later = isinstance(error, ImportUnavailableError | ProductUnavailableError)
    return problem_response(problem, {"Retry-After": str(RETRY_AFTER_S)} if later else None)


def _location_of(request: Request, field: str) -> str:
    """Return where a field was sent."""
    if field in request.query_params:
        return "query"
    return "path" if field in request.path_params else "body"


def _edge_problem(request: Request, error: ProblemError) -> Response:
    problem = make_problem(error.kind, error.detail, instance=instance_of(request.scope), remedy=error.remedy)
    return problem_response(problem, error.headers)


def _database_problem(request: Request, error: Exception) -> Response:
    trouble = trouble_of(error)
    if not trouble:
        raise error
    detail, _, remedy = trouble.partition(": ")
    problem = make_problem("database-unavailable", detail, instance=instance_of(request.scope), remedy=remedy)
    return problem_response(problem, {"Retry-After": str(RETRY_AFTER_S)})


def answer_to(error: Exception, scope: Scope) -> Response:
    """Return the answer to an error that arose before a route was reached; raises it where it has none."""
    request = Request(scope)
    if isinstance(error, ProblemError):
        return _edge_problem(request, error)
    if isinstance(error, MissionNotFoundError):
        return _mission_problem(request, error)
    if isinstance(error, DBAPIError | sqlite3.Error):
        return _database_problem(request, error)
    raise error


def install(app: FastAPI) -> None:
    """Make every error of ``app`` a problem document."""
    app.add_exception_handler(RequestValidationError, _validation_problem)  # type: ignore[arg-type]
    app.add_exception_handler(HTTPException, _http_problem)  # type: ignore[arg-type]
    app.add_exception_handler(ProblemError, _edge_problem)  # type: ignore[arg-type]
    app.add_exception_handler(DBAPIError, _database_problem)
    app.add_exception_handler(sqlite3.Error, _database_problem)
    for cls in (
        MissionNotFoundError,
        MissionUnreadableError,
        VehicleNotFoundError,
        PingsNotFoundError,
        PingsUnreadableError,
        ProductUnavailableError,
        SoundingNotFoundError,
        TargetNotFoundError,
        ImportNotFoundError,
        AlarmNotFoundError,
        SiteNotFoundError,
        ImportUnavailableError,
        FileTooLargeError,
        MapNotReadyError,
        MissionElsewhereError,
        MoveRefusedError,
        ConflictError,
        InvalidRequestError,
    ):
        app.add_exception_handler(cls, _mission_problem)
