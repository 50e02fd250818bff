"""Speaking to the other processes that share the database, in the name of whoever asked this one."""

import asyncio
import secrets
import ssl
from collections.abc import Iterable, Mapping
from typing import Any

import httpx
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import Scope

from app.missions.ownership import Peer

PEER = "x-bathyfleet-peer"
"""Header with the secret of the process that is asked: then the two below count."""
FOR, HOST = "x-bathyfleet-for", "x-bathyfleet-host"
"""Headers that tell who asked, and under which name of the service."""

_OF_ONE_CONNECTION = frozenset(
    "connection host keep-alive proxy-authenticate proxy-authorization te trailer transfer-encoding upgrade "
    f"sec-websocket-key sec-websocket-version sec-websocket-extensions content-length {PEER} {FOR} {HOST}".split()
)
"""Headers that are not sent on."""

CONNECT_S = 2.0


def recognise(scope: Scope, secret: str) -> None:
    """Believe what a request says of who asked, if another process sent it; else take such words out of it."""
    headers = MutableHeaders(scope=scope)
    given, asker, host = headers.get(PEER), headers.get(FOR), headers.get(HOST)
    for name in (PEER, FOR, HOST):
        del headers[name]
    # As bytes: a stranger may send what is not ASCII.
    if given is None or not secrets.compare_digest(given.encode(), secret.encode()):
        return
    scope.setdefault("state", {})["peer"] = True
    scope["client"] = (asker, 0) if asker else None
    if host:
        headers["host"] = host


def comes_from_peer(scope: Mapping[str, Any]) -> bool:
    """Tell whether another process sent a request on: it is answered here, whatever becomes of it."""
    return bool(scope.get("state", {}).get("peer", False))


def end_to_end(headers: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return those headers that are not about one connection only."""
    return [(name, value) for name, value in headers if name.lower() not in _OF_ONE_CONNECTION]


def headers_for(peer: Peer, scope: Scope) -> list[tuple[str, str]]:
    """Return the headers with which a request is sent on."""
    headers = Headers(scope=scope)
    client = scope.get("client")
    own = [(PEER, peer.secret), (HOST, headers.get("host", ""))]
    own += [(FOR, client[0])] if client else []
    own += [("x-request-id", scope.get("state", {}).get("request_id", ""))]
    return [*((name, value) for name, value in end_to_end(headers.items()) if name != "x-request-id"), *own]


def tls_of(peer: Peer) -> ssl.SSLContext | None:
    """Return how a process that serves TLS is recognised: by its very certificate, which the database vouches for."""
    if not peer.url.startswith("https:"):
        return None
    context = ssl.create_default_context(cadata=peer.certificate)
    context.check_hostname = peer.certificate is None
    return context


class PeerClients:
    """Kept-alive connections to the other processes."""

    def __init__(self) -> None:
        self._clients: dict[Peer, httpx.AsyncClient] = {}

    def to(self, peer: Peer) -> httpx.AsyncClient:
        """Return the client for a process. Answers may take their time: some wait for a waypoint, some never end."""
        if peer not in self._clients:
            self._clients[peer] = httpx.AsyncClient(
                base_url=peer.url,
                verify=tls_of(peer) or False,
                timeout=httpx.Timeout(None, connect=CONNECT_S),
                limits=httpx.Limits(max_connections=None, max_keepalive_connections=50),
                trust_env=False,
            )
        return self._clients[peer]

    async def close(self) -> None:
        """Close every connection."""
        await asyncio.gather(*(client.aclose() for client in self._clients.values()))
        self._clients.clear()
