"""What a process is called on all its connections to PostgreSQL, so that others can end them when it hangs."""

import secrets
from typing import Any

APPLICATION = "bathyfleet "


def new_application() -> str:
    """Return a name that no other process has."""
    return APPLICATION + secrets.token_hex(8)


def called(application: str) -> dict[str, Any]:
    """Return what tells the server how a connection is called; as the driver has it without a name."""
    return {"server_settings": {"application_name": application}} if application else {}
