"""What a process is called on all its connections to PostgreSQL, so that others can end them when it hangs."""

import secrets
from typing import Any

PREFIX = "bathyfleet "


def new_application_name() -> str:
    """Return a name that no other process has."""
    return PREFIX + secrets.token_hex(8)


def connect_arguments(application_name: str) -> dict[str, Any]:
    """Return what tells the server how a connection is called; nothing without a name."""
    return {"server_settings": {"application_name": application_name}} if application_name else {}
