"""Errors as RFC 9457 problem documents: their kinds, what one says, and what routes declare of them."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response

MEDIA_TYPE = "application/problem+json"

URN = "urn:bathyfleet:problem:"

TITLES: dict[str, tuple[int, str]] = {
    "malformed-body": (400, "The body cannot be read"),
    "invalid-parameter": (400, "A parameter of the address or the head cannot be taken"),
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
    "beam-edit-not-found": (404, "Nothing with this number was said of the mission's beams"),
    "cast-not-found": (404, "The mission has no such sound speed cast"),
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

BODY_KINDS = ("malformed-body", "body-too-large", "unsupported-media-type", "invalid-request")


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
