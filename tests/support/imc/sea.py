"""A small sea with real sockets: fake DUNE vehicles and a bridge on ports of their own."""

import gzip
import json
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import imcpy

from imc_bridge import Bridge, BridgeEvent, BridgeSettings, NodeState, Waypoint, WaypointChange, WaypointStatus
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.fleet import EQUIPMENT
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.network import NetworkFaults
from simulator.water_column import SeaWater
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 20.0
Event = TypeVar("Event")


@dataclass
class Sea:
    """Vehicles, a bridge and what it reported."""

    floor: Terrain
    settings: BridgeSettings
    base_port: int
    vehicles: int
    faults: NetworkFaults = field(default_factory=NetworkFaults)
    equipment: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    clock_offset_s: float = 0.0
    current: tuple[float, float] = (0.0, 0.0)
    bridge: Bridge = field(init=False)
    running: DuneFleet | None = None
    events: list[BridgeEvent] = field(default_factory=list)

    async def launch(self) -> None:
        """Start (or restart) the vehicles' DUNEs."""
        specs = default_specs(self.vehicles, self.floor, base_port=self.base_port)
        options = DuneOptions(announce_ports=self.settings.announce_ports, faults=self.faults, **self.options)
        self.running = DuneFleet(
            self.floor,
            specs,
            replace(EQUIPMENT, **self.equipment),
            speed=self.settings.time_scale,
            options=options,
            clock_offset_s=self.clock_offset_s,
            water=SeaWater(self.current),
        )
        await self.running.start()

    @property
    def fleet(self) -> DuneFleet:
        """The vehicles' DUNEs, which run."""
        assert self.running is not None
        return self.running

    async def vanish(self) -> None:
        """Kill the vehicles' DUNEs."""
        if self.running is not None:
            await self.running.stop()
            self.running = None

    async def connect(self, **changes: Any) -> Bridge:
        """Start a bridge; the former one must be closed."""
        self.settings = self.settings.changed(**changes)
        self.bridge = Bridge(self.settings)
        await self.bridge.start(self.events.append)
        return self.bridge

    def of(self, kind: type[Event]) -> list[Event]:
        """Events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def state(self, name: str) -> NodeState | None:
        """State of a node by name."""
        return next((node.state for node in self.bridge.nodes() if node.name == name), None)

    async def ready(self) -> list[str]:
        """Names of the vehicles once all are ready."""
        await until(
            lambda: sum(node.state is NodeState.READY for node in self.bridge.nodes()) == self.vehicles, "all are ready"
        )
        return [node.name for node in self.bridge.nodes()]

    def waypoint(self, step: int, east_m: float, north_m: float, depth_m: float, **changes: Any) -> Waypoint:
        """A waypoint by its place in the terrain."""
        lat, lon = self.floor.frame.to_geodetic(east_m, north_m)
        return Waypoint("test", step, lat, lon, depth_m, **changes)

    def statuses(self, name: str, step: int) -> list[WaypointStatus]:
        """The life of one vehicle's waypoint so far."""
        changes = self.of(WaypointChange)
        return [change.status for change in changes if change.vehicle == name and change.waypoint.step == step]

    async def reached(self, name: str, step: int) -> None:
        """Wait until a waypoint was reached."""
        await until(lambda: WaypointStatus.REACHED in self.statuses(name, step), f"{name} has reached step {step}")


@asynccontextmanager
async def open_sea(
    vehicles: int = 1,
    loss: float = 0.0,
    speed: float = SPEED,
    family: str = "harbour",
    clock_offset_s: float = 0.0,
    connected: bool = True,
    bridge: dict[str, Any] | None = None,
    equipment: dict[str, Any] | None = None,
    current: tuple[float, float] = (0.0, 0.0),
    **options: Any,
) -> AsyncIterator[Sea]:
    """A sea with its vehicles ready to be engaged; ``options`` are those of the fake DUNEs.

    With ``connected`` false nobody listens on the bridge's ports yet.
    """
    *announce_ports, port, base_port = free_ports(7)
    changes = {"loopback_only": True} | (bridge or {})
    settings = BridgeSettings(port=port, announce_ports=tuple(announce_ports), time_scale=speed, **changes)
    floor = seafloors.generate(family, 0, width_m=100.0, height_m=100.0)
    sea = Sea(
        floor,
        settings,
        base_port,
        vehicles,
        NetworkFaults(loss=loss),
        equipment or {},
        options,
        clock_offset_s,
        current,
    )
    sea.bridge = Bridge(settings)
    if connected:
        await sea.launch()
        await sea.connect()
    try:
        yield sea
    finally:
        await sea.bridge.close()
        await sea.vanish()


class Peer:
    """A hand-driven system: two sockets, nothing automatic."""

    def __init__(self, settings: BridgeSettings, imc_id: int = 0x1E, name: str = "lauv-noptilus-1") -> None:
        self.settings = settings
        self.imc_id = imc_id
        self.name = name
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", 0))
        self.sock.setblocking(False)
        self.received: list[imcpy.Message] = []

    @property
    def services(self) -> str:
        return (
            f"dune://0.0.0.0/uid/1;imc+info://0.0.0.0/version/5.4.31;imc+udp://127.0.0.1:{self.sock.getsockname()[1]}/"
        )

    def announce(self, port: int | None, **changes: Any) -> None:
        message = imcpy.Announce()
        message.sys_name, message.sys_type, message.services = self.name, imcpy.SystemType.UUV, self.services
        for attribute, value in changes.items():
            setattr(message, attribute, value)
        self.send(message, port)

    def send(self, message: imcpy.Message, port: int | None = None) -> None:
        message.src, message.dst, message.timestamp = self.imc_id, 0xFFFF, 1.7e9
        self.sock.sendto(imcpy.Packet.serialize(message), ("127.0.0.1", port or self.settings.port))

    def take(self, kind: str) -> list[imcpy.Message]:
        while True:
            try:
                packet, _ = self.sock.recvfrom(65536)
            except BlockingIOError:
                return [m for m in self.received if type(m).__name__ == kind]
            self.received.append(imcpy.Packet.deserialize(packet))

    def close(self) -> None:
        self.sock.close()


@dataclass(frozen=True)
class Recorded:
    """One recorded packet."""

    time_s: float
    src: tuple[str, int]
    dst: tuple[str, int]
    packet: bytes


def read_capture(path: Path) -> Iterator[Recorded]:
    """Packets of one recorded session."""
    with gzip.open(path, "rt") as lines:
        for line in lines:
            item = json.loads(line)
            src, dst = item["src"].split(":"), item["dst"].split(":")
            yield Recorded(item["t"], (src[0], int(src[1])), (dst[0], int(dst[1])), bytes.fromhex(item["hex"]))
