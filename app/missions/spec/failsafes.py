"""What may go wrong with vehicles, and what can be done about it: the names; `recovery.failsafes` has the table."""

from enum import StrEnum


class Failsafe(StrEnum):
    """What may go wrong with a vehicle, or with all of them."""

    LEAK = "leak"
    CRITICAL_ENERGY = "critical_energy"
    TOO_DEEP = "too_deep"
    POSITION_LOST = "position_lost"
    NO_POSITION = "no_position"
    LOW_ENERGY = "low_energy"
    LINK_LOST = "link_lost"
    TRAFFIC = "traffic"
    GEOFENCE_LEFT = "geofence_left"
    SEPARATION_LOST = "separation_lost"
    VEHICLE_ERROR = "vehicle_error"
    OTHER_CONSOLE = "other_console"
    ALL_LINKS_LOST = "all_links_lost"
    SERVICE_RESTARTED = "service_restarted"


class Response(StrEnum):
    """What is done, least to most: what is farther down is not undone by what is farther up."""

    WARN = "warn"
    """The operator is told; the vehicle goes on."""
    HOLD = "hold"
    """It circles where it is until that is over."""
    RETURN = "return"
    """It goes home to its recovery point; where none is given, the operator is told."""
    SURFACE = "surface"
    """It comes up where it is, and stops there."""
    STOP = "stop"
    """It is stopped at once."""
