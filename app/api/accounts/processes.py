"""Speaking to the other processes that share the database, in the name of whoever asked this one.

A request that is sent on says who asked, as this process has found out, and with which role. That is signed, together
with what is asked for, with the secret of the process that it goes to, which only the database knows; each signature
counts once. So nobody who sees such a request can make another one of it.
"""

import asyncio
import hashlib
import hmac
import itertools
import json
import secrets
import ssl
from collections import OrderedDict
from collections.abc import AsyncIterator, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote_plus

import httpx
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import Scope

from app.api.accounts.roles import Role
from app.api.accounts.tokens import Principal
from app.certificates import trusting
from app.missions.running.ownership import Peer

PEER = "x-bathyfleet-peer"
"""Header with who sent a request on, its number there and the signature: ``SENDER.NUMBER.SIGNATURE``."""
PRINCIPAL, FOR, HOST = "x-bathyfleet-principal", "x-bathyfleet-for", "x-bathyfleet-host"
"""Headers that tell who asked, from where, and under which name of the service; the signature covers them."""

_OF_ONE_CONNECTION = frozenset(
    "connection host keep-alive proxy-authenticate proxy-authorization te trailer transfer-encoding upgrade "
    f"sec-websocket-key sec-websocket-version sec-websocket-extensions content-length {PEER} {PRINCIPAL} {FOR} "
    f"{HOST}".split()
)
"""Headers that are not sent on."""
_TOKENS = frozenset(("authorization", "cookie"))
"""Headers that this process has looked at; no other one needs them."""

CONNECT_S = 2.0
WINDOW = 4096
"""A request may be overtaken by so many others of its sender; an older one is not believed any more."""
MAX_SENDERS = 256


@dataclass
class _Came:
    newest: int = 0
    numbers: set[int] = field(default_factory=set)


class Deliveries:
    """Numbers of requests that came from other processes, of which none may come twice."""

    def __init__(self) -> None:
        self._senders: OrderedDict[str, _Came] = OrderedDict()

    def first(self, sender: str, number: int) -> bool:
        """Note a number; False when it came before, or is so old that nobody knows."""
        came = self._senders.setdefault(sender, _Came())
        self._senders.move_to_end(sender)
        if number in came.numbers or number <= came.newest - WINDOW:
            return False
        came.numbers.add(number)
        came.newest = max(came.newest, number)
        if len(came.numbers) > 2 * WINDOW:
            came.numbers = {one for one in came.numbers if one > came.newest - WINDOW}
        if len(self._senders) > MAX_SENDERS:
            self._senders.popitem(last=False)
        return True


def recognise(scope: Scope, secret: str, deliveries: Deliveries) -> bool:
    """Believe what a request says of who asked, if another process sent it; False: it claims so, and it is not true."""
    headers = MutableHeaders(scope=scope)
    given = {name: headers.get(name) for name in (PEER, PRINCIPAL, FOR, HOST)}
    for name in given:
        del headers[name]
    shown, host = given[PEER], given[HOST]
    if shown is None:
        return True
    sender, _, rest = shown.partition(".")
    number, _, signature = rest.partition(".")
    wanted = _signature(secret, _method(scope), target_of(scope), given, f"{sender}.{number}")
    # As bytes: a stranger may send what is not ASCII.
    if not hmac.compare_digest(signature.encode(), wanted.encode()) or not deliveries.first(sender, int(number)):
        return False
    state = scope.setdefault("state", {})
    state["vouched"] = _read(given[PRINCIPAL] or "")
    scope["client"] = (given[FOR], 0) if given[FOR] else None
    if host:
        headers["host"] = host
    return True


def vouched_for(scope: Mapping[str, Any]) -> Principal | None:
    """Return who asked another process, which sent the request on; None: it came from nobody else."""
    found: Principal | None = scope.get("state", {}).get("vouched")
    return found


def comes_from_peer(scope: Mapping[str, Any]) -> bool:
    """Tell whether another process sent a request on: it is answered here, whatever becomes of it."""
    return vouched_for(scope) is not None


