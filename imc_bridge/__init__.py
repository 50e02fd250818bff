"""The IMC side: transport, discovery, vehicle links and FollowReference control."""

from imc_bridge.bridge import Bridge
from imc_bridge.events import (
    BottomPoint,
    BridgeEvent,
    Fault,
    FaultKind,
    Guidance,
    LinkChange,
    NodeState,
    NodeView,
    PacketsDropped,
    RefusedError,
    Restarted,
    Sounding,
    SoundingRefused,
    StateReport,
    StopResult,
    TargetRange,
    Waypoint,
    WaypointChange,
    WaypointStatus,
)
from imc_bridge.network.transport import PortInUseError
from imc_bridge.settings import BridgeSettings

__all__ = [
    "BottomPoint",
    "Bridge",
    "BridgeEvent",
    "BridgeSettings",
    "Fault",
    "FaultKind",
    "Guidance",
    "LinkChange",
    "NodeState",
    "NodeView",
    "PacketsDropped",
    "PortInUseError",
    "RefusedError",
    "Restarted",
    "Sounding",
    "SoundingRefused",
    "StateReport",
    "StopResult",
    "TargetRange",
    "Waypoint",
    "WaypointChange",
    "WaypointStatus",
]
