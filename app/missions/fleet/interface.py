"""The one interface through which missions see vehicles.

Everything here is geographic (WGS84 degrees, depth in metres, positive down) because a vehicle exists before any
mission gives it a local frame. Links report by calling an :data:`EventSink` from the event loop's thread; they never
block and never raise through it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from imc_bridge.control.depth_layers import ALONE, DepthLayer
from simulator.obstacles.obstacles import ObstacleWorld


class LinkState(StrEnum):
    """How well a vehicle can be reached, worst to best."""

    UNKNOWN = "unknown"
    """Never heard of."""
    LOST = "lost"
    """Was heard, is silent for longer than it should be."""
    EXPECTED_OFFLINE = "expected_offline"
    """Silent by plan, for example submerged without acoustics."""
    HEARD = "heard"
    """Something arrives, but the vehicle cannot take commands yet; the reason says what is missing."""
    READY = "ready"
    """Takes commands; executes nothing of ours."""
    ENGAGED = "engaged"
    """Follows our waypoints."""


class WaypointStatus(StrEnum):
    """The life of one waypoint. A vehicle's route is drawn from ``ACKNOWLEDGED`` on, not before."""

    PLANNED = "planned"
    SENT = "sent"
    ACKNOWLEDGED = "acknowledged"
    REACHED = "reached"
    REFUSED = "refused"
    MISSED = "missed"
    """The step's deadline passed before the vehicle arrived."""


@dataclass(frozen=True, slots=True)
class Position:
    """A place: WGS84 degrees and metres below the surface, positive down."""

    lat_deg: float
    lon_deg: float
    depth_m: float

    @property
    def lat_lon(self) -> tuple[float, float]:
        """Latitude and longitude, degrees."""
        return self.lat_deg, self.lon_deg


@dataclass(frozen=True, slots=True)
class VehicleReport:
    """One state report of a vehicle. ``time_s`` is the vehicle's own clock (Unix seconds); None: not told.

    ``battery_confidence_pct`` is how sure the vehicle is of its level: DUNE itself does not trust one below 40 %.
    ``energy_left_s`` is for how long it says that the level lasts under way. ``current_mps`` is the velocity of the
    water over ground, east and north, as the vehicle estimated it last.
    """

    vehicle: str
    time_s: float
    position: Position
    heading_rad: float | None = None
    speed_mps: float | None = None
    altitude_m: float | None = None
    battery_pct: float | None = None
    battery_confidence_pct: float | None = None
    energy_left_s: float | None = None
    position_sd_m: float | None = None
    current_mps: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class BeamGeometry:
    """How a sonar's beam pointed: the raw values that a footprint was computed from.

    Position of the vehicle in WGS84 degrees, its attitude (nose up and starboard down are positive), and the beam's
    direction in the vehicle: azimuth from the bow to starboard, angle from straight down. None: not known, or not used
    because the range is vertical whatever the attitude.
    """

    lat_deg: float
    lon_deg: float
    roll_deg: float | None = None
    pitch_deg: float | None = None
    heading_deg: float | None = None
    azimuth_deg: float | None = None
    off_nadir_deg: float | None = None

    @classmethod
    def where_known(
        cls, lat_deg: float | None, lon_deg: float | None, *angles_deg: float | None
    ) -> "BeamGeometry | None":
        """Return the geometry, or None where not even the vehicle's place is known; angles in the fields' order."""
        return None if lat_deg is None or lon_deg is None else cls(lat_deg, lon_deg, *angles_deg)


@dataclass(frozen=True, slots=True)
class SoundingReport:
    """One measurement of the sea floor, already placed at its footprint.

    ``footprint`` is where the beam met the bottom (its ``depth_m`` is the bottom's depth below the instantaneous water
    surface, no tide applied); ``vehicle_depth_m`` and ``range_m`` are the raw values it was made of.
    """

    vehicle: str
    time_s: float
    footprint: Position
    vehicle_depth_m: float
    range_m: float
    source: str
    beam: int = 0
    depth_sd_m: float | None = None
    position_sd_m: float | None = None
    beam_geometry: BeamGeometry | None = None


