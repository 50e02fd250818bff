"""Many forged systems on the network: the real ones keep their places, and find one when they come later.

Every packet goes through real sockets. The forgers speak from 127.0.0.2 and other addresses of this machine, or from
the vehicle's own.
"""

import asyncio
import dataclasses
import tracemalloc
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, NodeState
from imc_bridge.doctor.diagnosis import Diagnosis
from imc_bridge.doctor.doctor import Cause, judge
from imc_bridge.events import NodeView
from imc_bridge.network.discovery import Announcement
from imc_bridge.nodes.capacity import MAX_NODES, MAX_UNANNOUNCED, MAX_UNANNOUNCED_OF_HOST, MAX_UNHEARD_OF_HOST
from imc_bridge.nodes.newcomers import MAX_NEWCOMERS, MAX_NEWCOMERS_OF_HOST, Newcomers
from imc_bridge.nodes.refusals import Refused
from imc_bridge.nodes.registry import NodeRegistry
from simulator.dune import default_specs
from simulator.floors import seafloors
from tests.support.imc.sea import open_sea
from tests.support.imc.speaker import Speaker
from tests.support.ports import free_ports
from tests.support.waiting import until

FIRST_FORGED = 0x2000
HOSTS = tuple(f"127.0.0.{last}" for last in range(2, 12))


@asynccontextmanager
async def listening(**changes: Any) -> AsyncIterator[Any]:
    *announce_ports, port = free_ports(4)
    settings = BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports), **changes)
    bridge = Bridge(settings)
    await bridge.start(lambda event: None)
    try:
        yield bridge
        assert not bridge.handler_errors
    finally:
        await bridge.close()


class Forger:
    """Sends under any number of ids from one socket."""

    def __init__(self, bridge: Bridge, host: str = "127.0.0.2") -> None:
        self.speaker = Speaker(bridge, host=host)
        self.sent = 0

    async def _pause(self) -> None:
        self.sent += 1
        if self.sent % 50 == 0:
            await asyncio.sleep(0)  # the bridge reads meanwhile, so that its socket's buffer does not overflow

    async def heartbeats(self, count: int, first: int = FIRST_FORGED) -> None:
        for number in range(count):
            self.speaker.imc_id = first + number
            self.speaker.send(imcpy.Heartbeat())
            await self._pause()

    async def announces(self, count: int, first: int = FIRST_FORGED, name: str = "forged") -> None:
        for number in range(count):
            self.speaker.imc_id, self.speaker.name = first + number, f"{name}-{first + number:x}"
            self.speaker.announce()
            await self._pause()

    def close(self) -> None:
        self.speaker.close()


def judged(bridge: Bridge) -> Diagnosis:
    return judge(bridge, 1.0)


def node_of(bridge: Bridge, imc_id: int) -> NodeView | None:
    return next((node for node in bridge.nodes() if node.imc_id == imc_id), None)


async def read(bridge: Bridge) -> None:
    """Wait until every packet that was sent has been read: ours, sent last, is among them."""
    last = Speaker(bridge, host="127.0.0.99", imc_id=0x7777)
    seen = sum(bridge.announces.decoded.values())
    last.announce()
    await until(lambda: sum(bridge.announces.decoded.values()) > seen, "the announces were read")
    last.close()


async def test_heartbeats_of_strangers_take_no_place_of_a_vehicle_that_comes_later() -> None:
    async with listening() as bridge:
        forger = Forger(bridge)
        await forger.heartbeats(400)
        await until(lambda: bridge.admission.refused[Refused.CROWDED] >= 300, "there were too many")
        assert len(bridge.nodes()) <= MAX_UNANNOUNCED
        assert Cause.CROWDED in judged(bridge).causes
        assert "127.0.0.2:" in judged(bridge).text()
        vehicle = Speaker(bridge)
        vehicle.announce()
        await until(lambda: node_of(bridge, vehicle.imc_id) is not None, "the vehicle is known")
        assert node_of(bridge, vehicle.imc_id).name == "lauv-noptilus-1"
        vehicle.swim()
        await until(lambda: node_of(bridge, vehicle.imc_id).report is not None, "it is heard")
        forger.close()
        vehicle.close()


async def test_one_host_does_not_hide_the_unannounced_vehicles_of_another() -> None:
    async with listening() as bridge:
        forger, vehicle = Forger(bridge), Speaker(bridge, host="127.0.0.3", imc_id=0x1E)
        await forger.heartbeats(100)
        await until(lambda: bridge.admission.refused[Refused.CROWDED] >= 80, "there were too many")
        assert len(bridge.nodes()) == MAX_UNANNOUNCED_OF_HOST
        vehicle.send(imcpy.Heartbeat())
        await until(lambda: node_of(bridge, 0x1E) is not None, "the operator is told of it")
        assert Cause.NO_ANNOUNCE in judged(bridge).causes
        forger.close()
        vehicle.close()


