"""Bodies that nobody wanted: the answer comes at once, and the connection ends without them."""

import asyncio
import time

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.bodies.intake import has_body

ANSWERED = "connection_answered"
"""Name in a scope's state of what is called when an answer is out and only an unwanted body is awaited."""
DRAIN_S = 2.0
DRAIN_BYTES = 2**26
"""So much of what a client still sends is thrown away: one that is cut off while it sends never sees the answer."""


class UnreadBodyMiddleware:
    """Closes the connection after an answer to a request whose body was not read to its end."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one HTTP request; everything else passes."""
        if scope["type"] != "http" or not has_body(Headers(scope=scope)):
            await self.app(scope, receive, send)
            return
        read = answered = False

        async def receive_counted() -> Message:
            nonlocal read
            message = await receive()
            read = read or message["type"] == "http.disconnect" or not message.get("more_body", False)
            return message

        async def send_closing(message: Message) -> None:
            nonlocal answered
            if not read and message["type"] == "http.response.start":
                MutableHeaders(scope=message)["Connection"] = "close"
            elif not read and message["type"] == "http.response.body" and not message.get("more_body", False):
                answered = True
                message = {**message, "more_body": True}
            await send(message)

        await self.app(scope, receive_counted, send_closing)
        if answered:
            let_go = scope.get("state", {}).get(ANSWERED)
            if let_go is not None:
                let_go()
            await _drain(receive)
            await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _drain(receive: Receive) -> None:
    """Throw away the rest of a body, for a moment."""
    left = DRAIN_BYTES
    until_s = time.monotonic() + DRAIN_S
    while left > 0:
        try:
            async with asyncio.timeout(until_s - time.monotonic()):
                message = await receive()
        except TimeoutError:
            return
        if message["type"] == "http.disconnect" or not message.get("more_body", False):
            return
        left -= len(message.get("body", b""))
