"""Fake DUNE vehicles in this process, on a network that may be bad, and what they were told."""

import asyncio
import json
from collections import defaultdict
from typing import Any

import imcpy

from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.floors import seafloors
from simulator.network import NetworkFaults
from tests.support.faults.missions import FRAME, SIDE_M
from tests.support.ports import free_ports

NAMES, IDS = ("lauv-xplore-1", "lauv-xplore-2"), (0x1E, 0x1F)
OURS, OTHERS = 0x3F01, 0x3F02
ORDERS = (imcpy.Reference().msg_id, imcpy.PlanControl().msg_id)
FAR_M = 1.0
"""References further apart than this lead to different places."""


class Sea:
    """Two vehicles, each of which can vanish and come back.

    Parameters
    ----------
    speed
        Their seconds per second of the wall clock.
    faults
        Of the network, in both directions.
    """

    def __init__(self, *, speed: float, faults: NetworkFaults | None = None) -> None:
        self.speed = speed
        *self.announce_ports, self.port, self.other_port, base = free_ports(24)[:8]
        self._base_ports = (base, base + 6)
        self._faults = faults or NetworkFaults()
        self.floor = seafloors.generate(
            "harbour",
            0,
            width_m=SIDE_M + 20.0,
            height_m=SIDE_M + 20.0,
            origin=(FRAME.origin_lat_deg, FRAME.origin_lon_deg),
        )
        self._afloat: dict[str, DuneFleet] = {}
        self._left_at: dict[str, tuple[float, float, float]] = {}
        self.told: dict[str, list[Any]] = defaultdict(list)
        """The orders that reached each vehicle, by its name, in the order they were sent."""

    def settings(self, imc_id: int = OURS) -> dict[str, str]:
        """What a service needs to speak to them."""
        return {
            "IMC__ENABLED": "true",
            "IMC__LOOPBACK_ONLY": "true",
            "IMC__ANNOUNCE_PORTS": json.dumps(self.announce_ports),
            "IMC__PORT": str(self.port if imc_id == OURS else self.other_port),
            "IMC__ID": str(imc_id),
            "IMC__NAME": f"bathyfleet-{imc_id:04x}",
            "TIME_SCALE": f"{self.speed:g}",
        }

    async def launch(self, name: str) -> None:
        """Start a vehicle's DUNE, where it was left or at the area's edge."""
        number = NAMES.index(name)
        start = self._left_at.get(name, (20.0 + 20.0 * number, 5.0, 0.0))
        [spec] = default_specs(
            1, self.floor, names=(name,), ids=(IDS[number],), starts=(start,), base_port=self._base_ports[number]
        )
        options = DuneOptions(announce_ports=tuple(self.announce_ports), faults=self._faults)
        fleet = DuneFleet(self.floor, [spec], speed=self.speed, options=options, seed=number)
        node, receive = fleet.nodes[0], fleet.nodes[0].receive

        def tapped(data: bytes, sender: tuple[str, int]) -> None:
            if int.from_bytes(data[2:4], "little") in ORDERS:
                self.told[name].append(imcpy.Packet.deserialize(data))
            receive(data, sender)

        node.receive = tapped
        await fleet.start()
        self._afloat[name] = fleet

    async def vanish(self, name: str) -> None:
        """End a vehicle's DUNE without a word."""
        fleet = self._afloat.pop(name)
        here = fleet.nodes[0].vehicle.true_position
        self._left_at[name] = (here.east_m, here.north_m, 0.0)
        await fleet.stop()

    def say(self, name: str, message: imcpy.Message, port: int | None = None) -> None:
        """Let a vehicle say something that is not so, from its own socket and by its own clock."""
        fleet = self._afloat[name]
        node = fleet.nodes[0]
        message.src, message.timestamp = node.imc_id, fleet.clock.now()
        endpoint = node._endpoint
        assert endpoint is not None
        endpoint.send(bytes(message.serialize()), ("127.0.0.1", port or self.port))

    def destinations(self, name: str) -> list[tuple[float, float]]:
        """Where a vehicle was sent, metres east and north, in the order it was told; each place once in a row."""
        places: list[tuple[float, float]] = []
        for order in sorted(self.told[name], key=lambda order: float(order.timestamp)):
            if isinstance(order, imcpy.Reference) and order.flags & imcpy.Reference.FlagsBits.LOCATION:
                lat, lon = (angle * 57.29577951308232 for angle in (order.lat, order.lon))
                east, north = self.floor.frame.to_local(lat, lon)
                if not places or abs(places[-1][0] - east) + abs(places[-1][1] - north) > FAR_M:
                    places.append((east, north))
        return places

    def commanders(self, name: str) -> set[int]:
        """Who sent a vehicle orders."""
        return {int(order.src) for order in self.told[name]}

    async def __aenter__(self) -> "Sea":
        for name in NAMES:
            await self.launch(name)
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.gather(*(self.vanish(name) for name in list(self._afloat)))


def imc_vehicles(*names: str) -> list[dict[str, Any]]:
    """Vehicles for a mission's description."""
    return [{"name": name, "kind": "imc", "depth_m": 2.0 + NAMES.index(name)} for name in names or NAMES]


LIMITS = {"max_step_m": 15.0, "min_vertical_separation_m": 1.0, "min_altitude_m": 2.0}
