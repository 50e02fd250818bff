"""Signing in from a browser: the access token is exchanged for a cookie that no script can read.

The cookie holds a secret of its own, of which only the hash is stored, bound to the token. It ends with the token, with
signing out, or after :data:`SESSION_DAYS`.
"""

import secrets
from datetime import UTC, datetime, timedelta

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection, cookie_parser
from starlette.responses import Response
from starlette.types import Scope

from app.api.accounts.roles import Role
from app.api.accounts.tokens import Principal, token_hash
from app.api.http.problems import ProblemError
from app.storage.database import Database
from app.storage.fast_read import AtOnce
from app.storage.models import SessionRow
from app.storage.queries import sessions

SESSION_DAYS = 30
_COOKIE = "bathyfleet-session"
_SECRET_BYTES = 32


class SessionStore:
    """The sessions in the database."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._at_once = AtOnce(database)

    async def begin(self, token: str) -> str:
        """Return the secret of a new session for the holder of a valid token."""
        secret = secrets.token_urlsafe(_SECRET_BYTES)
        begins = datetime.now(UTC)
        row = SessionRow(
            secret_hash=token_hash(secret),
            token_hash=token_hash(token),
            created_at=begins,
            expires_at=begins + timedelta(days=SESSION_DAYS),
        )
        async with self._database.writing() as session:
            await sessions.forget(session, begins)
            session.add(row)
        return secret

    async def end(self, secret: str) -> None:
        """End a session; nothing happens when there is none."""
        async with self._database.writing() as session:
            await sessions.end(session, token_hash(secret))

    async def principal(self, secret: str) -> Principal | None:
        """Return who signed in; None when the session or its token has ended."""
        found = await self._at_once(sessions.VALID, {"hash": token_hash(secret), "now": datetime.now(UTC)})
        if not found:
            return None
        name, role, vehicle = found[0]
        return Principal(name, Role(role), vehicle)

    def close(self) -> None:
        """Let go of the database."""
        self._at_once.close()


def session_of(scope: Scope) -> str | None:
    """Return the secret of the session whose cookie a request carries, if it carries one."""
    headers = Headers(scope=scope)
    return cookie_parser(headers.get("cookie", "")).get(_cookie_name(headers)) or None


def check_own_page(connection: HTTPConnection) -> None:
    """Refuse what a browser was made to send with the cookie by anything but the service's own page.

    A cookie goes along whoever makes the browser ask, so everything but reading has to say where it comes from. An
    Origin was compared with the service's own before this is asked. Raises ProblemError.
    """
    if connection.scope["type"] == "http" and connection.scope["method"] in ("GET", "HEAD"):
        return
    if "origin" in connection.headers or connection.headers.get("sec-fetch-site") == "same-origin":
        return
    raise ProblemError(
        "forbidden",
        "the request is signed in by a cookie but does not say which page it comes from",
        remedy="Programs send the header Authorization: Bearer TOKEN instead of the browser's cookie",
    )


def give_cookie(response: Response, connection: HTTPConnection, secret: str) -> None:
    """Let the browser keep a session: for this service alone, out of reach of scripts."""
    response.set_cookie(
        _cookie_name(connection.headers),
        secret,
        max_age=SESSION_DAYS * 86_400,
        path="/",
        httponly=True,
        samesite="strict",
        secure=connection.url.scheme in ("https", "wss"),
    )


def take_cookie(response: Response, connection: HTTPConnection) -> None:
    """Let the browser forget its session."""
    response.delete_cookie(
        _cookie_name(connection.headers),
        path="/",
        httponly=True,
        samesite="strict",
        secure=connection.url.scheme in ("https", "wss"),
    )


def _cookie_name(headers: Headers) -> str:
    """Return the cookie's name: browsers keep one jar for all ports of a host, on which several services may run."""
    _, _, port = headers.get("host", "").rpartition(":")
    return f"{_COOKIE}-{port}" if port.isdigit() else _COOKIE
