"""Systems that a DUNE node knows and sends to: announced ones, of which those in recent contact are active.

A system is known by its first Announce; one that comes back under the same id with another port stays ignored
until the node restarts, as on a real vehicle.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from simulator.network import Address

REFRESH_PERIOD_S = 5.0
"""How often the list of active systems is brought up to date."""

SILENCE_S = 30.0
"""After this long without a packet a system is not sent to any more."""

_SERVICE = re.compile(r"imc\+udp://([^:/;]+):(\d{1,5})/?")


@dataclass(slots=True)
class Contact:
    """One announced system."""

    imc_id: int
    name: str
    addresses: frozenset[Address]
    heard_at: Address | None = None
    heard_s: float = float("-inf")
    active: bool = False


def service_addresses(services: str) -> frozenset[Address]:
    """The ``imc+udp`` addresses of an announced services string; malformed ones are left out."""
    found = ((host, int(port)) for host, port in _SERVICE.findall(services))
    return frozenset((host, port) for host, port in found if 0 < port < 65536)


class Contacts:
    """The table of a node's contacts; times are the node's own (simulated) clock."""

    def __init__(self) -> None:
        self._known: dict[int, Contact] = {}
        self.destinations: list[tuple[int, Address]] = []
        """Present receivers of telemetry: ids and addresses."""

    def announced(self, imc_id: int, name: str, services: str) -> None:
        """Learn a system from its Announce; only the first counts."""
        addresses = service_addresses(services)
        if addresses and imc_id not in self._known:
            self._known[imc_id] = Contact(imc_id, name, addresses)

    def heard(self, imc_id: int, address: Address, now_s: float) -> Contact | None:
        """Note a packet. None when its sender never announced this address: the packet is to be dropped."""
        contact = self._known.get(imc_id)
        if contact is None or address not in contact.addresses:
            return None
        contact.heard_at = address
        contact.heard_s = now_s
        return contact

    def refresh(self, now_s: float) -> list[tuple[Contact, bool]]:
        """Bring the active systems up to date; returns those that changed, with their new state."""
        changed = []
        for contact in self._known.values():
            active = contact.heard_at is not None and now_s - contact.heard_s < SILENCE_S
            if active != contact.active:
                contact.active = active
                changed.append((contact, active))
        self.destinations = [
            (c.imc_id, c.heard_at) for c in self._known.values() if c.active and c.heard_at is not None
        ]
        return changed

    def name_of(self, imc_id: int) -> str:
        """A system's name, its id in hexadecimal where unknown."""
        contact = self._known.get(imc_id)
        return contact.name if contact is not None else f"0x{imc_id:04x}"
