"""What everyone who watches a mission is sent over the live socket."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from app.missions.views.alarms import AlarmView
from app.missions.views.base import View
from app.missions.views.mission import CurrentView, EventView, MissionSummary, MissionView, VehicleView, WaypointView
from app.missions.views.search import SearchMessage
from app.missions.views.targets import TargetView
from app.missions.views.traffic import TrafficMessage


class SnapshotMessage(View):
    """First message on the live socket: everything needed to draw the picture."""

    type: Literal["snapshot"] = "snapshot"
    mission: MissionView
    tracks: dict[str, list[tuple[float, float, float]]] = Field(
        description="Per vehicle its track so far as [longitude, latitude, depth], to within 0.2 m"
    )
    map_version: int
    last_event_id: int
    alarms: list[AlarmView] = Field(description="Those of the mission that nobody has acknowledged, oldest first")


class VehiclesMessage(View):
    """Positions and links, a few times per second."""

    type: Literal["vehicles"] = "vehicles"
    time: datetime
    vehicles: list[VehicleView]
    current: CurrentView | None = Field(default=None, description="As these estimate it; null: none tells of it")


class TargetsMessage(View):
    """What is known of the moving targets, a few times per second where a mission has any."""

    type: Literal["targets"] = "targets"
    time: datetime
    targets: list[TargetView]


class WaypointsMessage(View):
    """Waypoints whose state changed."""

    type: Literal["waypoints"] = "waypoints"
    waypoints: list[WaypointView]


class StateMessage(View):
    """The mission's state or progress changed."""

    type: Literal["mission"] = "mission"
    mission: MissionSummary


class MapMessage(View):
    """A new map can be fetched: ``GET /missions/{id}/map`` or its picture."""

    type: Literal["map"] = "map"
    version: int
    live: int = Field(default=0, description="Grows with what was sounded or corrected since: the tiles show it")
    step: int
    min_depth_m: float | None
    max_depth_m: float | None


class EventMessage(View):
    """A new line of the log."""

    type: Literal["event"] = "event"
    event: EventView


class AlarmMessage(View):
    """An alarm was raised or acknowledged; by its id the page knows whether it has it already."""

    type: Literal["alarm"] = "alarm"
    alarm: AlarmView


LiveMessage = (
    SnapshotMessage
    | VehiclesMessage
    | TargetsMessage
    | SearchMessage
    | WaypointsMessage
    | StateMessage
    | TrafficMessage
    | MapMessage
    | EventMessage
    | AlarmMessage
)
