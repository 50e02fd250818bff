"""Requests and live views at the same time are shared out by user, and some are kept for operators.

An abort has to get through whatever strangers, viewers and vehicles ask for meanwhile.
"""

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.access.auth import authenticate
from app.api.accounts.quotas import Shares, holder_of
from app.api.accounts.rates import host_of, network_of, token_of
from app.api.accounts.tokens import Principal
from app.api.http.problems import ProblemError, instance_of, make_problem, problem_response
from app.api.state import EdgeState

RETRY_S = 2
MOST_LOOKED_UP = 1
"""Unknown tokens at a time: all tokens that were made before are read with each."""


class ShareMiddleware:
    """Answers 503 to whoever has his share of requests open, or when only those for operators are left."""

    def __init__(self, app: ASGIApp, shares: Shares) -> None:
        self.app = app
        self.shares = shares
        self._looking = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or live view, or say that there are too many."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        edge: EdgeState = scope["app"].state.edge
        token, network = token_of(scope), network_of(host_of(scope))
        who = holder_of(edge.tokens.known(token) if token is not None else None, network)
        if not self.shares.has_room(who) and isinstance(who, str):
            # Only now it is worth while to look closer.
            who = holder_of(await self._principal(scope, edge), network)
        if not self.shares.has_room(who):
            await _refuse(scope, receive, send)
            return
        self.shares.take(who)
        try:
            await self.app(scope, receive, send)
        finally:
            self.shares.give_back(who)

    async def _principal(self, scope: Scope, edge: EdgeState) -> Principal | None:
        """Return who asks, as far as that can be told at a cost that has a bound."""
        token = token_of(scope)
        if token is not None:
            # Who waits has a connection as well. A new token that finds no room here is known at its second try.
            if self._looking >= MOST_LOOKED_UP:
                return None
            self._looking += 1
            try:
                if not await edge.is_good(token):
                    return None
            finally:
                self._looking -= 1
        try:
            return await authenticate(HTTPConnection(scope), edge)
        except ProblemError:
            return None


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    reason = "as many requests are open as one user, or all but operators, may have at a time"
    if scope["type"] == "websocket":
        # Unless it was accepted first the server would answer 403, which tells of rights.
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 4429, "reason": reason})
        return
    remedy = f"Close some, or wait {RETRY_S} s; the number is max_connections in the settings"
    problem = make_problem("too-many-connections", reason, instance=instance_of(scope), remedy=remedy)
    await problem_response(problem, {"Retry-After": str(RETRY_S), "Connection": "close"})(scope, receive, send)
