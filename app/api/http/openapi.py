"""The OpenAPI document: what the framework cannot know by itself is added here."""

import asyncio
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.openapi.utils import get_openapi
from pydantic import TypeAdapter
from starlette.routing import Route

from app.api.http.problems import MEDIA_TYPE, Problem, problems
from app.missions.views.messages import LiveMessage

TAGS = [
    {"name": "missions", "description": "Describe a mission, start it, pause, resume, abort or finish it."},
    {"name": "vehicles", "description": "Which vehicles there are; how one that speaks REST measures and is guided."},
    {"name": "maps", "description": "The map as JSON, picture and files."},
    {"name": "sites", "description": "Places that are surveyed again and again: one map, and what changed."},
    {"name": "searches", "description": "Missions of kind search: scans in, what is known of the site out."},
    {"name": "targets", "description": "Moving targets: where they are thought to be, and the ranges that tell so."},
    {"name": "imports", "description": "Soundings and maps from elsewhere, and a grid to compare the map with."},
    {
        "name": "live",
        "description": "What happens, as it happens. Besides the log there is the WebSocket "
        "`/api/v1/missions/{mission_id}/live`: it sends `LiveMessage` objects as JSON text, first a `SnapshotMessage`. "
        "Programs send their token in the header, browsers their session's cookie; the address holds neither. "
        "Close codes: 4401 no valid token, 4403 forbidden, 4404 no such mission, "
        "4429 too many viewers, 1013 fell behind or not to be had at the moment (reconnect), 1001 the service ends.",
    },
    {"name": "alarms", "description": "What somebody on watch has to take, who has taken it, and who was told."},
    {"name": "session", "description": "Who asks, and signing in and out from a browser."},
    {"name": "audit", "description": "Who commanded what, from where, and what came of it."},
    {"name": "planners", "description": "Which planners decide where the vehicles go."},
    {
        "name": "health",
        "description": "Is the service well. Health and metrics are also at the root: `/health`, `/metrics`.",
    },
]

DESCRIPTION = """\
Coordinates a fleet of autonomous underwater vehicles so that together they map an unknown sea floor.

**Conventions.** Depth is in metres, positive down. Positions are WGS84 degrees; GeoJSON order is [longitude, latitude].
Times are RFC 3339 in UTC; a vehicle's own clock is Unix seconds.

**Errors** are problem documents (RFC 9457, `application/problem+json`): `type` names the kind of problem and is stable,
`detail` says what happened, `errors` lists each wrong field with its value and what would be right, `remedy` says what
to do. `instance` carries the request's id, which is also in the header `X-Request-Id` and in the log.

**Access.** While nobody has made a token, the user who runs the service may ask from the service's own machine. As
soon as one was made with `bathyfleet token create`, every request needs `Authorization: Bearer TOKEN`; health needs
none. A browser exchanges its token for a session: `POST /api/v1/session`. Roles: viewer, vehicle, operator, admin. Who
asks too often, or with too many wrong tokens, is answered 429 with `Retry-After`.
"""


def install(app: FastAPI) -> None:
    """Let ``app`` make its document with the schemas of problems and live messages."""

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _complete(
                get_openapi(
                    title=app.title,
                    version=app.version,
                    summary=app.summary,
                    description=app.description,
                    routes=app.routes,
                    tags=app.openapi_tags,
                    license_info=app.license_info,
                )
            )
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign]
    [made_by_framework] = [r for r in app.routes if isinstance(r, Route) and r.path == app.openapi_url]

    async def answer(request: Request) -> Response:
        # Making it takes about a second, in which vehicles would not be heard.
        await asyncio.to_thread(app.openapi)
        answered: Response = await made_by_framework.endpoint(request)
        return answered

    place = app.routes.index(made_by_framework)
    app.routes[place] = Route(made_by_framework.path, answer, include_in_schema=False)


def _complete(schema: dict[str, Any]) -> dict[str, Any]:
    components = schema.setdefault("components", {}).setdefault("schemas", {})
    adapters: dict[str, TypeAdapter[Any]] = {"Problem": TypeAdapter(Problem), "LiveMessage": TypeAdapter(LiveMessage)}
    for name, adapter in adapters.items():
        own = adapter.json_schema(mode="serialization", ref_template="#/components/schemas/{model}")
        for definition, body in own.pop("$defs", {}).items():
            components.setdefault(definition, body)
        components[name] = own
    schema["components"]["schemas"] = dict(sorted(components.items()))
    for methods in schema["paths"].values():
        for method, operation in methods.items():
            for parameter in operation.get("parameters", []):
                parameter["schema"] = _without_null(parameter["schema"])
            responses = operation["responses"]
            if "requestBody" in operation:
                _add(responses, problems("request-timeout", "too-many-bytes", "overloaded"))
            _add(responses, problems("invalid-request"))  # unknown parameters are none anywhere
            if method == "post" and not any(p["name"] == "idempotency-key" for p in operation.get("parameters", ())):
                _add(responses, problems("invalid-parameter"))
            if "401" in responses:
                _add(responses, problems("too-many-requests"))
            operation["responses"] = dict(sorted(responses.items()))
    return schema


def _add(responses: dict[str, Any], more: dict[int | str, dict[str, Any]]) -> None:
    """Add problems that any operation may answer with, beside those that it already does with the same status."""
    for status, described in more.items():
        present = responses.setdefault(str(status), described)
        if present is not described and described["description"] not in present["description"]:
            present["description"] += f"; {described['description'][0].lower()}{described['description'][1:]}"
            present["content"][MEDIA_TYPE]["examples"] |= described["content"][MEDIA_TYPE]["examples"]


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of an optional parameter: it may be left out, but there is no way to send null."""
    branches: list[dict[str, Any]] = [branch for branch in schema.get("anyOf", []) if branch != {"type": "null"}]
    if len(branches) != 1:
        return schema
    return {key: value for key, value in schema.items() if key != "anyOf"} | branches[0]