async def test_forged_announces_from_many_hosts_do_not_displace_a_vehicle_that_is_heard() -> None:
    async with listening() as bridge:
        vehicle = Speaker(bridge)
        vehicle.announce()
        await until(lambda: bool(bridge.nodes()), "it is known")
        vehicle.swim()
        await until(lambda: bridge.nodes()[0].report is not None, "it is heard")
        forgers = [Forger(bridge, host) for host in HOSTS]
        for index, forger in enumerate(forgers):
            await forger.announces(200, first=FIRST_FORGED + 0x100 * index)
        await read(bridge)
        assert len(bridge.nodes()) <= MAX_NODES
        assert Cause.CROWDED in judged(bridge).causes
        vehicle.swim()
        reported = node_of(bridge, vehicle.imc_id)
        assert reported is not None
        assert reported.state is not NodeState.LOST
        for forger in forgers:
            forger.close()
        vehicle.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.50"])
async def test_vehicle_that_comes_after_forged_announces_has_a_place_once_it_is_heard(host: str) -> None:
    """Also from a forger's own address: who is heard has precedence over who only announces."""
    async with listening() as bridge:
        forgers = [Forger(bridge, name) for name in ("127.0.0.1", *HOSTS)]
        for index, forger in enumerate(forgers):
            await forger.announces(100, first=FIRST_FORGED + 0x100 * index)
        await read(bridge)
        vehicle = Speaker(bridge, host=host)
        vehicle.sock.settimeout(20.0)
        vehicle.announce()
        # We speak to it although it has no place yet, or it would never speak to us.
        heartbeat = await asyncio.to_thread(vehicle.sock.recv, 2048)
        assert imcpy.Packet.deserialize(heartbeat).dst == vehicle.imc_id
        vehicle.swim()

        def heard() -> Any:
            node = node_of(bridge, vehicle.imc_id)
            return node is not None and node.report is not None

        await until(heard, "it has a place, and is heard")
        assert node_of(bridge, vehicle.imc_id).name == "lauv-noptilus-1"
        for forger in forgers:
            forger.close()
        vehicle.close()


async def test_forgers_that_also_speak_get_no_more_places_than_a_host_may_have() -> None:
    async with listening() as bridge:
        forger = Forger(bridge)
        for number in range(MAX_NODES + 20):
            forger.speaker.imc_id, forger.speaker.name = FIRST_FORGED + number, f"forged-{number}"
            forger.speaker.announce()
            forger.speaker.send(imcpy.Heartbeat())
            if number % 10 == 0:
                await asyncio.sleep(0.01)
        await read(bridge)
        assert len(bridge.nodes()) < MAX_NODES
        vehicle = Speaker(bridge, host="127.0.0.1")
        vehicle.announce()
        await until(lambda: node_of(bridge, vehicle.imc_id) is not None, "another host's vehicle has a place")
        forger.close()
        vehicle.close()


async def test_a_vehicle_that_a_mission_wants_has_a_place_whoever_has_the_others() -> None:
    async with listening() as bridge:
        bridge.want("lauv-noptilus-1")
        vehicle = Speaker(bridge)
        forgers = [Forger(bridge, host) for host in HOSTS]
        for index, forger in enumerate(forgers):
            for number in range(40):
                forger.speaker.imc_id = FIRST_FORGED + 0x100 * index + number
                forger.speaker.name = f"forged-{forger.speaker.imc_id:x}"
                forger.speaker.announce()
                await asyncio.sleep(0)
                forger.speaker.send(imcpy.Heartbeat())
            await asyncio.sleep(0.01)
        await until(lambda: len(bridge.nodes()) == MAX_NODES, "every place is taken by somebody who speaks")
        vehicle.announce()
        await until(lambda: node_of(bridge, vehicle.imc_id) is not None, "it has a place")
        await forgers[0].announces(300, first=0x4000)
        await forgers[0].heartbeats(300, first=0x4000)
        await read(bridge)
        assert node_of(bridge, vehicle.imc_id) is not None, "silent as it is, it keeps it"
        assert len(bridge.nodes()) == MAX_NODES
        for forger in forgers:
            forger.close()
        vehicle.close()


async def test_the_name_of_a_vehicle_goes_to_who_is_heard_under_it() -> None:
    async with listening() as bridge:
        bridge.want("lauv-noptilus-1")
        forger, vehicle = Forger(bridge), Speaker(bridge)
        forger.speaker.imc_id, forger.speaker.name = 0x2000, "lauv-noptilus-1"
        forger.speaker.announce()
        await until(lambda: bool(bridge.nodes()), "the forged one is known")
        vehicle.announce()
        await until(lambda: len(bridge.nodes()) == 2, "the vehicle is known")
        vehicle.swim()
        await until(lambda: node_of(bridge, vehicle.imc_id).report is not None, "it is heard")
        assert node_of(bridge, vehicle.imc_id).name == "lauv-noptilus-1"
        assert node_of(bridge, 0x2000).name == "(0x2000)"
        forger.speaker.announce()
        await read(bridge)
        assert node_of(bridge, vehicle.imc_id).name == "lauv-noptilus-1"
        forger.close()
        vehicle.close()


