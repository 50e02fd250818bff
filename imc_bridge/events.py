"""Events that the bridge reports to its user, as plain values: WGS84 degrees, metres, depth positive down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class NodeState(StrEnum):
    """How far the acquaintance with a node has come."""

    HEARD = "heard"
    """Packets arrive, but it never announced where it can be reached."""
    ANNOUNCED = "announced"
    """Its address is known; no telemetry yet."""
    ACTIVE = "active"
    """Telemetry arrives, but it cannot take a plan now."""
    READY = "ready"
    """In service, without a plan."""
    IN_PLAN = "in_plan"
    """Executes a plan, ours or another console's."""
    LOST = "lost"
    EXPECTED_OFFLINE = "expected_offline"
    """Silent under water in a plan that needs no contact."""


class Guidance(StrEnum):
    """How a vehicle is led."""

    FOLLOW = "follow"
    """By references, one a second: it can be redirected at any moment, and ends its plan when they cease."""
    LEGS = "legs"
    """By a plan for each whole leg: needs no contact under way, and cannot be redirected or guarded meanwhile."""
    ACOUSTIC = "acoustic"
    """By legs; while radio is silent plans, stops and reports go by sound through a gateway."""


class WaypointStatus(StrEnum):
    """The life of one waypoint on its vehicle."""

    SENT = "sent"
    ACKNOWLEDGED = "acknowledged"
    REACHED = "reached"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class BottomPoint:
    """Depth of the bottom at a place as a map knows it, below the surface as it is now, on the safe side."""

    lat_deg: float
    lon_deg: float
    depth_m: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where a vehicle shall go. Only equal waypoints are the same order: places to wait share a ``step``.

    ``lead_lat_deg``, ``lead_lon_deg``: a point on the leg's line beyond the waypoint, where it may be sent in order
    to pass the waypoint straight. DUNE flies straight to a reference only until some 7 m before it, and circles
    at once around one that is closer than 15 m.

    ``circle_lat_deg``, ``circle_lon_deg``: centre of a circle with a radius of :data:`.CIRCLE_RADIUS_M` in which it
    may descend before it goes there; without one it does not circle.
    """

    mission_id: str
    step: int
    lat_deg: float
    lon_deg: float
    depth_m: float
    speed_mps: float = 1.2
    arrival_radius_m: float = 5.0
    min_altitude_m: float = 3.0
    lead_lat_deg: float | None = None
    lead_lon_deg: float | None = None
    circle_lat_deg: float | None = None
    circle_lon_deg: float | None = None
    bottom: tuple[BottomPoint, ...] = ()
    """What is mapped of the bottom on the way there; no reference goes deeper than the clearance above it."""


@dataclass(frozen=True, slots=True)
class StateReport:
    """One EstimatedState of a vehicle; ``time_s`` is the vehicle's clock, Unix seconds."""

    vehicle: str
    time_s: float
    lat_deg: float
    lon_deg: float
    depth_m: float
    heading_rad: float
    speed_mps: float
    altitude_m: float | None = None
    battery_pct: float | None = None
    battery_confidence_pct: float | None = None
    """How sure the vehicle is of that level; DUNE itself does not trust one below 40 %."""
    energy_left_s: float | None = None
    """For how long that lasts under way, by the vehicle's own reckoning."""
    position_sd_m: float | None = None
    current_mps: tuple[float, float] | None = None
    """Velocity of the water over ground, east and north, as the vehicle estimated it last."""


@dataclass(frozen=True, slots=True)
class Sounding:
    """One measurement of the bottom at its footprint; ``bottom_depth_m`` is below the instantaneous surface.

    From ``vehicle_lat_deg`` on: the position and attitude that the footprint was computed from, and the beam's
    direction in the vehicle (None where the range is the height above the bottom whatever the attitude).
    """

    vehicle: str
    time_s: float
    lat_deg: float
    lon_deg: float
    bottom_depth_m: float
    vehicle_depth_m: float
    range_m: float
    source: str
    beam: int = 0
    position_sd_m: float | None = None
    vehicle_lat_deg: float | None = None
    vehicle_lon_deg: float | None = None
    roll_rad: float | None = None
    pitch_rad: float | None = None
    yaw_rad: float | None = None
    beam_azimuth_rad: float | None = None
    beam_off_nadir_rad: float | None = None


@dataclass(frozen=True, slots=True)
class SoundSpeedSample:
    """How fast sound was where a vehicle was, by one of its probes; ``depth_m`` is below the surface."""

    vehicle: str
    time_s: float
    lat_deg: float
    lon_deg: float
    depth_m: float
    speed_mps: float
    source: str
    """The probe's entity."""


@dataclass(frozen=True, slots=True)
class SoundingRefused:
    """A Distance that did not become a sounding, and why."""

    vehicle: str
    time_s: float
    source: str
    range_m: float
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class SwathPing:
    """One ping of a multibeam: where the sonar was, its attitude (starboard down and nose up are positive), its beams.

    ``angles_rad`` (b,) are from straight down in the vehicle, positive to starboard; ``ranges_m`` (b,) slant ranges,
    NaN where nothing was detected.
    """

    vehicle: str
    time_s: float
    lat_deg: float
    lon_deg: float
    depth_m: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    angles_rad: NDArray[np.float32]
    ranges_m: NDArray[np.float32]
    source: str
    position_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class PingRefused:
    """A SonarData of a multibeam that did not become a ping, and why."""

    vehicle: str
    time_s: float
    source: str
    reason: str


