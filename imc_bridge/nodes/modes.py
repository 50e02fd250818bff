"""What DUNE says that a vehicle is at: its operation mode, and the state of plan control."""

from __future__ import annotations

from enum import IntEnum


class OperationMode(IntEnum):
    """VehicleState.op_mode."""

    SERVICE = 0
    CALIBRATION = 1
    ERROR = 2
    MANEUVER = 3
    EXTERNAL = 4
    BOOT = 5


class PlanState(IntEnum):
    """PlanControlState.state."""

    BLOCKED = 0
    READY = 1
    INITIALIZING = 2
    EXECUTING = 3


def mode_name(kind: type[IntEnum], value: int | None) -> str:
    """Return a mode in words, also one that is not known."""
    try:
        return kind(value).name.lower() if value is not None else "unknown"
    except ValueError:
        return f"unknown ({value})"
