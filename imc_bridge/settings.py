"""Everything that can be set about the IMC side, in one frozen place."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from typing import Literal

STANDARD_ANNOUNCE_PORTS = (30100, 30101, 30102, 30103, 30104)
STANDARD_MULTICAST_GROUP = "224.0.75.69"

DEFAULT_RATE_LIMITERS = (
    "Distance:5, EstimatedState:10, ServoPosition:0.1, EulerAngles:0.1, AngularVelocity:0.1, Acceleration:0.1"
)
"""Positions and depths often; seldom what makes up nine tenths of 710 packets a second and is of no use here."""

AltimeterGeometry = Literal["vertical", "body"]


@dataclass(frozen=True, slots=True)
class BridgeSettings:
    """How this console appears on the IMC network and how it drives vehicles.

    Every ``*_s`` value is in seconds of the vehicles' clock; with ``time_scale`` 20 a period of 1 s lasts 50 ms.

    Raises
    ------
    ValueError
        Naming the field, its value and what would be right.
    """

    imc_id: int = 0x3F01
    """Our IMC address. Vehicles remember an id with its port until they restart: keep both fixed."""
    name: str = "bathyfleet"
    port: int = 6101
    loopback_only: bool = False
    """Reach only vehicles on this machine; nothing goes out on any network."""
    interfaces: tuple[str, ...] = ()
    """IPv4 addresses of the interfaces to announce on; empty means all of them."""
    transport: Literal["udp", "tcp"] = "udp"
    """``tcp``: by TCP with every vehicle that offers it (DUNE's Transports.TCP.Server), by UDP with the others."""
    announce_ports: tuple[int, ...] = STANDARD_ANNOUNCE_PORTS
    multicast_group: str = STANDARD_MULTICAST_GROUP
    position_deg: tuple[float, float] | None = None
    """Where this console is, latitude and longitude; without it the first vehicle's position is announced."""
    vehicles: tuple[str, ...] = ()
    """Names of the vehicles to talk to; empty means every vehicle that announces itself."""
    allowed_ids: tuple[int, ...] = ()
    """IMC ids of the nodes to take up, vehicles and gateways; empty means every id."""
    allowed_addresses: tuple[str, ...] = ()
    """IPv4 addresses or networks to take packets from; empty means every address."""
    max_packets_per_s: int = 5000
    """Most packets a second of its own time from one vehicle's address; a LAUV sends 710 until asked for fewer."""
    time_scale: float = 1.0
    """How many times faster than the wall clock the vehicles live (simulations only)."""

    announce_period_s: float = 10.0
    heartbeat_period_s: float = 1.0
    reference_period_s: float = 1.0
    """A Reference has to reach a vehicle every 5 s or its plan fails."""
    telemetry_timeout_s: float = 10.0
    """An announced vehicle that sends nothing for this long is reported with the likely causes."""
    lost_after_s: float = 10.0
    release_after_s: float = 30.0
    """A vehicle silent for this long is no longer ours: its plan has ended by itself."""
    lost_after_wall_s: float = 1.0
    """Silence shorter than this on the wall clock is never a loss, whatever ``time_scale`` says."""

    plan_id: str = "bathyfleet"
    follow_timeout_s: float = 30.0
    loiter_radius_m: float = 7.5
    altitude_interval_m: float = 0.0
    """Part of the maneuver's specification, of which DUNE takes no notice."""
    engage_timeout_s: float = 15.0
    start_timeout_s: float = 10.0
    answer_timeout_s: float = 10.0
    """A live vehicle that leaves references unanswered for this long has its plan restarted."""
    max_restarts: int = 3
    restart_forgiven_after_s: float = 60.0
    depth_tolerance_m: float = 1.0

    rate_limiters: str = DEFAULT_RATE_LIMITERS
    """Asked of every engaged vehicle, the former value is restored afterwards; empty leaves rates alone."""
    state_events_per_s: float = 10.0
    """Most state reports per vehicle and second of the wall clock that are passed on."""

    altimeter: AltimeterGeometry = "vertical"
    """``vertical``: the range is the height above the bottom (DUNE's simulation); ``body``: fixed to the hull."""
    max_range_m: float = 200.0
    guard_radius_m: float = 20.0
    """Soundings within this distance of the vehicle count as the bottom near it."""
    guard_window_s: float = 30.0
    unknown_bottom_depth_m: float = 2.0
    """Deepest reference while no bottom has been measured near the vehicle."""

    def __post_init__(self) -> None:
        def check(field: str, good: bool, right: str) -> None:
            if not good:
                raise ValueError(f"{field} = {getattr(self, field)!r}: it must be {right}")

        check(
            "imc_id",
            0 < self.imc_id < 0xFFFF,
            "between 0x0001 and 0xFFFE",
        )
        check("name", bool(self.name) and len(self.name) <= 64, "1 to 64 characters")
        check("port", 0 < self.port <= 65535, "between 1 and 65535")
        ports = self.announce_ports
        check(
            "announce_ports",
            bool(ports) and all(0 < p <= 65535 for p in ports),
            "at least one port, 1 to 65535",
        )
        check(
            "multicast_group",
            _is_multicast(self.multicast_group),
            "an IPv4 multicast address such as 224.0.75.69",
        )
        check("interfaces", all(map(_is_ipv4, self.interfaces)), "IPv4 addresses of this machine's interfaces")
        check("allowed_ids", all(0 < i < 0xFFFF for i in self.allowed_ids), "ids between 0x0001 and 0xFFFE")
        check(
            "allowed_addresses",
            all(map(_is_network, self.allowed_addresses)),
            "IPv4 addresses or networks such as 10.0.10.0/24, without host bits",
        )
        check("max_packets_per_s", self.max_packets_per_s >= 100, "at least 100")
        check("time_scale", 0.01 <= self.time_scale <= 1000.0, "between 0.01 and 1000 (1 = real time)")
        check("reference_period_s", 0.0 < self.reference_period_s < 5.0, "below 5 s, or vehicles give up")
        check("plan_id", bool(self.plan_id), "a name that no other console uses")
        place = self.position_deg
        check(
            "position_deg",
            place is None or (len(place) == 2 and abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0),
            "latitude and longitude in degrees",
        )
        check("transport", self.transport in ("udp", "tcp"), "'udp' or 'tcp'")
        check("altimeter", self.altimeter in ("vertical", "body"), "'vertical' or 'body'")
        for field in (
            "announce_period_s",
            "heartbeat_period_s",
            "telemetry_timeout_s",
            "lost_after_s",
            "release_after_s",
            "follow_timeout_s",
            "engage_timeout_s",
            "start_timeout_s",
            "answer_timeout_s",
            "depth_tolerance_m",
            "max_range_m",
            "guard_radius_m",
            "guard_window_s",
            "state_events_per_s",
        ):
            check(field, getattr(self, field) > 0.0, "positive")


def _is_ipv4(text: str) -> bool:
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def _is_network(text: str) -> bool:
    try:
        ipaddress.IPv4Network(text)
    except ValueError:
        return False
    return True


def _is_multicast(text: str) -> bool:
    return _is_ipv4(text) and ipaddress.IPv4Address(text).is_multicast