@dataclass(frozen=True, slots=True)
class RangeReport:
    """A range that a vehicle measured to a moving target.

    ``target`` is what its modem calls the target, ``position`` where the vehicle was, ``position_sd_m`` how well it
    says that it knew that, ``source`` what told of the range.
    """

    vehicle: str
    time_s: float
    target: str
    range_m: float
    position: Position
    source: str
    position_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class SoundSpeedReport:
    """How fast sound was where a vehicle was; ``source`` is the probe that measured it."""

    vehicle: str
    time_s: float
    position: Position
    speed_mps: float
    source: str


@dataclass(frozen=True, slots=True)
class ScanReport:
    """A look round: ranges along bearings, clockwise from true north, the first one and so much more for each.

    A range is infinite where nothing was met within ``reach_m``, NaN where a beam is left out. ``position`` is
    where the vehicle was. ``mates`` are the beams that ended on a vehicle of its team, once that was looked at.
    """

    vehicle: str
    time_s: float
    position: Position
    first_bearing_deg: float
    bearing_step_deg: float
    reach_m: float
    ranges_m: tuple[float, ...]
    source: str
    mates: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PingReport:
    """One ping of a swath sonar.

    ``position`` is where the sonar was. Roll is positive with starboard down, pitch with the nose up, heading clockwise
    from true north. ``angles_rad`` (b,) are the beams' angles across the track, from straight down in the vehicle and
    positive to starboard; ``ranges_m`` (b,) their slant ranges, NaN where nothing was detected.
    """

    vehicle: str
    time_s: float
    position: Position
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    angles_rad: NDArray[np.float32]
    ranges_m: NDArray[np.float32]
    source: str
    position_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class WaypointOrder:
    """One waypoint for one vehicle, checked by :mod:`app.missions.safety` before it reaches a link.

    ``lead`` lies on the leg's line beyond the waypoint, as far as the area and the keep-out zones allow. Vehicles that
    leave off flying straight well before their target (DUNE circles from 15 m on) are sent there to pass the waypoint
    itself; the waypoint stays the place where they arrive.

    ``circle`` is the centre of a circle, inside the area and apart from everything else, in which a vehicle that is led
    by whole legs may descend before it goes there; the radius is :data:`imc_bridge.control.plans.CIRCLE_RADIUS_M`.

    ``bottom`` is what the map knows of the sea floor on that way, below the surface as it is now and on the safe side.

    ``last`` tells that its vehicle is to stop there, for somebody to take it out of the water.
    """

    mission_id: str
    step: int
    vehicle: str
    position: Position
    speed_mps: float
    arrival_radius_m: float
    min_altitude_m: float
    lead: Position | None = None
    circle: Position | None = None
    bottom: tuple[Position, ...] = ()
    last: bool = False


@dataclass(frozen=True, slots=True)
class WaypointReport:
    """What became of a waypoint; ``reason`` is filled for every status that is not progress.

    ``begun`` is False where the service took the waypoint back before its vehicle made for it.
    """

    vehicle: str
    mission_id: str
    step: int
    status: WaypointStatus
    reason: str = ""
    begun: bool = True


@dataclass(frozen=True, slots=True)
class LinkReport:
    """A change of a vehicle's link, with a reason an operator can act on."""

    vehicle: str
    state: LinkState
    reason: str = ""
    goes_home: bool = False
    """It takes the way home that it keeps on board; engaging it ends that."""


class FaultKind(StrEnum):
    """What is broken on board."""

    LEAK = "leak"
    """Water where none should be."""
    ERROR = "error"
    """The vehicle has been in error for seconds."""


@dataclass(frozen=True, slots=True)
class FaultReport:
    """Something broke on board, told once, and once more with ``over`` when it is no longer broken."""

    vehicle: str
    time_s: float
    kind: FaultKind
    reason: str
    over: bool = False


@dataclass(frozen=True, slots=True)
class RestartReport:
    """What runs on board a vehicle has begun anew; ``reason`` says what was seen of that."""

    vehicle: str
    reason: str


