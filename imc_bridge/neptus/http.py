"""The HTTP side: one file per session, which the panel polls ten times a second."""

from __future__ import annotations

import asyncio
import re
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

PATH = re.compile(r"/caoagile/FilesFromAgent/NEPTUS/([A-Za-z0-9][A-Za-z0-9_-]{0,47})_NewActions\.txt")
MAX_CONNECTIONS = 64
KEEP_ALIVE_S = 30

Answer = Callable[[str, str], bytes | None]
"""The content of a session's file for a host, None when there is none for it."""


class HttpEndpoint:
    """Serves the sessions' files on a socket that listens already."""

    def __init__(self, listening: socket.socket, answer: Answer) -> None:
        self._listening = listening
        self._server = _Server(
            uvicorn.Config(
                _app(answer),
                lifespan="off",
                log_config=None,
                access_log=False,
                ws="none",
                limit_concurrency=MAX_CONNECTIONS,
                timeout_keep_alive=KEEP_ALIVE_S,
                timeout_graceful_shutdown=1,
                server_header=False,
            )
        )
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to answer."""
        self._task = asyncio.create_task(self._server.serve(sockets=[self._listening]), name="neptus-http")

    async def stop(self) -> None:
        """Close every connection; safe to repeat."""
        self._server.should_exit = True
        if self._task is not None:
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None
        self._listening.close()


class _Server(uvicorn.Server):
    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the process's signals to their own handlers."""
        yield


def _app(answer: Answer) -> Any:
    async def app(scope: Any, receive: Any, send: Any) -> None:
        found = PATH.fullmatch(scope["path"])
        host = scope["client"][0] if scope.get("client") else ""
        allowed = scope["method"] in ("GET", "HEAD")
        content = answer(found[1], host) if found and allowed else None
        status = 200 if content is not None else 404 if allowed else 405
        body = content if content is not None else b"there is no such file for you\n"
        headers = [
            (b"content-type", b"text/plain; charset=utf-8"),
            (b"content-length", str(len(body)).encode()),
            (b"cache-control", b"no-store"),
        ]
        if content is None:
            # The panel leaves the connection of a refusal open, and makes another one with its next poll.
            headers.append((b"connection", b"close"))
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": b"" if scope["method"] == "HEAD" else body})

    return app


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that is bound. Raises OSError when the address is taken or not ours."""
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
    except OSError:
        bound.close()
        raise
    return bound
