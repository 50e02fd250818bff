"""Nodes over real UDP, with a console that repeats itself until it is understood."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import imcpy
import numpy as np
import pytest

from simulator.clock import SimulationClock
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.dune.node import FakeDune
from simulator.floors import seafloors
from simulator.network import NetworkFaults, UdpEndpoint
from tests.support.imc.dune_bench import CONSOLE_ID, announce, rate_limiters, reference, start_request, stop_request
from tests.support.ports import free_ports

FLOOR = seafloors.generate("harbour", 0)
SPEED = 10.0


def fleet_of(count: int, **kwargs: Any) -> DuneFleet:
    announce_port, listen_port, *ports = free_ports(2 + count)
    options = DuneOptions(
        announce_ports=(announce_port, listen_port), faults=kwargs.pop("faults", NetworkFaults()), boot_s=1.0
    )
    specs = [
        type(spec)(spec.name, spec.imc_id, port, spec.start)
        for spec, port in zip(default_specs(count, FLOOR), ports, strict=True)
    ]
    return DuneFleet(FLOOR, specs, speed=SPEED, options=options, **kwargs)


class Console:
    """Announces itself, beats, and keeps the last message of each kind from each system."""

    def __init__(self, fleet: DuneFleet) -> None:
        self.fleet = fleet
        self.heard: dict[Any, Any] = {}
        self.announces: list[Any] = []
        self.times: dict[Any, Any] = {}

    async def __aenter__(self) -> "Console":
        self.socket = await UdpEndpoint.open(("127.0.0.1", 0), self._take)
        # The fleet listens on the first announce port; announces for consumers go to the second as well.
        self.ear = await UdpEndpoint.open(("127.0.0.1", self.fleet.options.announce_ports[1]), self._hear)
        self.beating = asyncio.create_task(self._beat())
        return self

    async def __aexit__(self, *_: Any) -> None:
        self.beating.cancel()
        self.socket.close()
        self.ear.close()
        await asyncio.sleep(0)

    def _take(self, data: bytes, address: tuple[str, int]) -> None:
        message = imcpy.Packet.deserialize(data)
        self.heard[(message.src, type(message))] = message
        self.times.setdefault((message.src, type(message)), []).append(message.timestamp)

    def _hear(self, data: bytes, address: tuple[str, int]) -> None:
        self.announces.append(imcpy.Packet.deserialize(data))

    async def _beat(self) -> None:
        while True:
            message = announce(CONSOLE_ID, self.socket.address).serialize()
            self.socket.send(message, ("127.0.0.1", self.fleet.options.announce_ports[0]))
            for node in self.fleet.nodes:
                self.say(node, imcpy.Heartbeat())
            await asyncio.sleep(0.05)

    def say(self, node: FakeDune, message: imcpy.Message) -> None:
        message.src, message.src_ent, message.dst = CONSOLE_ID, 0, node.imc_id
        self.socket.send(message.serialize(), node.address)

    def last(self, node: FakeDune, kind: type[Any]) -> imcpy.Message | None:
        return self.heard.get((node.imc_id, kind))

    async def until(self, condition: Callable[..., Any], repeat: Callable[..., Any] = lambda: None) -> None:
        async with asyncio.timeout(60):
            while not condition():
                repeat()
                await asyncio.sleep(0.03)

    def state(self, node: FakeDune) -> tuple[Any, ...]:
        vehicle, plan = self.last(node, imcpy.VehicleState), self.last(node, imcpy.PlanControlState)
        return (vehicle and int(vehicle.op_mode), plan and int(plan.state))

    async def engage(self, node: FakeDune) -> None:
        await self.until(lambda: self.state(node) == (0, 1))
        await self.until(lambda: self.state(node) == (3, 3), lambda: self.say(node, start_request()))

    async def fly(self, node: FakeDune, east: float, north: float, depth: float) -> None:
        lat, lon = FLOOR.frame.to_geodetic(east, north)

        def arrived() -> Any:
            state = self.last(node, imcpy.FollowRefState)
            return state is not None and int(state.state) == 3 and state.reference.z.value == depth

        await self.until(arrived, lambda: self.say(node, reference(lat, lon, depth)))

    async def stop(self, node: FakeDune) -> None:
        await self.until(lambda: self.state(node) == (0, 1), lambda: self.say(node, stop_request()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "faults",
    [NetworkFaults(), NetworkFaults(loss=0.2, delay_s=0.005, jitter_s=0.01, duplicate=0.2, reorder=0.2)],
    ids=["perfect", "faulty"],
)
async def test_two_vehicles_are_found_flown_and_stopped(faults: NetworkFaults) -> None:
    async with fleet_of(2, faults=faults) as fleet, Console(fleet) as console:
        await console.until(lambda: {m.src for m in console.announces} == {0x0101, 0x0102})
        for k, node in enumerate(fleet.nodes):
            await console.engage(node)
            start = node.vehicle.true_position
            await console.fly(node, start.east_m, start.north_m + 22.0, 1.0)
            assert node.vehicle.true_position.depth_m == pytest.approx(1.0, abs=1.1), k
            await console.stop(node)
        assert not any(node.vehicle.collided for node in fleet.nodes)


async def test_vehicle_time_runs_at_the_asked_speed_from_the_wall_clock() -> None:
    loop = asyncio.get_running_loop()
    async with fleet_of(1) as fleet, Console(fleet) as console:
        node = fleet.nodes[0]
        await console.until(lambda: console.last(node, imcpy.EstimatedState))
        console.say(node, rate_limiters("EstimatedState:10"))
        wall, vehicle = loop.time(), fleet.clock.now()
        await console.until(lambda: console.last(node, imcpy.EstimatedState).timestamp > vehicle + 10.0)
        lost = fleet.clock.lost_s
        assert (loop.time() - wall) * SPEED >= 10.0 - 1.0
        times = np.array(console.times[(node.imc_id, imcpy.EstimatedState)])
        assert (np.diff(times) > 0).all()
        assert lost >= 0.0


async def test_the_fleet_describes_itself() -> None:
    async with fleet_of(2) as fleet:
        told = fleet.describe()
        assert [v["name"] for v in told["vehicles"]] == ["lauv-sim-1", "lauv-sim-2"]
        assert [v["imc_id"] for v in told["vehicles"]] == [0x0101, 0x0102]
        for vehicle, node in zip(told["vehicles"], fleet.nodes, strict=True):
            assert (vehicle["host"], vehicle["port"]) == node.address
            here = FLOOR.frame.to_local(vehicle["lat"], vehicle["lon"])
            assert here == pytest.approx((node.vehicle.true_position.east_m, 5.0), abs=1e-6)


async def test_all_sockets_are_released() -> None:
    fleet = fleet_of(2)
    taken = []
    for _ in range(2):
        async with fleet:
            taken.append([node.address for node in fleet.nodes])
        await asyncio.sleep(0)
    assert taken[0] == taken[1], "a port that is still taken is passed over"


async def test_a_taken_port_is_passed_over() -> None:
    fleet = fleet_of(1)
    first = fleet.nodes[0].first_port
    blocker = await UdpEndpoint.open(("127.0.0.1", first), lambda data, address: None)
    try:
        async with fleet:
            assert first < fleet.nodes[0].address[1] < first + 5
    finally:
        blocker.close()


async def test_taken_announce_ports_are_named() -> None:
    fleet = fleet_of(1)
    ports = fleet.options.announce_ports
    blockers = [await UdpEndpoint.open(("127.0.0.1", p), lambda data, address: None) for p in ports]
    try:
        with pytest.raises(OSError, match=f"{ports[0]}, {ports[1]}"):
            await fleet.start()
    finally:
        for blocker in blockers:
            blocker.close()


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"count": 0}, "vehicles is 0"),
        ({"count": 1, "names": ["a", "b"]}, "names gives 2 values for 1"),
        ({"count": 2, "names": ["a", "a"]}, "names holds a value twice"),
        ({"count": 2, "ids": [0x0102]}, "ids holds a value twice"),
    ],
)
def test_impossible_fleets_are_refused(kwargs: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        default_specs(terrain=FLOOR, **kwargs)


@pytest.mark.parametrize("address", ["0.0.0.0", "somewhere", ""])
def test_an_address_that_nobody_could_answer_is_refused(address: str) -> None:
    with pytest.raises(ValueError, match="bind address"):
        DuneOptions(bind_address=address)


def test_the_clock_leaves_out_what_it_cannot_keep_up_with() -> None:
    wall = [100.0]
    clock = SimulationClock(20.0, start_s=0.0, monotonic=lambda: wall[0])
    wall[0] += 2.0
    assert clock.now() == pytest.approx(40.0)
    clock.give_up(15.0)
    assert clock.now() == pytest.approx(25.0)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, 1e9])
def test_impossible_speeds_are_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="speed is"):
        SimulationClock(speed)
