"""Finds out why an announced vehicle sends nothing: asks once more under ids that it cannot know yet.

A vehicle may drop our packets because it remembers our id at another port, or the answers may not get through to our
port. So it is asked under a fresh id from our own port, and under another from a port that the system chose. Who
answers to the first knew our id; who answers only to the second is kept from our port. Nothing is commanded.
"""

from __future__ import annotations

import asyncio
import random
from dataclasses import dataclass
from enum import StrEnum

import imcpy

from imc_bridge.bridge import Bridge
from imc_bridge.events import NodeState, NodeView
from imc_bridge.network.codec import Header, Message, encode, peek
from imc_bridge.network.discovery import own_announce
from imc_bridge.network.transport import LOOPBACK, Address

CONSOLE_IDS = range(0x4100, 0x5F00)
"""Ids of consoles that hardly anybody sets by hand."""
ANSWER_S = 8.0
"""A vehicle begins to send within 5 s of its discovery."""
REPEAT_S = 1.0
POLL_WALL_S = 0.05


class Answer(StrEnum):
    """How a silent vehicle answered."""

    TO_FRESH_ID = "to a fresh id on our port"
    ON_OTHER_PORT = "on another port only"
    NONE = "not at all"


@dataclass(frozen=True, slots=True)
class _Guise:
    imc_id: int
    port: int


class _Ear(asyncio.DatagramProtocol):
    """Notes whose packets arrive."""

    def __init__(self) -> None:
        self.heard: set[int] = set()
        self.transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if isinstance(transport, asyncio.DatagramTransport):
            self.transport = transport

    def datagram_received(self, data: bytes, addr: Address) -> None:
        header = peek(data)
        if isinstance(header, Header):
            self.heard.add(header.src)


async def probe(bridge: Bridge) -> dict[int, Answer]:
    """Ask every vehicle of which nothing but announces arrived.

    Parameters
    ----------
    bridge
        Started, and not commanding: vehicles that only know a fresh id would not obey it.

    Returns
    -------
    dict
        By IMC id; empty when no vehicle is silent.
    """
    silent = [node for node in bridge.nodes() if node.is_vehicle and _silent(node)]
    if not silent:
        return {}
    taken = {node.imc_id for node in bridge.nodes()} | {bridge.settings.id}
    first_id, second_id = random.sample([i for i in CONSOLE_IDS if i not in taken], 2)
    host = LOOPBACK if bridge.settings.loopback_only else "0.0.0.0"  # noqa: S104 - vehicles come from anywhere
    loop = asyncio.get_running_loop()
    other, ear = await loop.create_datagram_endpoint(_Ear, local_addr=(host, 0))
    try:
        guises = (
            _Guise(first_id, bridge.settings.port),
            _Guise(second_id, int(other.get_extra_info("sockname")[1])),
        )
        period = REPEAT_S / bridge.settings.time_scale
        ends = loop.time() + ANSWER_S / bridge.settings.time_scale + POLL_WALL_S
        due = loop.time()
        while loop.time() < ends and any(_silent(node) for node in _again(bridge, silent)):
            if loop.time() >= due:
                due += period
                _speak(bridge, other, guises, silent)
            await asyncio.sleep(min(POLL_WALL_S, period))
    finally:
        other.close()
    return {
        node.imc_id: Answer.TO_FRESH_ID
        if not _silent(node)
        else Answer.ON_OTHER_PORT
        if node.imc_id in ear.heard
        else Answer.NONE
        for node in _again(bridge, silent)
    }


def _silent(node: NodeView) -> bool:
    return node.state is NodeState.ANNOUNCED and node.age_s is None and bool(node.addresses)


def _again(bridge: Bridge, nodes: list[NodeView]) -> list[NodeView]:
    asked = {node.imc_id for node in nodes}
    return [node for node in bridge.nodes() if node.imc_id in asked]


def _speak(
    bridge: Bridge, other: asyncio.DatagramTransport, guises: tuple[_Guise, _Guise], nodes: list[NodeView]
) -> None:
    for guise in guises:
        settings = bridge.settings.changed(port=guise.port, id=guise.imc_id, name=f"{bridge.settings.name}-probe")
        bridge.transport.announce(
            lambda addresses, settings=settings: _packet(  # type: ignore[misc]
                bridge, own_announce(settings, addresses, bridge.position_rad()), settings.id, 0
            )
        )
    for node in nodes:
        for address in node.addresses:
            fresh, elsewhere = guises
            bridge.transport.send(_packet(bridge, imcpy.Heartbeat(), fresh.imc_id, node.imc_id), address)
            other.sendto(_packet(bridge, imcpy.Heartbeat(), elsewhere.imc_id, node.imc_id), address)


def _packet(bridge: Bridge, message: Message, src: int, dst: int) -> bytes:
    return encode(message, src=src, dst=dst, time_s=bridge.wall_time_s())
