"""Which error is answered as which problem document: the mission service's, the framework's, the database's."""

import sqlite3
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from sqlalchemy.exc import SQLAlchemyError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.types import Scope

from app.api.http.field_problems import plain, shortened, validation_problem, value_at
from app.api.http.problems import FieldProblem, Problem, ProblemError, instance_of, make_problem, problem_response
from app.api.http.route_parameters import query_names
from app.missions.errors import (
    AlarmNotFoundError,
    BeamEditNotFoundError,
    CastNotFoundError,
    ConflictError,
    FileTooLargeError,
    ImportNotFoundError,
    ImportUnavailableError,
    InvalidRequestError,
    MapNotReadyError,
    MissionElsewhereError,
    MissionError,
    MissionNotFoundError,
    MissionUnreadableError,
    NotAMemberError,
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

RETRY_AFTER_S = 5

SENT = "sent"
"""Of a request's state: the JSON of its body, where one was read and is not long."""

KINDS: dict[type[MissionError], str] = {
    AlarmNotFoundError: "alarm-not-found",
    BeamEditNotFoundError: "beam-edit-not-found",
    CastNotFoundError: "cast-not-found",
    ConflictError: "conflict",
    FileTooLargeError: "body-too-large",
    ImportNotFoundError: "import-not-found",
    ImportUnavailableError: "import-unavailable",
    InvalidRequestError: "invalid-request",
    MapNotReadyError: "map-not-ready",
    MissionElsewhereError: "mission-elsewhere",
    MissionNotFoundError: "mission-not-found",
    MissionUnreadableError: "mission-unreadable",
    MoveRefusedError: "move-refused",
    PingsNotFoundError: "pings-not-found",
    PingsUnreadableError: "pings-unreadable",
    NotAMemberError: "not-ready",
    ProductUnavailableError: "product-unavailable",
    SiteNotFoundError: "site-not-found",
    SoundingNotFoundError: "sounding-not-found",
    TargetNotFoundError: "target-not-found",
    VehicleNotFoundError: "vehicle-not-found",
}
"""Whatever the mission service refuses with, and the kind of problem that it is answered as."""

_REMEDIES = {
    "mission-not-found": "GET /api/v1/missions lists the missions",
    "vehicle-not-found": "GET /api/v1/missions/{id} lists the mission's vehicles",
    "map-not-ready": "Start the mission and let its vehicles measure",
}
"""What to do about a kind of problem where the error does not say it."""

_KINDS_BY_STATUS = {
    400: "malformed-body",
    404: "not-found",
    405: "method-not-allowed",
    413: "body-too-large",
    415: "unsupported-media-type",
}


def install(app: FastAPI) -> None:
    """Make every error of ``app`` a problem document."""
    app.add_exception_handler(RequestValidationError, _validation_problem)  # type: ignore[arg-type]
    app.add_exception_handler(HTTPException, _http_problem)  # type: ignore[arg-type]
    app.add_exception_handler(ProblemError, _edge_problem)  # type: ignore[arg-type]
    app.add_exception_handler(SQLAlchemyError, _database_problem)
    app.add_exception_handler(sqlite3.Error, _database_problem)
    app.add_exception_handler(MissionError, _mission_problem)  # type: ignore[arg-type]


def answer_to(error: Exception, scope: Scope) -> Response:
    """Return the answer to an error that arose before a route was reached; raises it where it has none."""
    request = Request(scope)
    if isinstance(error, ProblemError):
        return _edge_problem(request, error)
    if isinstance(error, MissionError):
        return _mission_problem(request, error)
    if isinstance(error, SQLAlchemyError | sqlite3.Error):
        return _database_problem(request, error)
    raise error


def _mission_problem(request: Request, error: MissionError) -> Response:
    kind = next((KINDS[cls] for cls in type(error).__mro__ if cls in KINDS), None)
    if kind is None:
        raise error
    detail, remedy = str(error), error.remedy or _REMEDIES.get(kind, "")
    errors = []
    if isinstance(error, InvalidRequestError):
        errors.append(
            FieldProblem(
                location=_location_of(request, error.field),
                field=error.field,
                value=plain(_sent(request, error.field)),
                message=shortened(detail),
                expected=shortened(remedy),
            )
        )
    problem = make_problem(kind, detail, instance=instance_of(request.scope), remedy=remedy, errors=errors)
    later = isinstance(error, ImportUnavailableError | NotAMemberError | ProductUnavailableError)
    return problem_response(problem, {"Retry-After": str(RETRY_AFTER_S)} if later else None)


def _location_of(request: Request, field: str) -> str:
    """Return where a field was sent, or was to be."""
    if field in request.path_params:
        return "path"
    route = request.scope.get("route")
    known = query_names(route.dependant) if isinstance(route, APIRoute) else ()
    return "query" if field in request.query_params or field in known else "body"


def _sent(request: Request, field: str) -> object:
    """Return what was sent for a field; None where that is not known."""
    if field in request.query_params:
        return request.query_params[field]
    return value_at(request.scope.get("state", {}).get(SENT), field.split("."))


def _validation_problem(request: Request, error: RequestValidationError) -> Response:
    entries = error.errors()
    body_field = getattr(request.scope.get("route"), "body_field", None)
    body_model = body_field.field_info.annotation if body_field is not None else None
    return problem_response(validation_problem(entries, body_model, request.scope))


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
