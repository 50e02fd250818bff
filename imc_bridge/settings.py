"""Everything that can be set about the IMC side, in one frozen place; what others offer of it derives from here."""

import difflib
import ipaddress
import math
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

STANDARD_ANNOUNCE_PORTS = (30100, 30101, 30102, 30103, 30104)
STANDARD_MULTICAST_GROUP = "224.0.75.69"

DEFAULT_RATE_LIMITERS = (
    "Distance:5, EstimatedState:10, ServoPosition:0.1, EulerAngles:0.1, AngularVelocity:0.1, Acceleration:0.1"
)
"""Positions and depths often; seldom what makes up nine tenths of 710 packets a second and is of no use here."""

_SUCH_RATES = "such as Distance:5, EstimatedState:10"

PLAN_NAME = "bathyfleet"
"""What the names of our plans begin with; earlier versions called every plan so."""

AltimeterGeometry = Literal["vertical", "body"]


def plan_name(imc_id: int) -> str:
    """What a console of this id calls its plans: two services on one network must not take each other's for theirs."""
    return f"{PLAN_NAME}-{imc_id:04X}"


def _multicast(text: str) -> str:
    if not ipaddress.IPv4Address(text).is_multicast:
        raise ValueError(f"{text} is no multicast address such as {STANDARD_MULTICAST_GROUP}")
    return text


def _hexadecimal(given: Any) -> Any:
    """Return the number of a text like 0x4001: as TOML has it, and the doctor tells ids."""
    text = given.strip().lower() if isinstance(given, str) else ""
    try:
        return int(text, 16) if text.startswith("0x") else given
    except ValueError:
        return given


def _rates(text: str) -> str:
    """Return what asks for rates as it is given. Raises ValueError where a vehicle could make nothing of it."""
    import imcpy  # few set it, and settings are read without the bridge

    for item in filter(str.strip, text.split(",")):
        name, _, rate = (part.strip() for part in item.partition(":"))
        if not name or not _is_rate(rate):
            raise ValueError(f"{item.strip()!r} is no message and its rate in Hz, {_SUCH_RATES}")
        kind = getattr(imcpy, name, None)
        if not (isinstance(kind, type) and issubclass(kind, imcpy.Message)):
            close = difflib.get_close_matches(name, dir(imcpy), n=1)
            meant = f": did you mean {close[0]}?" if close else ";"
            raise ValueError(f"{name!r} is no IMC message{meant} Rates are in Hz, {_SUCH_RATES}")
    return text


def _is_rate(text: str) -> bool:
    try:
        return 0 < float(text) < math.inf
    except ValueError:
        return False


def _address(text: str) -> str:
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise ValueError("use an IPv4 address such as 10.0.10.80") from None


def _network(text: str) -> str:
    try:
        ipaddress.IPv4Network(text)
    except ValueError:
        raise ValueError("use an IPv4 address or a network such as 10.0.10.0/24, without host bits") from None
    return text


Address = Annotated[str, AfterValidator(_address)]
Network = Annotated[str, AfterValidator(_network)]
ImcId = Annotated[int, Field(ge=1, le=0xFFFE), BeforeValidator(_hexadecimal)]
Port = Annotated[int, Field(ge=1, le=65535)]
Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Positive = Annotated[float, Field(gt=0)]


