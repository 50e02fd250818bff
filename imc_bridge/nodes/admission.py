"""Which packets are admitted: IMC has no authentication, so addresses, ids and rates decide."""

from __future__ import annotations

import ipaddress
import math
from collections import Counter
from collections.abc import Callable
from functools import lru_cache

from imc_bridge.network.transport import Address
from imc_bridge.nodes.refusals import Refused
from imc_bridge.nodes.registry import NodeRegistry
from imc_bridge.settings import BridgeSettings

WINDOW_S = 1.0
STRANGERS_SHARE = 4
"""All systems at one host without an announce share this part of a vehicle's allowance."""
MAX_SOURCES = 1024
"""Sources of one window that are counted one by one; the others share a count."""
_TRAFFIC, _ANNOUNCES = 0, -1
"""In place of a port: all ports of a host that are strangers'."""


class Admission:
    """Lets packets in by address and amount, before they are read.

    Parameters
    ----------
    settings
    registry
        A system that announced an address has an allowance of its own there, which no other port can use up.
    clock
        Seconds of the wall clock that never step back.

    Attributes
    ----------
    refused : Counter[Refused]
    last : dict[Refused, str]
        Where the last one of them came from.
    last_at : dict[Refused, float]
        When that was, by ``clock``.
    """

    def __init__(self, settings: BridgeSettings, registry: NodeRegistry, clock: Callable[[], float]) -> None:
        self.refused: Counter[Refused] = Counter()
        self.last: dict[Refused, str] = {}
        self.last_at: dict[Refused, float] = {}
        self._registry = registry
        self._clock = clock
        self._networks = tuple(map(ipaddress.IPv4Network, settings.allowed_addresses))
        self._ids = frozenset(settings.allowed_ids)
        self._most = settings.max_packets_per_s * max(settings.time_scale, 1.0) * WINDOW_S
        self._counts: Counter[Address] = Counter()
        self._window = 0.0
        self._allowed = lru_cache(maxsize=MAX_SOURCES)(self._in_networks)

    def admits(self, address: Address, *, announce: bool = False) -> bool:
        """Whether a packet from ``address`` is read; ``announce``: one of the announce socket.

        Strangers' announces are counted apart, so that their other packets keep no newcomer out.
        """
        if self._networks and not self._allowed(address[0]):
            return self.refuse(Refused.ADDRESS, address)
        now = self._clock()
        if not self._window <= now < self._window + WINDOW_S:
            self._counts.clear()
            self._window = now
        known = self._registry.at(address) is not None
        source = address if known else (address[0], _ANNOUNCES if announce else _TRAFFIC)
        if source not in self._counts and len(self._counts) >= MAX_SOURCES:
            source = ("", _TRAFFIC)
        self._counts[source] += 1
        if self._counts[source] > (self._most if known else self._most / STRANGERS_SHARE):
            return self.refuse(Refused.FLOOD, address)
        return True

    def admits_id(self, imc_id: int, address: Address) -> bool:
        """Whether a node of this id is admitted."""
        return not self._ids or imc_id in self._ids or self.refuse(Refused.ID, address)

    def refuse(self, reason: Refused, address: Address) -> bool:
        """Count a packet that is not taken in; always False."""
        self.refused[reason] += 1
        self.last[reason] = f"{address[0]}:{address[1]}"
        self.last_at[reason] = self._clock()
        return False

    def age_s(self, reason: Refused) -> float:
        """Seconds of the wall clock since a packet was last refused for this reason; infinite when none was."""
        return self._clock() - self.last_at.get(reason, -math.inf)

    def _in_networks(self, host: str) -> bool:
        return any(ipaddress.IPv4Address(host) in network for network in self._networks)
