"""Headers that keep browsers from doing with an answer what it is not meant for."""

from starlette.datastructures import MutableHeaders
from starlette.types import Scope

_ALWAYS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_PERMISSIONS = "camera=(), geolocation={}, microphone=(), payment=(), usb=()"
_PAGE = ("/", "/index.html")
"""The dashboard alone may ask the browser where the device is, which asks its user first; no answer of the API may."""
_DATA_POLICY = "default-src 'none'; frame-ancestors 'none'"
# The page of the API's description begins with a line of script; all the rest comes from this service.
_DOCS_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_DOCS = "/api/docs"
_ONE_YEAR_S = 31_536_000


def add_security_headers(scope: Scope, headers: MutableHeaders) -> None:
    """Add what is not there yet; by HTTPS also that this host is to be asked by HTTPS only."""
    for name, value in _ALWAYS.items():
        headers.setdefault(name, value)
    own = "(self)" if scope["path"] in _PAGE else "()"
    headers.setdefault("Permissions-Policy", _PERMISSIONS.format(own))
    headers.setdefault("Content-Security-Policy", _DOCS_POLICY if scope["path"] == _DOCS else _DATA_POLICY)
    if scope.get("scheme") == "https":
        headers.setdefault("Strict-Transport-Security", f"max-age={_ONE_YEAR_S}")
