"""Requests and live views of a mission that another process has are sent on to it; when it ended, to its successor."""

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator
from types import SimpleNamespace

import httpx
import structlog
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from app.api.access.auth import authenticate, until_unwelcome
from app.api.accounts.processes import Deliveries, comes_from_peer, end_to_end, recognise, target_without_token, tls_of
from app.api.bodies.admission import READING
from app.api.http import close_codes
from app.api.http.first_completed import first_of
from app.api.http.problems import ProblemError, instance_of, make_problem, problem_response
from app.api.http.spool import Spool, spool_folder
from app.api.schemas import API
from app.api.state import EdgeState
from app.missions.running.ownership import Peer

_OF_A_MISSION = re.compile(rf"^{API}/missions/([0-9a-f]{{8}}-[0-9a-f-]{{27}})(?:/(?!tiles/[a-z]+\.json$)|$)")
"""A layer's TileJSON is answered by whoever is asked: it holds that process's address, and the key."""

TAKEOVER_S = 10.0
"""How long a request waits for a mission whose process ended to be taken up by another one."""
RETRY_S = 0.2

MISDIRECTED = 421
"""What a process answers that does not have the mission (any more)."""
NO_CODE = (1005, 1006)
"""Codes of a WebSocket's end that may not be sent."""

_OUR_OWN = frozenset(("date", "server", "x-request-id", "x-content-type-options"))
"""Headers of answers that this process sets itself."""

_SAME_ADDRESS = (
    "the mission is another process's, which has the same address as this one",
    "Give each process a peer_url or a port of its own; a process that ended is noticed within seconds",
)

_ROUTE = SimpleNamespace(path=f"{API}/missions/{{mission_id}} (sent on)")

log = structlog.get_logger(__name__)


class PeerMiddleware:
    """Tells requests of other processes from those of strangers, before anything is made of them."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app
        self._deliveries = Deliveries()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or live view; whoever claims to be a process and cannot show it is told only that."""
        if scope["type"] not in ("http", "websocket") or recognise(
            scope, scope["app"].state.edge.service.process.secret, self._deliveries
        ):
            await self.app(scope, receive, send)
            return
        await _misdirect(scope, receive, send, "it was sent on by a process that does not know this one")


class ForwardingMiddleware:
    """Answers what concerns this process's missions here, and lets their owners answer the rest."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or live view."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        edge: EdgeState = scope["app"].state.edge
        found = _OF_A_MISSION.match(scope["path"])
        peer = await edge.service.process.owner(found[1]) if found else None
        if found is None or peer is None or not _is_of_a_route(scope):
            await self.app(scope, receive, send)
        elif comes_from_peer(scope):
            # Sent on once is enough: whoever sent it looks again where the mission is.
            await _misdirect(scope, receive, send, "it is another process's now")
        elif not await _is_known(edge, scope):
            # Our own word for whoever may not ask; nobody is vouched for who was not looked at.
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await _send_view_on(edge, peer, scope, receive, send)
        else:
            scope["route"] = _ROUTE
            scope["state"]["sent_on"] = True
            with contextlib.closing(Spool(spool_folder(edge.settings.database_url))) as body:
                if "intake" in scope:
                    await body.fill(receive)
                await self._send_on(edge, found[1], body, scope, receive, send)

    async def _send_on(
        self, edge: EdgeState, mission_id: str, body: Spool, scope: Scope, receive: Receive, send: Send
    ) -> None:
        loop = asyncio.get_running_loop()
        deadline_s = loop.time() + TAKEOVER_S
        while loop.time() < deadline_s:
            peer = await edge.service.process.owner(mission_id)
            if peer is None:
                await self.app(scope, body.replayed(receive) if "intake" in scope else receive, send)
                return
            if peer.url == edge.service.process.url:
                await _refuse(scope, receive, send, *_SAME_ADDRESS)
                return
            try:
                async with _asked(edge, peer, scope, body) as answer:
                    if answer.status_code != MISDIRECTED:
                        await _relay(edge, answer, scope, receive, send)
                        return
            except (httpx.ConnectError, httpx.ConnectTimeout):
                log.warning("the process that has the mission is not there", url=peer.url, mission=mission_id)
            except httpx.TransportError as error:
                if scope["method"] not in ("GET", "HEAD"):
                    await _refuse(
                        scope,
                        receive,
                        send,
                        f"the process that has the mission broke off ({type(error).__name__}): "
                        "perhaps it did what was asked, perhaps not",
                        "See how the mission stands, then ask again; measurements with an Idempotency-Key may be "
                        "sent again at once",
                    )
                    return
            edge.service.process.called.set()
            await asyncio.sleep(RETRY_S)
        await _refuse(
            scope,
            receive,
            send,
            f"the process that had the mission does not answer, and none took it up within {TAKEOVER_S:g} s",
            "Ask again in a moment; see whether a process runs that reaches the mission's vehicles",
        )


def _is_of_a_route(scope: Scope) -> bool:
    """Tell whether there is such a route: the body of a request that may change something was let in for one only."""
    return scope["type"] == "websocket" or scope["method"] in READING or "intake" in scope


async def _is_known(edge: EdgeState, scope: Scope) -> bool:
    try:
        await authenticate(HTTPConnection(scope), edge)
    except ProblemError:
        return False
    return True


@contextlib.asynccontextmanager
async def _asked(edge: EdgeState, peer: Peer, scope: Scope, body: Spool) -> AsyncIterator[httpx.Response]:
    content = body.parts() if body.size else b""
    request = edge.peers.request(peer, scope, target_without_token(scope), content, body.size)
    answer = await edge.peers.to(peer).send(request, stream=True)
    try:
        yield answer
    finally:
        await answer.aclose()


async def _relay(edge: EdgeState, answer: httpx.Response, scope: Scope, receive: Receive, send: Send) -> None:
    headers = [(name, value) for name, value in end_to_end(answer.headers.multi_items()) if name not in _OUR_OWN]
    length = answer.headers.get("content-length")
    if length is not None:
        headers.append(("content-length", length))
    await send(
        {
            "type": "http.response.start",
            "status": answer.status_code,
            "headers": [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers],
        }
    )
    try:
        # The process that has the mission takes our word for who asks: we have to notice when that ends.
        unwelcome = until_unwelcome(HTTPConnection(scope), edge)
        ended = await first_of(_pump_answer(answer, send), _until_left(receive), unwelcome)
    except httpx.TransportError as error:
        if length is not None:
            raise ConnectionResetError("the process that has the mission broke off within its answer") from error
        # A stream: its reader connects anew and goes on after the last event it has.
        ended = 0
    if ended == 2 and length is not None:
        raise ConnectionResetError("the access token ended within an answer")
    if ended != 1:
        await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _pump_answer(answer: httpx.Response, send: Send) -> None:
    async for part in answer.aiter_raw():
        await send({"type": "http.response.body", "body": part, "more_body": True})


async def _until_left(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass


async def _misdirect(scope: Scope, receive: Receive, send: Send, detail: str) -> None:
    """Say that this process is not the one that is meant."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": close_codes.TRY_AGAIN, "reason": detail})
        return
    answer = problem_response(make_problem("mission-elsewhere", detail, instance=instance_of(scope)))
    answer.status_code = MISDIRECTED
    await answer(scope, receive, send)


