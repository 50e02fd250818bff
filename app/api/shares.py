"""Requests and live views at the same time are shared out by user, and some are kept for operators.

An abort has to get through whatever strangers, viewers and vehicles ask for meanwhile.
"""

from collections import Counter
from collections.abc import Hashable

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.auth import OPERATORS, authenticate
from app.api.limits import host_of, network_of, token_of
from app.api.problems import ProblemError, instance_of, make_problem, problem_response
from app.api.state import EdgeState
from app.api.tokens import Principal

SHARE = 4
"""One user, or one address of those who are none, gets one part in so many."""
RESERVE = 8
"""One part in so many is for operators alone."""
RETRY_S = 2


class Shares:
    """Who has how many of a limited number.

    Parameters
    ----------
    most
        At the same time.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._share = max(most // SHARE, 1)
        self._common = max(most - max(most // RESERVE, 1), 1)
        self._of: Counter[Hashable] = Counter()
        self.held = 0

    def has_room(self, who: Hashable, *, operator: bool = False) -> bool:
        """Tell whether one more may be had: by operators as long as there is any, by others within their shares."""
        if operator:
            return self.held < self._most
        return self.held < self._common and self._of[who] < self._share

    def take(self, who: Hashable) -> None:
        """Count one more."""
        self.held += 1
        self._of[who] += 1

    def give_back(self, who: Hashable) -> None:
        """Count one less."""
        self.held -= 1
        self._of[who] -= 1
        if not self._of[who]:
            del self._of[who]


class ShareMiddleware:
    """Answers 503 to whoever has his share of requests open, or when only those for operators are left."""

    def __init__(self, app: ASGIApp, shares: Shares) -> None:
        self.app = app
        self.shares = shares

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or live view, or say that there are too many."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        edge: EdgeState = scope["app"].state.edge
        token = token_of(scope)
        principal = edge.tokens.known(token) if token is not None else None
        who: Hashable = principal or network_of(host_of(scope))
        room = self.shares.has_room(who, operator=_is_operator(principal))
        if not room and principal is None:
            # Only now it is worth while to look closer.
            principal = await _principal(scope, edge)
            who = principal or who
            room = self.shares.has_room(who, operator=_is_operator(principal))
        if not room:
            await _refuse(scope, receive, send)
            return
        self.shares.take(who)
        try:
            await self.app(scope, receive, send)
        finally:
            self.shares.give_back(who)


def _is_operator(principal: Principal | None) -> bool:
    return principal is not None and principal.role in OPERATORS


async def _principal(scope: Scope, edge: EdgeState) -> Principal | None:
    """Return who asks, as far as that can be told at a cost that has a bound."""
    token = token_of(scope)
    if token is not None and not await edge.is_good(token):
        return None
    try:
        return await authenticate(HTTPConnection(scope), edge)
    except ProblemError:
        return None


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    reason = "as many requests are open as one user, or all but operators, may have at a time"
    if scope["type"] == "websocket":
        # Before it was accepted: the server answers 403.
        await send({"type": "websocket.close", "code": 4429, "reason": reason})
        return
    remedy = f"Close some, or wait {RETRY_S} s; the number is max_connections in the settings"
    problem = make_problem("too-many-connections", reason, instance=instance_of(scope), remedy=remedy)
    await problem_response(problem, {"Retry-After": str(RETRY_S), "Connection": "close"})(scope, receive, send)
