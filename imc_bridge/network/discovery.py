"""Announces: systems on the network, their addresses, and our own announce."""

from __future__ import annotations

import ipaddress
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import imcpy

from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.network.transport import Address
from imc_bridge.printable import printable
from imc_bridge.settings import BridgeSettings

_SERVICE = re.compile(r"imc\+(udp|tcp)://([0-9.]+):(\d{1,5})/?")
MAX_ADDRESSES = 16
"""A node has a handful; more would only fill our tables."""
MAX_NAME = 64
"""Characters kept of a name."""
_VERSION_SERVICE = re.compile(r"imc\+info://[^/]*/version/([^/;]+)")
_UID_SERVICE = re.compile(r"dune://[^/]*/uid/(\d+)")
_RUN_SERVICE = re.compile(r"bathyfleet://[^/]*/uid/(\d+)")

VEHICLE_TYPES = frozenset({2, 3})
"""UUV and USV."""


@dataclass(frozen=True, slots=True)
class Announcement:
    """An Announce, understood."""

    imc_id: int
    name: str
    system_type: int
    addresses: tuple[Address, ...]
    """Where it takes IMC by UDP."""
    streams: tuple[Address, ...] = ()
    """Where it takes IMC by TCP."""
    imc_version: str | None = None
    uid: str | None = None
    """Changes whenever DUNE restarts."""
    run: str | None = None
    """Of a service like ours: differs from every other one's, and changes when it restarts."""
    lat_rad: float = 0.0
    lon_rad: float = 0.0
    """Where it is; both 0 when it does not know."""

    @property
    def is_vehicle(self) -> bool:
        """Whether it moves by itself in or on water."""
        return self.system_type in VEHICLE_TYPES


def read_announce(message: Message) -> Announcement:
    """Take an Announce apart; addresses that cannot be are left out."""
    services = text(message, "services")
    found: dict[str, list[Address]] = {"udp": [], "tcp": []}
    for kind, host, port_text in _SERVICE.findall(services):
        try:
            ip = ipaddress.IPv4Address(host)
        except ValueError:
            continue
        port, addresses = int(port_text), found[kind]
        if 0 < port <= 65535 and not ip.is_unspecified and (host, port) not in addresses:
            addresses.append((host, port))
    version = _VERSION_SERVICE.search(services)
    uid, run = _UID_SERVICE.search(services), _RUN_SERVICE.search(services)
    return Announcement(
        imc_id=int(message.src),
        name=printable(text(message, "sys_name"), most=MAX_NAME),
        system_type=int(message.sys_type),
        addresses=tuple(found["udp"][:MAX_ADDRESSES]),
        streams=tuple(found["tcp"][:MAX_ADDRESSES]),
        imc_version=printable(version.group(1), most=MAX_NAME) if version else None,
        uid=uid.group(1)[:MAX_NAME] if uid else None,
        run=run.group(1)[:MAX_NAME] if run else None,
        lat_rad=_finite(message.lat),
        lon_rad=_finite(message.lon),
    )


def reachable_first(announcement: Announcement, source_host: str, *, by_tcp: bool = False) -> tuple[Address, ...]:
    """The announced addresses, TCP's where wished and offered; the one on the announce's own host comes first."""
    offered = announcement.streams if by_tcp and announcement.streams else announcement.addresses
    return tuple(sorted(offered, key=lambda address: address[0] != source_host))


def own_announce(
    settings: BridgeSettings, addresses: Sequence[str], position_rad: tuple[float, float] = (0.0, 0.0), run: str = ""
) -> Message:
    """Our own Announce: a console reachable by UDP at each of ``addresses``; ``run`` tells it from others of its id.

    DUNE's simulation of a limited radio range takes the position of the *first* announce as ours for good: at 0, 0
    we would be out of range for ever.
    """
    message = imcpy.Announce()
    message.sys_name = settings.name
    message.sys_type = imcpy.SystemType.CCU
    message.owner = 0xFFFF
    message.lat, message.lon = position_rad
    services = [f"imc+udp://{address}:{settings.port}/" for address in addresses]
    message.services = ";".join(services + [f"bathyfleet://0.0.0.0/uid/{run}/"] * bool(run))
    return message


def _finite(value: float) -> float:
    return float(value) if math.isfinite(value) else 0.0
