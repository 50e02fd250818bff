"""How often somebody may ask: every client has a bucket of requests, every address one of wrong tokens."""

import ipaddress
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.accounts.processes import comes_from_peer
from app.api.accounts.sessions import session_of
from app.api.accounts.tokens import token_hash
from app.api.http.problems import instance_of, make_problem, problem_response

MAX_CLIENTS = 10_000
"""Of more than these the longest silent is forgotten: no number of addresses may fill the memory."""
BURST_S = 2.0
"""A client that was silent may ask this many seconds' worth of requests at once."""


class Buckets:
    """Token buckets by client, as many as :data:`MAX_CLIENTS`.

    Parameters
    ----------
    per_s
        How fast a bucket fills.
    size
        What it holds.
    clock
        Seconds that never step back.
    """

    def __init__(self, per_s: float, size: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_s = per_s
        self._size = size
        self._clock = clock
        self._filled: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, client: str) -> float:
        """Return how long the client has to wait until its bucket holds one; 0: it does."""
        return max(1.0 - self._level(client), 0.0) / self._per_s

    def take(self, client: str) -> float:
        """Take one out of the client's bucket; where there is none return how long until there is, else 0."""
        level = self._level(client)
        if level < 1.0:
            return (1.0 - level) / self._per_s
        self._filled[client] = (level - 1.0, self._clock())
        self._filled.move_to_end(client)
        if len(self._filled) > MAX_CLIENTS:
            self._filled.popitem(last=False)
        return 0.0

    def _level(self, client: str) -> float:
        level, at = self._filled.get(client, (self._size, self._clock()))
        return min(self._size, level + (self._clock() - at) * self._per_s)


class RequestLimits:
    """What every request is held against; shared by middleware, authentication and the Neptus gateway.

    Parameters
    ----------
    max_requests_per_s
        Of one client; 0: any number.
    max_failed_logins
        A minute from one address.
    """

    def __init__(self, max_requests_per_s: float, max_failed_logins: int) -> None:
        self._requests = (
            Buckets(max_requests_per_s, max(BURST_S * max_requests_per_s, 1.0)) if max_requests_per_s else None
        )
        self._failures = Buckets(max_failed_logins / 60.0, max_failed_logins)
        # Tokens that were valid when last looked at: their holders are served whatever others at their address do.
        self._known: OrderedDict[str, None] = OrderedDict()

    def wait_s(self, token: str | None, host: str) -> tuple[float, str]:
        """Return how long a request has to wait, and why; (0, "") when it may go on."""
        address = network_of(host)
        known = token is not None and token_hash(token) in self._known
        if token is not None and not known:
            wait_s = self._failures.wait_s(address)
            if wait_s > 0.0:
                return wait_s, "too many wrong access tokens came from this address"
        if self._requests is None:
            return 0.0, ""
        wait_s = self._requests.take(token_hash(token) if token is not None and known else address)
        return wait_s, "more requests came than max_requests_per_s allows" if wait_s > 0.0 else ""

    def log_in(self, token: str, host: str, *, good: bool) -> None:
        """Note whether a token that came from ``host`` was good."""
        digest = token_hash(token)
        if not good:
            self._known.pop(digest, None)
            self._failures.take(network_of(host))
            return
        self._known[digest] = None
        self._known.move_to_end(digest)
        if len(self._known) > MAX_CLIENTS:
            self._known.popitem(last=False)

    def locked_out(self, host: str) -> bool:
        """Tell whether so many wrong tokens came from ``host`` that no other one is looked at for now."""
        return self._failures.wait_s(network_of(host)) > 0.0


@lru_cache(maxsize=4096)
def network_of(host: str) -> str:
    """Return whom an address stands for: whoever has an IPv6 address has all those that begin with the same 64 bits."""
    try:
        address = ipaddress.ip_address(host.split("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv6Address):
        if address.ipv4_mapped is not None:
            return str(address.ipv4_mapped)
        return str(ipaddress.ip_network((address, 64), strict=False))
    return str(address)


def token_of(scope: Scope) -> str | None:
    """Return the access token that a request carries, or the secret of its session, if it carries one."""
    return bearer_of(scope) or session_of(scope)


def bearer_of(scope: Scope) -> str | None:
    """Return the access token in a request's header, if there is one."""
    header = Headers(scope=scope).get("authorization", "")
    scheme, _, token = header.partition(" ")
    return token.strip() or None if scheme.lower() == "bearer" else None


def host_of(scope: Scope) -> str:
    """Return the address of whoever asks; empty for a Unix socket."""
    client = scope.get("client")
    return client[0] if client else ""


class LimitMiddleware:
    """Answers 429 to whoever asks too often, before anything else is done for him."""

    def __init__(self, app: ASGIApp, limits: RequestLimits) -> None:
        self.app = app
        self.limits = limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or socket, or say when to come back."""
        # What another process sends on was held against the limits there.
        if scope["type"] not in ("http", "websocket") or comes_from_peer(scope):
            await self.app(scope, receive, send)
            return
        token, host = token_of(scope), host_of(scope)
        wait_s, reason = self.limits.wait_s(token, host)
        if wait_s > 0.0 and token is not None and await scope["app"].state.edge.is_good(token):
            # Its holder has nothing to do with what others at his address have sent.
            self.limits.log_in(token, host, good=True)
            wait_s, reason = self.limits.wait_s(token, host)
        if wait_s == 0.0:
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            # Before it was accepted: the server answers 403.
            await send({"type": "websocket.close", "code": 4429, "reason": reason})
        else:
            seconds = math.ceil(wait_s)
            problem = make_problem(
                "too-many-requests",
                reason,
                instance=instance_of(scope),
                remedy=f"Wait {seconds} s, then ask less often",
            )
            await problem_response(problem, {"Retry-After": str(seconds)})(scope, receive, send)