FleetEvent = (
    VehicleReport
    | SoundingReport
    | RangeReport
    | SoundSpeedReport
    | ScanReport
    | PingReport
    | WaypointReport
    | LinkReport
    | FaultReport
    | RestartReport
)
EventSink = Callable[[FleetEvent], None]


@dataclass(frozen=True, slots=True)
class VehicleInfo:
    """What a link knows of a vehicle now. ``age_s`` is the time since it was last heard, None when never.

    ``position_age_s`` is the time since it last told where it is, None where that is not known apart from ``age_s``.
    """

    name: str
    kind: str
    state: LinkState
    reason: str = ""
    age_s: float | None = None
    position_age_s: float | None = None
    without_position: bool = False
    """It is heard, or was at the last contact, and does not tell where it is."""
    address: str | None = None
    imc_id: int | None = None
    report: VehicleReport | None = None
    goes_home: bool = False
    """It takes the way home that it keeps on board."""
    faults: tuple[FaultReport, ...] = ()
    """What is broken on board now."""
    details: dict[str, str] = field(default_factory=dict)
    advice: str = ""
    """What the operator should change about how it is used; told once in the mission's log."""
    machine_advice: str = ""
    """What is wrong on this machine with the way to it, and what to do; told once in the log of each mission."""

    @property
    def report_age_s(self) -> float | None:
        """How old its report is; without one when it was last heard, None when never."""
        return self.age_s if self.position_age_s is None else self.position_age_s


@dataclass(frozen=True, slots=True)
class StopReceipt:
    """Whether a vehicle acknowledged a stop, and in which words."""

    vehicle: str
    acknowledged: bool
    detail: str = ""


class VehicleRefusedError(Exception):
    """A vehicle cannot do what was asked. ``reason`` says why, ``remedy`` what to do about it."""

    def __init__(self, vehicle: str, reason: str, remedy: str) -> None:
        super().__init__(f"{vehicle}: {reason}; {remedy[:1].lower()}{remedy[1:]}")
        self.vehicle = vehicle
        self.reason = reason
        self.remedy = remedy


@dataclass(frozen=True, slots=True)
class LinkCapabilities:
    """What missions have to know of a link's vehicles beside how to command them."""

    simulated: bool = False
    """They live in this service, come into the world with their mission, and need nobody to look after them."""
    ready_before_start: bool = False
    """A mission starts only when they take commands; others come to us in their own time."""
    scans: bool = False
    """They tell by themselves what is around them; others have it posted."""
    keeps_depth: bool = False
    """They travel at the depth that their mission began with, whatever they are told."""
    flies_together: bool = False
    """They are led in steps of the whole team: nobody is sent on before all have told what they measured."""
    keeps_way_home: bool = False
    """They can keep a way home on board, which they take by themselves when nobody is heard any more."""
    stays_put: bool = False
    """Where they are to wait they are told to stop: they cannot be sent to a place for that."""
    circles_m: float = 0.0
    """From this distance on they circle about a waypoint in place of going straight to it, unless they can hover."""


@dataclass(frozen=True, slots=True)
class Deployment:
    """A vehicle as its mission takes it.

    ``berth`` returns latitude and longitude of a free place that the mission has for it to begin at, None where any
    will do; ``world`` what stands there beside the sea floor, None where nothing does. ``last_heard`` is what was heard
    last of one that is at sea for the mission already, with what its battery held.
    """

    vehicle: VehicleSpec
    mission_id: str
    mission: MissionSpec
    berth: Callable[[], tuple[float, float] | None]
    world: Callable[[], ObstacleWorld | None]
    last_heard: VehicleReport | None = None


class PolledVehicles(Protocol):
    """What a link whose vehicles ask over HTTP is told as their requests come in."""

    def doubt(self, report: VehicleReport) -> str:
        """Return why a vehicle cannot be where it says; '' where it can: then :meth:`heard` is called with it, too."""
        ...

    def heard(self, report: VehicleReport) -> None:
        """Take a position that a vehicle posted."""
        ...

    def has_waypoint(self, vehicle: str, step: int) -> None:
        """Note that a vehicle has the waypoint of ``step``."""
        ...

    def told_to_wait(self, vehicle: str) -> None:
        """Note that a vehicle was told to hold where it is for now."""
        ...

    def told_to_stop(self, vehicle: str, mission_id: str) -> None:
        """Note that a vehicle was told to stop."""
        ...


