"""Connections of clients that are slow on purpose, or too many: they must not keep the others out."""

import asyncio
import ipaddress
from functools import partial

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from app.api.access.auth import OPERATORS
from app.api.accounts.peers import OWN_USER, is_own_user
from app.api.accounts.rates import network_of
from app.api.bodies.unread import ANSWERED
from app.api.middleware.sockets import Rank, Sockets
from app.settings import Settings, is_loopback

__all__ = ["Sockets", "is_shared_host", "patient_http"]

MAX_HEAD_BYTES = 65_536
_END = b"\r\nconnection: close\r\ncontent-length: 0\r\n\r\n"
_TOO_SLOW = b"HTTP/1.1 408 Request Timeout" + _END
_TOO_LARGE = b"HTTP/1.1 431 Request Header Fields Too Large" + _END


def is_shared_host(settings: Settings, host: str) -> bool:
    """Tell whether many different people may come from an address: this machine, and the trusted proxies."""
    if not host or is_loopback(host):
        return True
    try:
        address = ipaddress.ip_address(host.split("%")[0])
    except ValueError:
        return False
    return any(address in ipaddress.ip_network(proxy) for proxy in settings.trusted_proxies)


def patient_http(settings: Settings, sockets: Sockets[asyncio.Protocol]) -> type[asyncio.Protocol]:
    """Return uvicorn's HTTP protocol that bounds a request's head, in time and size, and the open connections.

    One function because the class in it needs the settings of the application: uvicorn makes its instances.
    Between requests uvicorn itself closes idle connections; the body's time is the business of the middleware.
    """

    class PatientHttp(HttpToolsProtocol):
        """One connection."""

        _timer: asyncio.TimerHandle | None = None
        _head_bytes = 0
        _in_head = False

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            """Count it; of too many the one that was idle for longest is closed."""
            super().connection_made(transport)
            leaver = sockets.opened(self, network_of(self.client[0]) if self.client else "")
            if isinstance(leaver, PatientHttp):
                leaver.leave()
            # Now: of who closes or resets his connection the kernel will not know any more whose it was.
            connection = transport.get_extra_info("socket")
            self.app_state = {
                **self.app_state,
                OWN_USER: connection is not None and is_own_user(connection),
                # Who goes on sending what nobody wants makes room for others as if he were idle.
                ANSWERED: partial(sockets.idle, self, Rank.STRANGER),
            }
            self._watch()

        def leave(self) -> None:
            """Make room for another connection."""
            self._forget()
            self.transport.abort()

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
            sockets.busy(self)
            super().on_headers_complete()

        def on_response_complete(self) -> None:
            """Note who was served, and that the connection is idle."""
            served = self.cycle.scope.get("state", {}).get("principal")
            super().on_response_complete()
            if self.cycle.response_complete:
                operator = served is not None and served.role in OPERATORS
                rank = Rank.OPERATOR if operator else Rank.STRANGER if served is None else Rank.USER
                sockets.idle(self, rank)

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
            sockets.closed(self)

    return PatientHttp
