"""What happens around every request: an id, one log line, counted time, no leaked traceback."""

import re
import secrets
import time

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.accounts.audit_log import DATA
from app.api.http.error_handlers import answer_to
from app.api.http.headers import add_security_headers
from app.api.http.problems import instance_of, make_problem, problem_response
from app.api.metrics import observe_request

log = structlog.get_logger("app.api")

_REQUEST_ID = re.compile(r"^[A-Za-z0-9._-]{1,64}$")


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
            except Exception as error:
                if status:
                    log.exception("request failed", method=scope["method"], path=scope["path"])
                    raise
                await _answer(error, request_id, scope)(scope, receive, send_with_id)
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


def _answer(error: Exception, request_id: str, scope: Scope) -> Response:
    """Return the answer to an error that no route answered for."""
    try:
        return answer_to(error, scope)
    except Exception:
        log.exception("request failed", method=scope["method"], path=scope["path"])
    problem = make_problem(
        "internal",
        "an unexpected error occurred; the log has it under the request's id",
        instance=instance_of(scope),
        remedy=f"Report it together with the request's id {request_id}",
    )
    return problem_response(problem)


def _is_routine(scope: Scope, status: int) -> bool:
    """Tell whether a request changed nothing, or is one of the very many by which vehicles report."""
    reads = scope["method"] in ("GET", "HEAD")
    return status < 400 and (reads or getattr(scope.get("route"), "operation_id", None) in DATA)
