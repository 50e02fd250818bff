"""From which address somebody asks: the one that he has, or the one that a trusted proxy tells."""

import ipaddress
from collections.abc import Collection

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware


class AddressMiddleware:
    """The outermost: who came by IPv4 to a socket of IPv6 is known by his IPv4 address, proxies among them.

    Parameters
    ----------
    proxies
        Addresses and networks of those who are believed for whom they speak. Of nobody else: else anyone could speak
        under another's address.
    """

    def __init__(self, app: ASGIApp, proxies: Collection[str]) -> None:
        self.app = ProxyHeadersMiddleware(app, list(proxies)) if proxies else app  # type: ignore[arg-type]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or socket."""
        if scope.get("client"):
            host, port = scope["client"]
            scope["client"] = (unmapped(host), port)
        await self.app(scope, receive, send)  # type: ignore[arg-type]


def unmapped(host: str) -> str:
    """Return the IPv4 address that an address of the form ``::ffff:192.0.2.7`` stands for; others as they are."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return host if mapped is None else str(mapped)
