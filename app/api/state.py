"""What the routes share: the mission service, the tokens, the settings and the count of open streams."""

import asyncio
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated, Any

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.api.accounts.audit_log import AuditLog
from app.api.accounts.processes import PeerClients
from app.api.accounts.quotas import Shares, holder_of
from app.api.accounts.rates import RequestLimits, host_of, network_of
from app.api.accounts.sessions import SessionStore
from app.api.accounts.tokens import TokenStore
from app.api.http.problems import ProblemError
from app.api.metrics import LIVE_VIEWERS
from app.missions.service import MissionService
from app.settings import Settings

REPLAYS_AT_ONCE = 2


@dataclass
class EdgeState:
    """Shared by every request; made once when the application starts.

    Attributes
    ----------
    stopping
        Set when the process was asked to end: streams and long polls finish then instead of holding it up.
    run_id
        Differs between runs of the process, whose map versions all begin at 1.
    replays
        Pages of old log entries that are written at a time: many streams that open at once take turns, so that other
        requests come between them.
    """

    settings: Settings
    service: MissionService
    tokens: TokenStore
    limits: RequestLimits
    audit: AuditLog
    sessions: SessionStore
    stopping: asyncio.Event = field(default_factory=asyncio.Event)
    run_id: str = field(default_factory=lambda: secrets.token_hex(4))
    peers: PeerClients = field(default_factory=PeerClients)
    replays: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(REPLAYS_AT_ONCE))
    streams: Shares = field(init=False)

    def __post_init__(self) -> None:
        """Share the live views out."""
        self.streams = Shares(self.settings.max_streams)

    async def is_good(self, token: str) -> bool:
        """Tell whether a token, or a session's secret, that a request carries may be valid."""
        return await self.tokens.exists(token) or await self.sessions.principal(token) is not None

    @contextmanager
    def stream(self, kind: str, connection: HTTPConnection) -> Iterator[None]:
        """Count a live view (``websocket``) or event stream (``sse``). Raises ProblemError above the limits."""
        who = holder_of(connection.scope.get("state", {}).get("principal"), network_of(host_of(connection.scope)))
        if not self.streams.has_room(who):
            raise ProblemError(
                "too-many-streams",
                f"{self.streams.held} live views and event streams are open, as many as max_streams allows "
                "all together or this user",
                remedy="Close some, or raise max_streams in the settings",
                headers={"Retry-After": "10"},
            )
        self.streams.take(who)
        LIVE_VIEWERS.labels(kind).inc()
        try:
            yield
        finally:
            self.streams.give_back(who)
            LIVE_VIEWERS.labels(kind).dec()


def edge_state(connection: HTTPConnection) -> EdgeState:
    """The state of the application that serves this connection."""
    state: EdgeState = connection.app.state.edge
    return state


# As coroutines: what is no coroutine is called in a thread, with every request.
async def _state(connection: HTTPConnection) -> EdgeState:
    return edge_state(connection)


async def _service(connection: HTTPConnection) -> MissionService:
    return edge_state(connection).service


AT_HAND: dict[Callable[..., Any], Callable[[EdgeState], Any]] = {
    _state: lambda edge: edge,
    _service: lambda edge: edge.service,
}
"""What the dependencies return, for whoever has the state already."""

State = Annotated[EdgeState, Depends(_state)]
Service = Annotated[MissionService, Depends(_service)]
