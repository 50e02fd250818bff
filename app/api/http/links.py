"""Addresses of this service as they stand in its answers."""

from collections.abc import Mapping
from typing import Any

from starlette.requests import HTTPConnection

KEY_PREFIX = "key_prefix"
"""What the state of a request holds whose address begins with a key: that beginning."""


def link_root(connection: HTTPConnection) -> str:
    """Return what every address of this service begins with, as whoever asks reached it: with the key, if any."""
    return str(connection.base_url).rstrip("/") + key_prefix(connection.scope)


def key_prefix(scope: Mapping[str, Any]) -> str:
    """Return the beginning of an address that holds a key; empty without one."""
    return str(scope.get("state", {}).get(KEY_PREFIX, ""))
