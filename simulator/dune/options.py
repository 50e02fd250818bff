"""Settings that the nodes of a fleet share."""

from __future__ import annotations

from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from simulator.dune.lost_comms import PLAN_NAME
from simulator.network import Address, NetworkFaults

DEFAULT_ANNOUNCE_PORTS = (30100, 30101, 30102, 30103, 30104)
BOOT_S = 5.0
IMC_VERSION = "5.4.31"


@dataclass(frozen=True, slots=True)
class DuneOptions:
    """Settings shared by the nodes of a fleet.

    Attributes
    ----------
    bind_address
        Where the imc+udp socket listens, and the announced address.
    announce_addresses, announce_ports
        Every combination gets the announce.
    faults
        Of the network, in both directions.
    chatter
        Also send servo positions, attitude and states of entities at full rate, as a real vehicle does.
    boot_s
        Vehicle time from start to service.
    static_destinations
        Addresses that get everything, known or not.
    imc_version
        As announced.
    tcp
        Also serve consoles by TCP.
    radio_range_m
        Above 0 the radio ends there, and at the surface.
    lost_comms_s
        For how long no console may be heard before a stored plan is started; 0: that supervisor is not enabled, as in
        DUNE's own configurations.
    lost_comms_plan
        What that plan is called.
    log_dir
        Where vehicles keep their logs, each in a folder of its name; none by default.
    """

    bind_address: str = "127.0.0.1"
    announce_addresses: tuple[str, ...] = ("127.0.0.1",)
    announce_ports: tuple[int, ...] = DEFAULT_ANNOUNCE_PORTS
    faults: NetworkFaults = field(default_factory=NetworkFaults)
    chatter: bool = False
    boot_s: float = BOOT_S
    static_destinations: tuple[Address, ...] = ()
    imc_version: str = IMC_VERSION
    tcp: bool = False
    radio_range_m: float = 0.0
    lost_comms_s: float = 0.0
    lost_comms_plan: str = PLAN_NAME
    log_dir: Path | None = None

    def __post_init__(self) -> None:
        try:
            unspecified = ip_address(self.bind_address).is_unspecified
        except ValueError:
            unspecified = True
        if unspecified:
            raise ValueError(
                f"bind address is {self.bind_address!r}; it must be an IP address of this host that consumers "
                "reach, because the announce tells it to them"
            )