@dataclass(frozen=True, slots=True)
class TargetRange:
    """A range that a vehicle measured by sound to a system named ``target``, and where the vehicle was then."""

    vehicle: str
    time_s: float
    target: str
    range_m: float
    vehicle_lat_deg: float
    vehicle_lon_deg: float
    vehicle_depth_m: float
    source: str
    position_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class WaypointChange:
    """What became of a waypoint; ``reason`` explains whatever is not plain progress."""

    vehicle: str
    waypoint: Waypoint
    status: WaypointStatus
    reason: str = ""


@dataclass(frozen=True, slots=True)
class LinkChange:
    """A node's link has changed."""

    vehicle: str
    state: NodeState
    engaged: bool
    reason: str = ""
    ours: bool = False
    """Executes a plan of ours, perhaps of an earlier run."""
    at_s: float = 0.0
    """When, by our wall clock (Unix seconds)."""
    goes_home: bool = False
    """Executes the way home that we left on board."""


@dataclass(frozen=True, slots=True)
class Restarted:
    """DUNE on board a vehicle restarted: its plan is gone.

    ``submerged``: the vehicle was under water at the last contact before.
    """

    vehicle: str
    submerged: bool


class FaultKind(StrEnum):
    """What is broken on board."""

    LEAK = "leak"
    """Water where none should be."""
    ERROR = "error"
    """The vehicle has been in error for seconds."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something broke on board, or with ``over`` is no longer broken; ``time_s`` is the vehicle's clock."""

    vehicle: str
    time_s: float
    kind: FaultKind
    reason: str
    over: bool = False


@dataclass(frozen=True, slots=True)
class PacketsDropped:
    """Within the last second this machine threw ``count`` packets away because our socket was full."""

    count: int


BridgeEvent = (
    StateReport
    | Sounding
    | SoundingRefused
    | SwathPing
    | PingRefused
    | TargetRange
    | SoundSpeedSample
    | WaypointChange
    | LinkChange
    | Restarted
    | Fault
    | PacketsDropped
)
EventCallback = Callable[[BridgeEvent], None]


@dataclass(frozen=True, slots=True)
class StopResult:
    """Whether a vehicle acknowledged a stop, and in which words."""

    vehicle: str
    acknowledged: bool
    detail: str = ""


@dataclass(frozen=True, slots=True)
class LostComms:
    """How DUNE's task that starts a way home is configured: the plan's name, and seconds without a console as it says.

    It is on board; what it starts need not be.
    """

    plan_name: str
    timeout: str


@dataclass(frozen=True, slots=True)
class NodeView:
    """All that is known of one node at one moment. Ages are seconds of the wall clock."""

    name: str
    imc_id: int
    is_vehicle: bool
    state: NodeState
    engaged: bool
    reason: str = ""
    ours: bool = False
    """Executes a plan of ours, perhaps of an earlier run."""
    age_s: float | None = None
    """Since its last packet."""
    position_age_s: float | None = None
    """Since it last told where it is."""
    without_position: bool = False
    """It is heard, or was at the last contact, and does not tell where it is."""
    announce_age_s: float | None = None
    telemetry_overdue: bool = False
    """Announced for longer than telemetry needs to begin, and none came."""
    address: str | None = None
    addresses: tuple[tuple[str, int], ...] = ()
    """Every address that it announced."""
    imc_version: str | None = None
    operation_mode: str | None = None
    plan_id: str | None = None
    plan_state: str | None = None
    report: StateReport | None = None
    clock_offset_s: float | None = None
    entities: int | None = None
    controller: int | None = None
    """IMC id that its FollowReference maneuver takes references from, while it says so."""
    bottom_sensors: tuple[str, ...] = ()
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    soundings: int = 0
    refused: Mapping[str, int] = field(default_factory=dict)
    """Distances that did not become soundings, by reason."""
    pings: int = 0
    pings_refused: Mapping[str, int] = field(default_factory=dict)
    echoes: int = 0
    relayed: int = 0
    foreign_address: int = 0
    foreign_from: str | None = None
    """Address that packets under its id came from last without being announced."""
    conflict: str | None = None
    namesake: bool = False
    """Whether that conflict is about its name."""
    clock_rate: float | None = None
    """Seconds of its clock per second of ours; None until contact has lasted long enough."""
    history: tuple[LinkChange, ...] = ()
    """The last changes of its link, oldest first."""
    rate_limiters: str = ""
    faults: tuple[Fault, ...] = ()
    goes_home: bool = False
    """Executes the way home that we left on board."""
    runs_lost_comms: bool | None = None
    """Whether the task that starts a way home runs on board; None while that is not known."""
    lost_comms: LostComms | None = None
    """How that task is configured, once it has told."""
    way_home: str = ""
    """Whether it keeps a way home on board, in words."""
    restarts: int = 0
    """How often DUNE on board restarted while we listened."""
    radio_gaps: int = 0
    """How often radio ended under water while it was led by references, which ends their plan each time."""


class RefusedError(Exception):
    """A vehicle cannot do what was asked: ``reason`` says why, ``remedy`` what to do about it."""

    def __init__(self, vehicle: str, reason: str, remedy: str) -> None:
        super().__init__(f"{vehicle}: {reason}. {remedy}")
        self.vehicle = vehicle
        self.reason = reason
        self.remedy = remedy
