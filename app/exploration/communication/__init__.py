"""The exchange of landmarks under limited communication (AURO15 sec. 3.4): messages, vehicles, station."""

from app.exploration.communication.messages import Entries, MessageError, MoveOrder, StatusReport, WireFormat
from app.exploration.communication.selection import reachable
from app.exploration.communication.station import StationNode
from app.exploration.communication.vehicle import VehicleNode

__all__ = [
    "Entries",
    "MessageError",
    "MoveOrder",
    "StatusReport",
    "StationNode",
    "VehicleNode",
    "WireFormat",
    "reachable",
]
