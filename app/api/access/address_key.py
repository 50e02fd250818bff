"""Keys in addresses, for programs that cannot send headers: ``/key/TOKEN/ogc``, ``/wms`` and tiles.

Addresses are stored in projects and shown to others, so only a token of role viewer is taken there, and only for
reading what a GIS reads. The address is rewritten before anything else sees it: nothing is logged, counted or passed
on that holds the key.
"""

import re

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.http.links import KEY_PREFIX

_KEYED = re.compile(r"^/key/([A-Za-z0-9_-]{16,128})(/.*)$")
_READ_BY_GIS = re.compile(r"^/(?:ogc|wms)(?:/.*)?$|^/api/v1/missions/[A-Za-z0-9_-]+/tiles/.*$")

UNNAMED = "/key"
"""What is shown of an address with a key that opens nothing."""


class AddressKeyMiddleware:
    """Takes the key out of the address and lets it count as the token of the header."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] in ("http", "websocket") and scope["path"].startswith("/key/"):
            scope = _without_key(scope)
        await self.app(scope, receive, send)


def _without_key(scope: Scope) -> Scope:
    found = _KEYED.match(scope["path"])
    reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
    if found is None or not reads or not _READ_BY_GIS.match(found[2]):
        return dict(scope) | {"path": UNNAMED, "raw_path": UNNAMED.encode()}
    prefix = f"/key/{found[1]}"
    raw = (scope.get("raw_path") or scope["path"].encode()).removeprefix(prefix.encode())
    headers = [(name, value) for name, value in Headers(scope=scope).raw if name not in (b"authorization", b"cookie")]
    headers.append((b"authorization", f"Bearer {found[1]}".encode()))
    state = dict(scope.get("state", {})) | {KEY_PREFIX: prefix}
    return dict(scope) | {"path": found[2], "raw_path": raw, "headers": headers, "state": state}
