"""Headers that keep browsers within bounds."""

import pytest
from starlette.datastructures import MutableHeaders

from app.api.http.headers import add_security_headers


@pytest.mark.parametrize(
    ("path", "allowed"),
    [
        ("/", "(self)"),
        ("/index.html", "(self)"),
        ("/api/docs", "()"),
        ("/api/v1/missions", "()"),
        ("/ogc", "()"),
        ("/wms", "()"),
    ],
)
def test_only_the_dashboard_may_ask_where_the_device_is(path: str, allowed: str) -> None:
    headers = MutableHeaders()
    add_security_headers({"path": path, "scheme": "http"}, headers)
    policy = dict(one.strip().split("=") for one in headers["permissions-policy"].split(","))
    assert policy.pop("geolocation") == allowed
    assert set(policy.values()) == {"()"}