async def _refuse(scope: Scope, receive: Receive, send: Send, detail: str, remedy: str) -> None:
    problem = make_problem("mission-elsewhere", detail, instance=instance_of(scope), remedy=remedy)
    await problem_response(problem, {"Retry-After": "1"})(scope, receive, send)


async def _send_view_on(edge: EdgeState, peer: Peer, scope: Scope, receive: Receive, send: Send) -> None:
    """Show a live view of another process; when that ends, the viewer asks again and finds its successor."""
    assert (await receive())["type"] == "websocket.connect"  # noqa: S101 - the protocol's first message
    target = target_without_token(scope)
    try:
        if peer.url == edge.service.process.url:
            raise OSError(_SAME_ADDRESS[0])
        async with connect(
            peer.url.replace("http", "ws", 1) + target,
            ssl=tls_of(peer),
            subprotocols=[Subprotocol(name) for name in scope.get("subprotocols", ())] or None,
            additional_headers=[
                (name, value)
                for name, value in edge.peers.headers(peer, scope, target)
                if name != "sec-websocket-protocol"
            ],
            origin=None,
            max_size=None,
            compression=None,
            open_timeout=TAKEOVER_S,
            proxy=None,
        ) as upstream:
            await send({"type": "websocket.accept", "subprotocol": upstream.subprotocol})
            ended = await first_of(
                _pump_down(upstream, send),
                _pump_up(upstream, receive),
                edge.stopping.wait(),
                until_unwelcome(HTTPConnection(scope), edge),
            )
            code = upstream.close_code or close_codes.TRY_AGAIN
            reason = upstream.close_reason or ""
            if ended == 3:
                code, reason = close_codes.UNAUTHENTICATED, "the access token is not valid any more"
    except (OSError, TimeoutError, InvalidHandshake) as error:
        log.warning("live view cannot be had from another process", url=peer.url, error=str(error))
        await send({"type": "websocket.accept"})
        code, reason = close_codes.TRY_AGAIN, "the process that has the mission does not answer: reconnect"
    with contextlib.suppress(RuntimeError, OSError):
        await send(
            {"type": "websocket.close", "code": close_codes.TRY_AGAIN if code in NO_CODE else code, "reason": reason}
        )


async def _pump_down(upstream: ClientConnection, send: Send) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for message in upstream:
            await send({"type": "websocket.send", "text" if isinstance(message, str) else "bytes": message})


async def _pump_up(upstream: ClientConnection, receive: Receive) -> None:
    """Pass on what a viewer sends, until it leaves."""
    with contextlib.suppress(ConnectionClosed):
        while (message := await receive())["type"] != "websocket.disconnect":
            text = message.get("text")
            await upstream.send(text if text is not None else message.get("bytes") or b"")
