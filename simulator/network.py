"""UDP sockets for asyncio over a network that may lose, delay, duplicate and reorder packets."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

log = logging.getLogger(__name__)

Address = tuple[str, int]
PacketHandler = Callable[[bytes, Address], None]


@dataclass(frozen=True, slots=True)
class NetworkFaults:
    """How bad the network is. Probabilities are per packet and direction, times are wall-clock seconds.

    Attributes
    ----------
    loss, duplicate, reorder
        Probabilities within 0 to 1. A reordered packet is held back until later ones have overtaken it.
    delay_s, jitter_s
        Every packet takes ``delay_s`` plus a uniform share of ``jitter_s``.
    hold_s
        How long a reordered packet is held back.
    blocked_ports
        Ports of others that a firewall lets nothing to or from.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    hold_s: float = 0.05
    blocked_ports: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        for name in ("loss", "duplicate", "reorder"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"network: {name} is {value}; it must be a probability within 0 to 1")
        for name in ("delay_s", "jitter_s", "hold_s"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"network: {name} is {value}; it must be 0 or more seconds")

    @property
    def perfect(self) -> bool:
        """Whether packets simply arrive."""
        return not (self.loss or self.delay_s or self.jitter_s or self.duplicate or self.reorder)

    def fate(self, rng: np.random.Generator) -> tuple[float, ...]:
        """Delays of the copies of one packet that arrive: empty when lost, two when duplicated."""
        if rng.random() < self.loss:
            return ()
        copies = 2 if rng.random() < self.duplicate else 1
        return tuple(
            self.delay_s + self.jitter_s * rng.random() + (self.hold_s if rng.random() < self.reorder else 0.0)
            for _ in range(copies)
        )


class Endpoint(Protocol):
    """What a node needs of a socket."""

    @property
    def address(self) -> Address:
        """The local address."""
        ...

    def send(self, data: bytes, to: Address) -> None:
        """Send a packet."""
        ...

    def close(self) -> None:
        """Release the socket."""
        ...


@dataclass(slots=True)
class PacketCounts:
    """What an endpoint saw: handed over to and by its user, and lost on the way in either direction."""

    sent: int = 0
    received: int = 0
    lost: int = 0


class UdpEndpoint(asyncio.DatagramProtocol):
    """One UDP socket whose traffic, in both directions, passes through the faults.

    Use :meth:`open`; the socket is taken exclusively.
    """

    def __init__(self, handler: PacketHandler, faults: NetworkFaults, rng: np.random.Generator) -> None:
        self.counts = PacketCounts()
        self._handler = handler
        self._faults = faults
        self._perfect = faults.perfect
        self._rng = rng
        self._transport: asyncio.DatagramTransport | None = None
        self._timers: set[asyncio.TimerHandle] = set()

    @classmethod
    async def open(
        cls,
        address: Address,
        handler: PacketHandler,
        *,
        faults: NetworkFaults | None = None,
        rng: np.random.Generator | None = None,
        broadcast: bool = False,
    ) -> UdpEndpoint:
        """Bind a socket. Raises OSError when the port is taken."""
        loop = asyncio.get_running_loop()
        generator = rng if rng is not None else np.random.default_rng(0)
        _, protocol = await loop.create_datagram_endpoint(
            lambda: cls(handler, faults or NetworkFaults(), generator),
            local_addr=address,
            allow_broadcast=broadcast,
        )
        return protocol

    @property
    def address(self) -> Address:
        """The local address."""
        if self._transport is None:
            raise RuntimeError("the endpoint is closed")
        host, port = self._transport.get_extra_info("sockname")[:2]
        return str(host), int(port)

    def send(self, data: bytes, to: Address) -> None:
        """Send a packet; silently nothing once closed."""
        self.counts.sent += 1
        if to[1] in self._faults.blocked_ports:
            self.counts.lost += 1
            return
        if self._perfect:
            self._put(data, to)
            return
        self._pass(lambda: self._put(data, to))

    def set_option(self, level: int, option: int, value: bytes) -> None:
        """Set an option of the socket."""
        if self._transport is None:
            raise RuntimeError("the endpoint is closed")
        self._transport.get_extra_info("socket").setsockopt(level, option, value)

    def close(self) -> None:
        """Release the socket and forget packets under way."""
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport."""
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Hand a packet to the user, through the faults."""
        if addr[1] in self._faults.blocked_ports:
            self.counts.lost += 1
            return
        if self._perfect:
            self._deliver(data, addr)
            return
        self._pass(lambda: self._deliver(data, addr))

    def error_received(self, exc: Exception) -> None:
        """Note that a peer's port is closed (ICMP); it may open again."""
        log.debug("peer unreachable: %s", exc)

    def _deliver(self, data: bytes, addr: tuple[str, int]) -> None:
        if self._transport is None:
            return
        self.counts.received += 1
        self._handler(data, (addr[0], addr[1]))

    def _put(self, data: bytes, to: Address) -> None:
        if self._transport is not None:
            self._transport.sendto(data, to)

    def _pass(self, action: Callable[[], None]) -> None:
        delays = self._faults.fate(self._rng)
        if not delays:
            self.counts.lost += 1
        for delay in delays:
            if delay <= 0.0:
                action()
                continue
            self._later(delay, action)

    def _later(self, delay_s: float, action: Callable[[], None]) -> None:
        def fire() -> None:
            self._timers.discard(timer)
            action()

        timer = asyncio.get_running_loop().call_later(delay_s, fire)
        self._timers.add(timer)
