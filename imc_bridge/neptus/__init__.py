"""An FTP and HTTP endpoint for Neptus' ConvCAO panel, in place of the web service it was written for.

The panel logs in by FTP, makes a folder for its session, uploads how many vehicles it has and a sparse map, then with
every step where they are and what they sounded; it polls an HTTP file for where they shall go.
"""

from imc_bridge.neptus.gateway import (
    GatewaySettings,
    NeptusGateway,
    Restored,
    SessionKeeper,
    SessionRefusedError,
)
from imc_bridge.neptus.values import Area, CellPosition, CellSounding, Conventions, StepData

__all__ = [
    "Area",
    "CellSounding",
    "Conventions",
    "GatewaySettings",
    "NeptusGateway",
    "CellPosition",
    "Restored",
    "SessionKeeper",
    "SessionRefusedError",
    "StepData",
]
