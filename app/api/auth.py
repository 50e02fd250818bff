"""Who may ask for what: access tokens, roles, and the local operator while there are no tokens."""

import asyncio
import ipaddress
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Security
from fastapi.security import HTTPBearer
from starlette.requests import HTTPConnection

from app.api.limits import Limits, host_of
from app.api.peers import is_another_user
from app.api.problems import ProblemError
from app.api.state import EdgeState, State
from app.api.tokens import Principal, Role, TokenStore
from app.settings import is_loopback

RECHECK_S = 15.0
"""How long a live view may outlast its token."""

LOCAL_OPERATOR = Principal("local operator", Role.ADMIN)

# Only for the OpenAPI document: the header itself is read below, so that problems are answered our way.
_bearer = HTTPBearer(
    auto_error=False,
    scheme_name="token",
    description="A token made by `bathyfleet token create`. Needed as soon as one token exists.",
)

_PROXY_HEADERS = ("forwarded", "via", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "x-real-ip")

READERS = frozenset(Role)
ADMINS = frozenset({Role.ADMIN})
OPERATORS = frozenset({Role.OPERATOR, Role.ADMIN})
VEHICLES = OPERATORS | {Role.VEHICLE}


async def authenticate(connection: HTTPConnection, state: EdgeState, *, query_token: bool = False) -> Principal:
    """Return who asks.

    ``query_token`` also takes the token from ``?token=``, for browsers' sockets, which cannot send headers.
    Raises ProblemError (unauthenticated, forbidden).
    """
    _check_origin(connection, state)
    token = connection.query_params.get("token") if query_token else None
    header = connection.headers.get("authorization")
    if header is not None:
        scheme, _, token = header.partition(" ")
        if scheme.lower() != "bearer":
            raise _unauthenticated(f"the Authorization header has the scheme {scheme[:20]!r}")
    if token is not None:
        principal = await state.tokens.principal(token.strip())
        state.limits.log_in(token.strip(), host_of(connection.scope), good=principal is not None)
        if principal is None:
            raise _unauthenticated("the access token is unknown, revoked or has run out")
        return _remember(connection, principal)
    if await state.tokens.any():
        raise _unauthenticated("the request carries no access token")
    if state.settings.insecure or _is_local(connection, state):
        return _remember(connection, LOCAL_OPERATOR)
    raise ProblemError(
        "forbidden",
        "without access tokens only the user of this machine who runs the service may use it, and not by a proxy",
        remedy="Use the token in operator.token beside the database, or make one on the machine of the service: "
        "bathyfleet token create NAME --role operator",
    )


def _remember(connection: HTTPConnection, principal: Principal) -> Principal:
    """Keep with the request who asks, for the audit log."""
    connection.scope.setdefault("state", {})["principal"] = principal
    return principal


async def until_unwelcome(connection: HTTPConnection, state: EdgeState, *, query_token: bool = False) -> None:
    """Return when whoever listens may not any more: the token was revoked or has run out."""
    while True:
        await asyncio.sleep(RECHECK_S)
        try:
            await authenticate(connection, state, query_token=query_token)
        except ProblemError:
            return


async def console_log_in(
    tokens: TokenStore, limits: Limits, password: str, host: str, *, insecure: bool = False
) -> str | None:
    """Return the name of an operator who logs in with a token as password; None: not let in.

    As with HTTP, without any token this machine's own user is an operator.
    """
    if limits.locked_out(host):
        return None
    principal = await tokens.principal(password.strip())
    if principal is not None:
        return principal.name if principal.role in OPERATORS else None
    if not await tokens.any() and (insecure or is_loopback(host)):
        return LOCAL_OPERATOR.name
    limits.log_in(password.strip(), host, good=False)
    return None


def _unauthenticated(detail: str) -> ProblemError:
    return ProblemError(
        "unauthenticated",
        detail,
        remedy="Send the header Authorization: Bearer TOKEN; bathyfleet token create makes a token",
        headers={"WWW-Authenticate": 'Bearer realm="bathyfleet"'},
    )


def _is_local(connection: HTTPConnection, state: EdgeState) -> bool:
    """Tell whether the user asks who runs the service, on this machine.

    Under one of its own names, else a foreign page could rebind its name to us; and not by a proxy, which speaks for
    whoever reaches it.
    """
    if any(name in connection.headers for name in _PROXY_HEADERS):
        return False
    if connection.client is None:
        return True  # a Unix socket
    host, port = connection.client
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    if not address.is_loopback or not is_loopback(connection.url.hostname or "localhost"):
        return False
    if any(address in ipaddress.ip_network(proxy) for proxy in state.settings.trusted_proxies):
        return False
    return not is_another_user((host, port), connection.scope.get("server"))


def _check_origin(connection: HTTPConnection, state: EdgeState) -> None:
    """Refuse what a page of another site sends through an operator's browser."""
    origin = connection.headers.get("origin")
    if origin is None or origin in state.settings.allowed_origins:
        return
    if connection.scope["type"] == "http" and connection.scope["method"] in ("GET", "HEAD"):
        return
    if urlsplit(origin).netloc != connection.headers.get("host"):
        raise ProblemError(
            "forbidden",
            "the request comes from a page of another site",
            remedy="Add its origin to allowed_origins in the settings if that is meant",
        )


@dataclass(frozen=True)
class RoleCheck:
    """Lets those ask who have one of ``roles``; a dependency of routes, and asked before their bodies are read."""

    roles: frozenset[Role]
    doing: str

    async def __call__(
        self, connection: HTTPConnection, state: State, _: Annotated[object, Security(_bearer)]
    ) -> Principal:
        """Return who asks."""
        return await self.admit(connection, state)

    async def admit(self, connection: HTTPConnection, state: EdgeState) -> Principal:
        """Return who asks, looked up once for a request. Raises ProblemError (unauthenticated, forbidden)."""
        known: Principal | None = connection.scope.get("state", {}).get("principal")
        principal = known or await authenticate(connection, state)
        if principal.role not in self.roles:
            raise ProblemError(
                "forbidden",
                f"the token {principal.name!r} has role {principal.role}, which may not {self.doing}",
                remedy="Use a token with one of the roles " + ", ".join(sorted(self.roles)),
            )
        return principal


Reader = Annotated[Principal, Depends(RoleCheck(READERS, "look"))]
VehicleOrOperator = Annotated[Principal, Depends(RoleCheck(VEHICLES, "act as a vehicle"))]
Admin = Annotated[Principal, Depends(RoleCheck(ADMINS, "see the audit log"))]
Operator = Annotated[Principal, Depends(RoleCheck(OPERATORS, "command missions"))]


def check_vehicle(principal: Principal, vehicle: str) -> None:
    """Refuse a token that is bound to another vehicle."""
    if principal.vehicle is not None and principal.vehicle != vehicle:
        raise ProblemError(
            "forbidden",
            f"the token {principal.name!r} belongs to vehicle {principal.vehicle!r}, not to {vehicle!r}",
            remedy="Use the token of that vehicle",
        )
