"""Who may ask for what: access tokens, roles, and the local operator while there are no tokens."""

import asyncio
import ipaddress
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Security
from fastapi.security import HTTPBearer
from starlette.requests import HTTPConnection

from app.api.accounts.peers import OWN_USER
from app.api.accounts.processes import vouched_for
from app.api.accounts.rates import RequestLimits, host_of
from app.api.accounts.roles import Role
from app.api.accounts.sessions import check_own_page, session_of
from app.api.accounts.tokens import LOCAL_OPERATOR, Principal, TokenStore
from app.api.http.links import key_prefix
from app.api.http.problems import ProblemError
from app.api.state import EdgeState, State
from app.settings import is_loopback

RECHECK_S = 15.0
"""How long a live view may outlast its token."""

# Only for the OpenAPI document: the header itself is read below, so that problems are answered our way.
_bearer = HTTPBearer(
    auto_error=False,
    scheme_name="token",
    description="A token made by `bathyfleet token create`. Needed as soon as one token exists.",
)

_PROXY_HEADERS = frozenset(
    (
        *("forwarded", "forwarded-for", "via", "proxy-connection", "front-end-https", "x-real-ip", "x-client-ip"),
        *("x-cluster-client-ip", "x-remote-addr", "x-remote-ip", "true-client-ip", "cdn-loop", "fastly-client-ip"),
        *("fly-client-ip", "x-appengine-user-ip", "x-originating-ip", "x-scheme", "x-url-scheme", "x-nginx-proxy"),
        *("x-varnish", "x-bluecoat-via"),
    )
)
_PROXY_PREFIXES = (
    *("x-forwarded", "x-original-", "x-proxy", "x-proxied", "x-envoy-", "x-amz", "x-azure-", "x-arr-", "cf-"),
)
"""What reverse proxies, load balancers and content networks add; names are compared in lower case."""

READERS = frozenset(Role)
ADMINS = frozenset({Role.ADMIN})
OPERATORS = frozenset({Role.OPERATOR, Role.ADMIN})
VEHICLES = OPERATORS | {Role.VEHICLE}


async def authenticate(connection: HTTPConnection, state: EdgeState) -> Principal:
    """Return who asks: by a token in the header, by a browser's session, or on this machine without either.

    Raises ProblemError (unauthenticated, forbidden).
    """
    principal = vouched_for(connection.scope)
    if principal is not None:
        # Another process has looked at him; he is for this one who he is there, and no more.
        return _remember(connection, principal)
    _check_origin(connection, state)
    token = None
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
        if key_prefix(connection.scope) and principal.role is not Role.VIEWER:
            raise ProblemError(
                "forbidden",
                f"the token {principal.name!r} has role {principal.role}, which is too much for an address",
                remedy="Make one for this: bathyfleet token create NAME --role viewer",
            )
        return _remember(connection, principal)
    signed_in = await _signed_in(connection, state)
    if signed_in is not None:
        return _remember(connection, signed_in)
    if await state.tokens.any():
        ended = "the browser's session has ended" if session_of(connection.scope) else ""
        raise _unauthenticated(ended or "the request carries no access token")
    if state.settings.insecure or _is_local(connection, state):
        return _remember(connection, LOCAL_OPERATOR)
    raise ProblemError(
        "forbidden",
        "without access tokens only the user of this machine who runs the service may use it, and not by a proxy",
        remedy="Use the token in operator.token beside the database, or make one on the machine of the service: "
        "bathyfleet token create NAME --role operator",
    )


async def _signed_in(connection: HTTPConnection, state: EdgeState) -> Principal | None:
    """Return who signed in with this browser; a session that has ended is like none. Raises ProblemError."""
    secret = session_of(connection.scope)
    principal = await state.sessions.principal(secret) if secret is not None else None
    if secret is None or principal is None:
        return None
    check_own_page(connection)
    state.limits.log_in(secret, host_of(connection.scope), good=True)
    return principal


def _remember(connection: HTTPConnection, principal: Principal) -> Principal:
    """Keep with the request who asks, for the audit log."""
    connection.scope.setdefault("state", {})["principal"] = principal
    return principal


async def until_unwelcome(connection: HTTPConnection, state: EdgeState) -> None:
    """Return when whoever listens may not any more: token or session was ended or has run out."""
    while True:
        await asyncio.sleep(RECHECK_S)
        try:
            await authenticate(connection, state)
        except ProblemError:
            return


async def console_log_in(
    tokens: TokenStore, limits: RequestLimits, password: str, host: str, *, own_user: bool, insecure: bool = False
) -> str | None:
    """Return the name of an operator who logs in with a token as password; None: not let in.

    As with HTTP, without any token the user who runs the service is an operator: ``own_user`` is what
    :func:`app.api.accounts.peers.is_own_user` said of his connection when it was accepted.
    """
    if limits.locked_out(host) and not await tokens.exists(password.strip()):
        return None
    principal = await tokens.principal(password.strip())
    if principal is not None:
        return principal.name if principal.role in OPERATORS else None
    if not await tokens.any() and (insecure or own_user):
        return LOCAL_OPERATOR.name
    limits.log_in(password.strip(), host, good=False)
    return None


def _unauthenticated(detail: str) -> ProblemError:
    return ProblemError(
        "unauthenticated",
        detail,
        remedy="Send the header Authorization: Bearer TOKEN, or sign in on the page; bathyfleet token create makes one",
        headers={"WWW-Authenticate": 'Bearer realm="bathyfleet"'},
    )


def _is_local(connection: HTTPConnection, state: EdgeState) -> bool:
    """Tell whether the user asks who runs the service, on this machine.

    He is known from his connection, see :func:`app.api.accounts.peers.is_own_user`. Under one of the service's own
    names, else a foreign page could rebind its name to us; and not by a proxy, which speaks for whoever reaches it.
    """
    if any(name in _PROXY_HEADERS or name.startswith(_PROXY_PREFIXES) for name in connection.headers):
        return False
    if not connection.scope.get("state", {}).get(OWN_USER, False):
        return False
    if not is_loopback(connection.url.hostname or "localhost"):
        return False
    if connection.client is None:
        return True  # a Unix socket
    try:
        address = ipaddress.ip_address(connection.client[0])
    except ValueError:
        return False
    return not any(address in ipaddress.ip_network(proxy) for proxy in state.settings.trusted_proxies)


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
