"""What clients may be allowed to do. Imports nothing heavy: the command line asks for a role."""

from enum import StrEnum


class Role(StrEnum):
    """What the holder of a token may do."""

    VIEWER = "viewer"
    """Look at everything."""
    VEHICLE = "vehicle"
    """Look, post measurements and fetch waypoints."""
    OPERATOR = "operator"
    """Everything that concerns missions."""
    ADMIN = "admin"
    """Everything."""
