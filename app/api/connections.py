"""Connections of clients that are slow on purpose, or too many: they must not keep the others out."""

import asyncio
from collections import Counter

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from app.api.peers import OWN_USER, is_own_user
from app.settings import Settings, is_loopback

MAX_HEAD_BYTES = 65_536
_END = b"\r\nconnection: close\r\ncontent-length: 0\r\n\r\n"
_TOO_SLOW = b"HTTP/1.1 408 Request Timeout" + _END
_TOO_LARGE = b"HTTP/1.1 431 Request Header Fields Too Large" + _END


def patient_http(settings: Settings) -> type[asyncio.Protocol]:
    """Return uvicorn's HTTP protocol that bounds a request's head, in time and size, and connections per address.

    Between requests uvicorn itself closes idle connections; the body's time is the business of the middleware.
    """
    held: Counter[str] = Counter()
    share = settings.max_connections // 4

    class PatientHttp(HttpToolsProtocol):
        """One connection."""

        _timer: asyncio.TimerHandle | None = None
        _counted = ""
        _head_bytes = 0
        _in_head = False

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            """Count it; refuse one too many."""
            super().connection_made(transport)
            host = self.client[0] if self.client else ""
            if host and not is_loopback(host) and host not in settings.trusted_proxies:
                if held[host] >= share:
                    transport.abort()
                    return
                held[host] += 1
                self._counted = host
            # Now: of who closes or resets his connection the kernel will not know any more whose it was.
            connection = transport.get_extra_info("socket")
            self.app_state = {**self.app_state, OWN_USER: connection is not None and is_own_user(connection)}
            self._watch()

        def data_received(self, data: bytes) -> None:
            """Take data in; a head that is not complete yet has as long as the first byte had."""
            went_on = self._in_head
            super().data_received(data)
            self._watch()
            # The parser itself would gather a head of any size.
            self._head_bytes = self._head_bytes + len(data) if went_on and self._in_head else 0
            if self._head_bytes > MAX_HEAD_BYTES:
                self._refuse(_TOO_LARGE)

        def on_message_begin(self) -> None:
            """Begin a head."""
            self._in_head = True
            super().on_message_begin()

        def on_headers_complete(self) -> None:
            """End it."""
            self._in_head = False
            super().on_headers_complete()

        def handle_websocket_upgrade(self) -> None:
            """Leave the connection to the other protocol, whose number has a limit of its own."""
            self._forget()
            super().handle_websocket_upgrade()

        def connection_lost(self, exc: Exception | None) -> None:
            """Count it no more."""
            self._forget()
            super().connection_lost(exc)

        def _watch(self) -> None:
            busy = self.cycle is not None and not self.cycle.response_complete
            idle = self.timeout_keep_alive_task is not None
            if busy or idle or self.transport.is_closing() or self.transport.get_protocol() is not self:
                self._stop_timer()
            elif self._timer is None:
                self._timer = self.loop.call_later(settings.slow_client_s, self._too_slow)

        def _too_slow(self) -> None:
            self._refuse(_TOO_SLOW)

        def _refuse(self, answer: bytes) -> None:
            self._stop_timer()
            self.transport.write(answer)
            self.transport.close()

        def _stop_timer(self) -> None:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

        def _forget(self) -> None:
            self._stop_timer()
            if self._counted:
                held[self._counted] -= 1
                if not held[self._counted]:
                    del held[self._counted]
                self._counted = ""

    return PatientHttp