def end_to_end(headers: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return those headers that are not about one connection only."""
    return [(name, value) for name, value in headers if name.lower() not in _OF_ONE_CONNECTION]


def target_of(scope: Mapping[str, Any]) -> str:
    """Return the path and the query of a request, as they were sent."""
    path = (scope.get("raw_path") or scope["path"].encode()).split(b"?")[0]
    query = scope.get("query_string", b"")
    return str((path + (b"?" + query if query else b"")).decode("latin-1"))


def target_without_token(scope: Mapping[str, Any]) -> str:
    """Return path and query of a request without the access token that browsers' sockets carry there."""
    path, _, query = target_of(scope).partition("?")
    kept = [pair for pair in query.split("&") if pair and unquote_plus(pair.partition("=")[0]) != "token"]
    return path + ("?" + "&".join(kept) if kept else "")


def tls_of(peer: Peer) -> ssl.SSLContext | None:
    """Return how a process that serves TLS is recognised: by its very certificate, which the database vouches for."""
    if not peer.url.startswith("https:"):
        return None
    return ssl.create_default_context() if peer.certificate is None else trusting(peer.certificate)


class PeerClients:
    """Kept-alive connections to the other processes, and the signatures of what is sent there."""

    def __init__(self) -> None:
        self._clients: dict[Peer, httpx.AsyncClient] = {}
        self._name = secrets.token_hex(16)
        self._numbers = itertools.count(1)

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

    def request(
        self,
        peer: Peer,
        scope: Scope,
        target: str,
        content: AsyncIterator[bytes] | bytes = b"",
        length: int = 0,
        **options: Any,
    ) -> httpx.Request:
        """Return a request that asks a process for ``target`` in the name of whoever asked this one.

        ``length`` is how many bytes ``content`` has.
        """
        url = httpx.URL(peer.url + target)
        # Signed as it goes out: the library may write some characters of the target in another way.
        headers = self.headers(peer, scope, url.raw_path.decode("latin-1"))
        encoded = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers]
        if length:
            encoded.append((b"content-length", str(length).encode()))
        return self.to(peer).build_request(scope["method"], url, headers=encoded, content=content, **options)

    def headers(self, peer: Peer, scope: Scope, target: str) -> list[tuple[str, str]]:
        """Return the headers with which a request that was authenticated here is sent on, once."""
        headers = Headers(scope=scope)
        client = scope.get("client")
        principal: Principal = scope["state"]["principal"]
        said = {PRINCIPAL: _written(principal), FOR: client[0] if client else None, HOST: headers.get("host", "")}
        number = f"{self._name}.{next(self._numbers)}"
        signature = _signature(peer.secret, _method(scope), target, said, number)
        own = [(name, value) for name, value in said.items() if value is not None]
        own += [(PEER, f"{number}.{signature}"), ("x-request-id", scope["state"].get("request_id", ""))]
        passed = [(name, value) for name, value in end_to_end(headers.items()) if name not in _TOKENS]
        return [*((name, value) for name, value in passed if name != "x-request-id"), *own]

    async def close(self) -> None:
        """Close every connection."""
        await asyncio.gather(*(client.aclose() for client in self._clients.values()))
        self._clients.clear()


def _method(scope: Mapping[str, Any]) -> str:
    return str(scope.get("method", "GET"))  # a socket is opened by a GET


def _signature(secret: str, method: str, target: str, said: Mapping[str, str | None], number: str) -> str:
    signed = json.dumps([method, target, said[PRINCIPAL], said[FOR], said[HOST], number])
    return hmac.new(secret.encode(), signed.encode(), hashlib.sha256).hexdigest()


def _written(principal: Principal) -> str:
    return json.dumps([principal.name, principal.role.value, principal.vehicle])


def _read(principal: str) -> Principal:
    name, role, vehicle = json.loads(principal)
    return Principal(name, Role(role), vehicle)