class ConsoleSettings(BaseModel):
    """What an operator may want to set. Keep id and port fixed: vehicles remember them until they restart."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(
        default="bathyfleet", min_length=1, max_length=64, description="Name under which this service announces itself"
    )
    id: ImcId = Field(default=0x3F01, description="Our IMC id, in the range of consoles")
    port: Port = Field(default=6101, description="UDP port on which we receive")
    announce_ports: tuple[Port, ...] = Field(
        default=STANDARD_ANNOUNCE_PORTS,
        min_length=1,
        description="UDP ports to which announces go; the first free one is listened on",
    )
    altimeter: AltimeterGeometry = Field(
        default="vertical",
        description="vertical: the altimeter measures straight down whatever the attitude, as DUNE's simulation does; "
        "body: it is fixed to the hull and leans with it",
    )
    loopback_only: bool = Field(default=False, description="Speak only to vehicles on this machine")
    interfaces: tuple[Address, ...] = Field(
        default=(), description="IPv4 addresses of the interfaces to speak on; empty: all, also those that come later"
    )
    transport: Literal["udp", "tcp"] = Field(
        default="udp", description="tcp: by TCP with vehicles that offer it, by UDP with the others"
    )
    position: tuple[Latitude, Longitude] | None = Field(
        default=None,
        description="Latitude and longitude that are announced as ours; without them the first vehicle's. "
        "DUNE's simulated radio range counts from there",
    )
    vehicles: tuple[str, ...] = Field(default=(), description="Names of the vehicles to talk to; empty: all")
    allowed_ids: tuple[ImcId, ...] = Field(
        default=(), description="IMC ids of the vehicles and gateways to listen to; empty: all"
    )
    allowed_addresses: tuple[Network, ...] = Field(
        default=(),
        description="IPv4 addresses or networks (10.0.10.0/24) to take IMC packets from; empty: all. "
        "127.0.0.0/8 has to be among them for vehicles on this machine",
    )
    max_packets_per_s: int = Field(
        default=5000,
        ge=100,
        le=1_000_000,
        description="Most IMC packets a second from one vehicle, multiplied by time_scale; all strangers at one "
        "address get a quarter of that",
    )
    rate_limiters: Annotated[str, AfterValidator(_rates)] = Field(
        default=DEFAULT_RATE_LIMITERS,
        description="Rates in Hz asked of every engaged vehicle and taken back at the end; empty: as they are",
    )
    unknown_bottom_depth_m: float = Field(
        default=2.0, ge=0, le=100, description="Deepest reference where no bottom is known"
    )


class BridgeSettings(ConsoleSettings):
    """How this console appears on the IMC network and how it drives vehicles.

    Every ``*_s`` value is in seconds of the vehicles' clock; with ``time_scale`` 20 a period of 1 s lasts 50 ms.
    """

    time_scale: float = Field(default=1.0, gt=0, le=1000)
    """How many times faster than the wall clock the vehicles live (simulations only)."""
    multicast_group: Annotated[str, AfterValidator(_multicast)] = STANDARD_MULTICAST_GROUP

    announce_period_s: Positive = 10.0
    heartbeat_period_s: Positive = 1.0
    reference_period_s: float = Field(default=1.0, gt=0, lt=5)
    """A Reference has to reach a vehicle every 5 s or its plan fails."""
    telemetry_timeout_s: Positive = 10.0
    """An announced vehicle that sends nothing for this long is reported with the likely causes."""
    lost_after_s: Positive = 10.0
    release_after_s: Positive = 30.0
    """A vehicle silent for this long is no longer ours: its plan has ended by itself."""
    lost_after_wall_s: float = 1.0
    """Silence shorter than this on the wall clock is never a loss, whatever ``time_scale`` says."""

    plan_id: str = Field(default_factory=lambda given: plan_name(given.get("id", 0)), min_length=1)
    """A name that no other console uses."""
    follow_timeout_s: Positive = 30.0
    loiter_radius_m: float = 7.5
    altitude_interval_m: float = 0.0
    """Part of the maneuver's specification, of which DUNE takes no notice."""
    engage_timeout_s: Positive = 15.0
    start_timeout_s: Positive = 10.0
    answer_timeout_s: Positive = 10.0
    """A live vehicle that leaves references unanswered for this long has its plan restarted."""
    max_restarts: int = 3
    restart_forgiven_after_s: float = 60.0
    depth_tolerance_m: Positive = 1.0

    state_events_per_s: Positive = 10.0
    """Most state reports per vehicle and second of the wall clock that are passed on."""

    max_range_m: Positive = 200.0
    guard_radius_m: Positive = 20.0
    """Soundings within this distance of the vehicle count as the bottom near it."""
    guard_window_s: Positive = 30.0

    def changed(self, **changes: object) -> Self:
        """Return other settings; what follows from a changed one follows again. Raises ValueError, naming the field."""
        given = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self).model_validate(given | changes)
