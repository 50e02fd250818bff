"""What happens around every request: an id, one log line, counted time, a checked body, no leaked traceback."""

import asyncio
import email.message
import json
import re
import secrets
import time
from collections.abc import Iterator
from typing import Any

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.audit_log import DATA
from app.api.headers import add_security_headers
from app.api.metrics import observe_request
from app.api.problems import FieldProblem, instance_of, invalid, make_problem, problem_response

log = structlog.get_logger("app.api")

_REQUEST_ID = re.compile(r"^[A-Za-z0-9._-]{1,64}$")
_FILE_PATH = re.compile(r"^/api/v1/missions/[^/]+/(imports|reference)$")
MAX_BREAKS = 20
"""A whole body may take this many times as long as one break in it: a byte now and then is no upload."""
_SURROGATES = re.compile("[\ud800-\udfff]")


class RequestMiddleware:
    """Outermost layer: names, times, counts and logs each request; answers 500 without internals."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one HTTP request; everything else passes."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _REQUEST_ID.match(given) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        status = 0

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["X-Request-Id"] = request_id
                add_security_headers(scope, headers)
            await send(message)

        began = time.perf_counter()
        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self.app(scope, receive, send_with_id)
            except Exception:
                log.exception("request failed", method=scope["method"], path=scope["path"])
                if status:
                    raise
                problem = make_problem(
                    "internal",
                    "an unexpected error occurred; the log has it under the request's id",
                    instance=instance_of(scope),
                    remedy=f"Report it together with the request's id {request_id}",
                )
                await problem_response(problem)(scope, receive, send_with_id)
            finally:
                seconds = time.perf_counter() - began
                route = getattr(scope.get("route"), "path", "") or "unmatched"
                observe_request(scope["method"], route, status, seconds)
                emit = log.debug if _is_routine(scope, status) else log.info
                emit(
                    "request",
                    method=scope["method"],
                    path=scope["path"],
                    status=status,
                    ms=round(seconds * 1000, 1),
                )


def _is_routine(scope: Scope, status: int) -> bool:
    """Tell whether a request changed nothing, or is one of the very many by which vehicles report."""
    reads = scope["method"] in ("GET", "HEAD")
    return status < 400 and (reads or getattr(scope.get("route"), "operation_id", None) in DATA)


class BodyMiddleware:
    """Refuses bodies that are too large, of another type than JSON, or with text that no database can store.

    Files may be of any type and have a limit of their own; they are read by whom they are for.
    """

    def __init__(self, app: ASGIApp, max_bytes: int, max_file_bytes: int, patience_s: float) -> None:
        self.app = app
        self.patience_s = patience_s
        self.max_bytes = max_bytes
        self.max_file_bytes = max_file_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Read and check the body of requests that may change something; everything else passes."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD", "OPTIONS"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        declared = headers.get("content-length", "")
        is_file = _FILE_PATH.match(scope["path"]) is not None
        limit = self.max_file_bytes if is_file else self.max_bytes
        too_large = declared.isdigit() and int(declared) > limit
        try:
            body = b"" if too_large else await self._read(receive, limit)
        except TimeoutError:
            slow = make_problem(
                "request-timeout",
                "the body did not arrive in time",
                instance=instance_of(scope),
                remedy=f"Send it without breaks of more than {self.patience_s:g} s, or raise slow_client_s",
            )
            await problem_response(slow, {"Connection": "close"})(scope, receive, send)
            return
        if body is None:
            return
        problem = None
        if too_large or len(body) > limit:
            in_parts = "Send it in several requests; measurements are taken in batches of any size up to the limit"
            thinned = "Cut it to the mission's area, thin it, or raise max_import_bytes in the settings"
            problem = make_problem(
                "body-too-large",
                f"the body has more than {limit} bytes",
                instance=instance_of(scope),
                remedy=thinned if is_file else in_parts,
            )
        elif is_file:
            pass
        elif body and not _is_json(headers.get("content-type", "")):
            problem = make_problem(
                "unsupported-media-type",
                f"the body is declared as {headers.get('content-type') or 'nothing'}",
                instance=instance_of(scope),
                remedy="Send JSON with the header Content-Type: application/json",
            )
        elif b"\\u" in body:
            found = [*_unstorable(body)]
            problem = invalid(found, len(found), scope) if found else None
        if problem is not None:
            await problem_response(problem)(scope, receive, send)
            return
        replayed = False

        async def replay() -> Message:
            nonlocal replayed
            if replayed:
                return await receive()
            replayed = True
            return {"type": "http.request", "body": body, "more_body": False}

        await self.app(scope, replay, send)

    async def _read(self, receive: Receive, limit: int) -> bytes | None:
        """Return the body, cut off soon after the limit; None when the client went away.

        Raises TimeoutError when nothing came for a while, or the whole takes far too long.
        """
        chunks: list[bytes] = []
        size = 0
        latest = time.monotonic() + MAX_BREAKS * self.patience_s
        while size <= limit:
            async with asyncio.timeout(min(self.patience_s, latest - time.monotonic())):
                message = await receive()
            if message["type"] == "http.disconnect":
                return None
            chunk = message.get("body", b"")
            chunks.append(chunk)
            size += len(chunk)
            if not message.get("more_body", False):
                break
        return b"".join(chunks)


def _is_json(content_type: str) -> bool:
    message = email.message.Message()
    message["content-type"] = content_type
    subtype = message.get_content_subtype()
    return message.get_content_maintype() == "application" and (subtype == "json" or subtype.endswith("+json"))


def _unstorable(body: bytes) -> Iterator[FieldProblem]:
    """Yield a problem for the first text with a NUL or a lone surrogate; these arrive only as \\u escapes."""
    try:
        parsed = json.loads(body)
    except (ValueError, RecursionError):
        return  # the router answers malformed bodies
    pending: list[tuple[tuple[str, ...], Any]] = [((), parsed)]
    while pending:
        path, value = pending.pop()
        texts = [value] if isinstance(value, str) else list(value) if isinstance(value, dict) else []
        for text in texts:
            if "\0" in text or _SURROGATES.search(text):
                yield FieldProblem(
                    location="body",
                    field=".".join(path) or "body",
                    value=ascii(text)[:100],
                    message="the text holds a NUL character or a lone surrogate",
                    expected="valid Unicode text",
                )
                return
        if isinstance(value, dict):
            pending.extend(((*path, key), item) for key, item in value.items())
        elif isinstance(value, list):
            pending.extend(((*path, str(index)), item) for index, item in enumerate(value))
