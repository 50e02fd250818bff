"""Bodies of requests: of nobody who may not send them, no longer than they may be, and never too many at once."""

import asyncio
import time

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.bodies.budget import BodyBudget, Lease
from app.api.bodies.intake import BodyKind, Intake, Intakes, declared_bytes, has_body
from app.api.http.error_handlers import answer_to
from app.api.http.problems import ProblemError
from app.api.state import EdgeState

MAX_BREAKS = 20
"""A whole body may take this many times as long as one break in it: a byte now and then is no upload."""
SMALL_BYTES = 65_536
"""Bodies up to here count for nothing: there are no more of them than connections."""
STEP_BYTES = 2**20
"""Bodies that do not say how long they are are counted in steps of this."""

READING = frozenset({"GET", "HEAD", "OPTIONS"})


class BodyMiddleware:
    """Settles from the headers who asks for what, then reads the body, or lets a file pass through.

    JSON is gathered; files come to their route piece by piece, and whoever reads them gets a ProblemError when they
    become too long or too slow.

    Parameters
    ----------
    intakes
        What every route takes.
    budget
        What all requests may have under way.
    max_bytes, max_file_bytes
        Most bytes of a JSON body and of a file.
    patience_s
        How long a break in a body may be.
    """

    def __init__(
        self, app: ASGIApp, intakes: Intakes, budget: BodyBudget, max_bytes: int, max_file_bytes: int, patience_s: float
    ) -> None:
        self.app = app
        self.intakes = intakes
        self.budget = budget
        self.max_bytes = max_bytes
        self.max_file_bytes = max_file_bytes
        self.patience_s = patience_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request that may change something; everything else passes."""
        if scope["type"] != "http" or scope["method"] in READING:
            await self.app(scope, receive, send)
            return
        intake = self.intakes.find(scope)
        if intake is None:
            await self.app(scope, receive, send)  # the router says so, and reads nothing
            return
        began = False

        async def send_on(message: Message) -> None:
            nonlocal began
            began = True
            await send(message)

        scope["intake"] = intake.kind
        try:
            await self._serve(intake, scope, receive, send_on)
        except ClientDisconnect:
            return
        except Exception as error:
            if began:
                raise
            await answer_to(error, scope)(scope, receive, send)

    async def _serve(self, intake: Intake, scope: Scope, receive: Receive, send: Send) -> None:
        edge: EdgeState = scope["app"].state.edge
        principal = await intake.admit(scope, edge)
        headers = Headers(scope=scope)
        limit = intake.limit(self.max_bytes, self.max_file_bytes)
        declared = declared_bytes(headers)
        if declared is not None and declared > limit:
            raise self._too_large(intake, limit)
        intake.check_media_type(headers)
        with self.budget.lease(principal.name if principal else "") as lease:
            if declared is not None and declared > SMALL_BYTES:
                lease.cover(declared)
            body = _Body(receive, limit, lease, self.patience_s, self._too_large(intake, limit))
            if intake.kind is BodyKind.FILE:
                await self.app(scope, body.receive, send)
                return
            content = await body.whole() if has_body(headers) else b""
            await self.app(scope, replayed(content, receive), send)

    def _too_large(self, intake: Intake, limit: int) -> ProblemError:
        remedies = {
            BodyKind.FILE: "Cut it to the mission's area, thin it, or raise max_import_bytes in the settings",
            BodyKind.JSON: "Send it in several requests; measurements are taken in batches of any size up to the limit",
            BodyKind.NONE: "Send none: nothing is read from a body here",
        }
        return ProblemError("body-too-large", f"the body has more than {limit} bytes", remedy=remedies[intake.kind])


class _Body:
    """A body as it comes; ``too_large`` is raised beyond ``limit`` bytes."""

    def __init__(self, receive: Receive, limit: int, lease: Lease, patience_s: float, too_large: ProblemError) -> None:
        self._receive = receive
        self._limit = limit
        self._lease = lease
        self._patience_s = patience_s
        self._too_large = too_large
        self._latest = time.monotonic() + MAX_BREAKS * patience_s
        self._size = 0
        self._ended = False

    async def receive(self) -> Message:
        """Return the next piece. Raises ProblemError when it is too late, or too much."""
        if self._ended:
            return await self._receive()
        try:
            async with asyncio.timeout(min(self._patience_s, self._latest - time.monotonic())):
                message = await self._receive()
        except TimeoutError:
            raise ProblemError(
                "request-timeout",
                "the body did not arrive in time",
                remedy=f"Send it without breaks of more than {self._patience_s:g} s, or raise slow_client_s",
            ) from None
        self._size += len(message.get("body", b""))
        self._ended = message["type"] == "http.disconnect" or not message.get("more_body", False)
        if self._size > self._limit:
            raise self._too_large
        if self._size > SMALL_BYTES and self._size > self._lease.held:
            self._lease.cover(min(-(-self._size // STEP_BYTES) * STEP_BYTES, max(self._limit, self._size)))
        return message

    async def whole(self) -> bytes:
        """Return all of it. Raises ProblemError, and ClientDisconnect when the client left."""
        parts: list[bytes] = []
        while not self._ended:
            message = await self.receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            parts.append(message.get("body", b""))
        return b"".join(parts)


def replayed(body: bytes, receive: Receive) -> Receive:
    """Return what gives ``body`` once, and then waits for the client to leave."""
    left: list[bytes] = [body]
    del body

    async def replay() -> Message:
        if not left:
            return await receive()
        return {"type": "http.request", "body": left.pop(), "more_body": False}

    return replay