class FleetLink(ABC):
    """One way of reaching vehicles. Names of vehicles are unique within a link.

    Contract, tested for every implementation by ``tests/missions/fleet/test_interface.py``:

    * ``order`` replaces the vehicle's current waypoint, returns without waiting for the vehicle, and is followed by
      ``WaypointReport`` events (sent, acknowledged, reached) or by one with status ``refused`` and a reason.
      Repeating an equal order is harmless. Places to wait share a step: a later one replaces the one before.
    * ``stop`` makes the vehicle stop following, whatever it was doing, and is safe to repeat; it waits at most
      ``timeout_s`` (wall clock) for the vehicle's acknowledgement and never raises for a silent vehicle.
    * ``close`` stops every engaged vehicle first.
    """

    kind: ClassVar[str]
    """What a mission calls its vehicles' kind."""
    capabilities: ClassVar[LinkCapabilities] = LinkCapabilities()

    @property
    def console_id(self) -> int | None:
        """What plans of its vehicles are called by; None where they have none."""
        return None

    def know_peers(self, console_ids: frozenset[int]) -> None:  # noqa: B027 - most have none
        """Learn by which ids processes on our database have led vehicles: what those were given is ours to end."""

    @property
    def polled_vehicles(self) -> PolledVehicles | None:
        """Who is told of its vehicles' requests; None when they send none."""
        return None

    def check_deployment(self, vehicle: str) -> None:  # noqa: B027
        """Raise VehicleRefusedError where a vehicle could be deployed now for no mission."""

    async def prepare(self, deployment: Deployment) -> None:  # noqa: B027
        """Do beforehand what of ``deploy`` takes long, while other missions go on. Raises VehicleRefusedError."""

    def deploy(self, deployment: Deployment) -> None:  # noqa: B027
        """Prepare a vehicle for the mission that takes it; harmless to repeat. Raises VehicleRefusedError."""

    def end_deployment(self, deployment: Deployment) -> None:  # noqa: B027
        """Undo ``deploy``: the mission has ended."""

    @abstractmethod
    async def start(self, sink: EventSink) -> None:
        """Begin to listen; every event from now on goes to ``sink``."""

    @abstractmethod
    async def close(self) -> None:
        """Stop every engaged vehicle, then release sockets and tasks."""

    @abstractmethod
    def vehicles(self) -> Sequence[VehicleInfo]:
        """Every vehicle known to this link, in a stable order."""

    def vehicle(self, name: str) -> VehicleInfo | None:
        """Return one of them; None for one that was never heard of."""
        return next((info for info in self.vehicles() if info.name == name), None)

    @abstractmethod
    async def engage(self, vehicle: str) -> None:
        """Make the vehicle ready to follow waypoints of ours. Raises VehicleRefusedError."""

    @abstractmethod
    async def order(self, order: WaypointOrder) -> None:
        """Send a waypoint; see the class's contract. Raises VehicleRefusedError when the vehicle is not engaged."""

    @abstractmethod
    async def stop(self, vehicle: str, *, timeout_s: float = 3.0) -> StopReceipt:
        """Stop the vehicle; see the class's contract."""

    async def keep_way_home(
        self, vehicle: str, way: Sequence[Position], speed_mps: float, layer: DepthLayer = ALONE
    ) -> None:
        """Store a way home on board in place of the former one; return when the vehicle confirms it.

        Where the link knows of a bottom that leaves less room, or knows none, the way's depth follows from ``layer``:
        others go home above and below.

        It is armed while the vehicle is ours or lost: a stop disarms it, and the next ``engage`` arms it again. Raises
        VehicleRefusedError when it is not confirmed, or when the link's vehicles cannot keep one (``capabilities``).
        """
        raise VehicleRefusedError(vehicle, "vehicles of its kind keep no way home on board", "Bring it home yourself")

    async def drop_way_home(self, vehicle: str) -> None:  # noqa: B027 - most have none
        """Leave no way home on board. Raises VehicleRefusedError when that is not confirmed."""
