"""What a route takes and from whom, known before any of a request's body is read."""

import email.message
import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto
from functools import lru_cache

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import Scope

from app.api.access.auth import RoleCheck
from app.api.accounts.tokens import Principal
from app.api.http.problems import ProblemError
from app.api.http.route_index import RouteIndex
from app.api.state import EdgeState

MAX_IGNORED_BYTES = 65_536
"""As much is taken where a route has no use for a body: some clients always send one."""
_MISSION_ID = re.compile(r"[A-Za-z0-9_-]{1,64}")


class BodyKind(Enum):
    """What a route makes of a body."""

    JSON = auto()
    FILE = auto()
    NONE = auto()


@dataclass(frozen=True)
class Intake:
    """A route that may change something: who may ask, and what body it takes."""

    route: APIRoute
    role: RoleCheck | None
    kind: BodyKind

    async def admit(self, scope: Scope, edge: EdgeState) -> Principal | None:
        """Return who asks, None where nobody needs to be known; only the headers are looked at.

        Raises
        ------
        ProblemError, MissionNotFoundError
            When the request is not one to read on: by whom it is, or where it goes.
        """
        principal = None if self.role is None else await self.role.admit(HTTPConnection(scope), edge)
        mission_id = scope.get("path_params", {}).get("mission_id", "")
        # Other ids than these the route itself refuses, and says why.
        if _MISSION_ID.fullmatch(mission_id):
            await edge.service.check_exists(mission_id)
        return principal

    def limit(self, max_bytes: int, max_file_bytes: int) -> int:
        """Return how many bytes a body may have."""
        limits = {BodyKind.JSON: max_bytes, BodyKind.FILE: max_file_bytes, BodyKind.NONE: MAX_IGNORED_BYTES}
        return limits[self.kind]

    def check_media_type(self, headers: Headers) -> None:
        """Raise ProblemError where a body is declared as something that the route does not take."""
        if self.kind is not BodyKind.JSON or not has_body(headers):
            return
        if not _is_json(headers.get("content-type", "")):
            raise ProblemError(
                "unsupported-media-type",
                f"the body is declared as {headers.get('content-type', '')[:200] or 'nothing'}",
                remedy="Send JSON with the header Content-Type: application/json",
            )
        if headers.get("content-encoding", "identity").lower() != "identity":
            raise ProblemError(
                "unsupported-media-type",
                f"the body is packed ({headers['content-encoding'][:200]})",
                remedy="Send it as it is, without Content-Encoding",
            )


class Intakes:
    """Finds the route of a request that may change something."""

    def __init__(self, routers: Iterable[APIRouter]) -> None:
        self._index = RouteIndex(
            (route, Intake(route, _role(route), _kind(route)))
            for router in routers
            for route in router.routes
            if isinstance(route, APIRoute)
        )

    def of(self, method: str) -> list[Intake]:
        """Return the intakes of a method's routes."""
        return self._index.of(method)

    def find(self, scope: Scope) -> Intake | None:
        """Return a request's intake, and note its route and mission with the request; None: there is none."""
        found = self._index.find(scope["method"], scope["path"])
        if found is None:
            return None
        scope["route"], scope["path_params"], intake = found
        return intake


def has_body(headers: Headers) -> bool:
    """Tell whether a body follows a request's head."""
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers


def declared_bytes(headers: Headers) -> int | None:
    """Return how long a body says it is; None when it does not say."""
    declared = headers.get("content-length", "" if "transfer-encoding" in headers else "0")
    return int(declared) if declared.isdecimal() and declared.isascii() else None


@lru_cache(maxsize=64)
def _is_json(content_type: str) -> bool:
    message = email.message.Message()
    message["content-type"] = content_type
    subtype = message.get_content_subtype()
    return message.get_content_maintype() == "application" and (subtype == "json" or subtype.endswith("+json"))


def _role(route: APIRoute) -> RoleCheck | None:
    return next((d.call for d in route.dependant.dependencies if isinstance(d.call, RoleCheck)), None)


def _kind(route: APIRoute) -> BodyKind:
    if route.body_field is not None:
        return BodyKind.JSON
    described = (route.openapi_extra or {}).get("requestBody", {}).get("content", {})
    return BodyKind.FILE if described else BodyKind.NONE