async def test_real_vehicle_among_forgers_becomes_ready() -> None:
    async with open_sea(connected=False) as sea:
        await sea.connect()
        forgers = [Forger(sea.bridge, host) for host in ("127.0.0.1", "127.0.0.2")]
        for index, forger in enumerate(forgers):
            await forger.heartbeats(300, first=0x3000 + 0x400 * index)
            await forger.announces(300, first=0x5000 + 0x400 * index)
        await sea.launch()
        floor = seafloors.generate("harbour", 0, width_m=100.0, height_m=100.0)
        (spec,) = default_specs(1, floor, base_port=sea.base_port)

        def ready() -> Any:
            return sea.state(spec.name) is NodeState.READY

        await until(ready, "the vehicle is ready")
        assert Cause.CROWDED in judged(sea.bridge).causes
        for forger in forgers:
            forger.close()


async def test_strangers_who_fell_silent_are_forgotten_and_the_doctor_is_content_again() -> None:
    now = [0.0]
    bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: now[0])

    def packet(message: imcpy.Message, imc_id: Any) -> Any:
        message.src, message.timestamp = imc_id, 1.7e9
        return imcpy.Packet.serialize(message)

    for number in range(100):
        bridge.on_packet(packet(imcpy.Heartbeat(), FIRST_FORGED + number), ("127.0.0.2", 5000))
        announce = imcpy.Announce()
        announce.sys_name, announce.sys_type = f"forged-{number}", imcpy.SystemType.UUV
        announce.services = "imc+udp://127.0.0.3:5000/"
        bridge.on_announce(packet(announce, 0x4000 + number), ("127.0.0.3", 5000))
    bridge.pass_time()
    assert len(bridge.nodes()) == MAX_UNANNOUNCED_OF_HOST + MAX_UNHEARD_OF_HOST
    assert Cause.CROWDED in judged(bridge).causes
    now[0] = 400.0
    bridge.pass_time()
    assert bridge.nodes() == ()
    assert Cause.CROWDED not in judged(bridge).causes


def test_newcomers_are_kept_in_bounded_memory_and_share_it_by_host() -> None:
    newcomers = Newcomers()
    announcement = _announcement()
    newcomers.note(announcement, "127.0.0.1")
    tracemalloc.start()
    for number in range(60_000):
        forged = dataclasses.replace(announcement, imc_id=number + 0x100, name=f"forged-{number}")
        newcomers.note(forged, f"10.0.{number % 7}.1")
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(newcomers) <= MAX_NEWCOMERS
    assert kept < 32 * 2**20
    assert newcomers.answered(announcement.imc_id, ("127.0.0.1", 6002)) == announcement
    assert newcomers.answered(announcement.imc_id, ("127.0.0.1", 6002)) is None, "it is no newcomer any more"


def test_a_newcomer_answers_from_the_address_that_it_announced() -> None:
    newcomers = Newcomers()
    newcomers.note(_announcement(), "127.0.0.1")
    assert newcomers.answered(0x1E, ("127.0.0.1", 6003)) is None
    assert newcomers.answered(0x1F, ("127.0.0.1", 6002)) is None
    assert newcomers.answered(0x1E, ("127.0.0.2", 6002)) is None
    for number in range(MAX_NEWCOMERS_OF_HOST):
        newcomers.note(dataclasses.replace(_announcement(), imc_id=0x100 + number), "127.0.0.1")
    assert newcomers.answered(0x1E, ("127.0.0.1", 6002)) is None, "the first of too many has gone"


def _announcement() -> Announcement:
    from imc_bridge.network.discovery import Announcement

    return Announcement(0x1E, "lauv-noptilus-1", 2, (("127.0.0.1", 6002),))


def test_names_that_nobody_could_read_are_made_readable() -> None:
    now = 0.0
    registry = NodeRegistry(BridgeSettings(loopback_only=True))
    message = imcpy.Announce()
    message.src, message.sys_type = 0x1E, imcpy.SystemType.UUV
    message.sys_name = "lauv\x1b[2J\x9b\n" + "x" * 1000
    message.services = "imc+udp://127.0.0.1:6002/;imc+info://0.0.0.0/version/5.4\x1b[31m"
    from imc_bridge.network.discovery import read_announce

    announcement = read_announce(message)
    assert registry.find_place(announcement, "127.0.0.1", now)
    arrival = registry.announced(announcement, "127.0.0.1", now)
    assert arrival is not None
    assert arrival.node.name.startswith("lauv\\x1b[2J")
    assert len(arrival.node.name) == 64
    assert "\x1b" not in (arrival.node.announcement.imc_version or "")
