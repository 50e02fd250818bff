"""IMC knows no authentication: what somebody on the vehicles' network can do with packets, his own and recorded ones.

Every packet goes through real sockets. Attackers speak from 127.0.0.2 or from other ports, and, where that is said,
from the vehicle's own address, which on a real network takes a forged IP header.
"""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, NodeState, Sounding, StateReport, WaypointStatus
from imc_bridge.nodes.refusals import Refused
from tests.support.imc.sea import open_sea
from tests.support.imc.speaker import VEHICLE, Speaker
from tests.support.ports import free_ports
from tests.support.waiting import until


class Scene:
    """A bridge, the vehicle, and somebody else."""

    def __init__(self, bridge: Bridge, events: list[Any]) -> None:
        self.bridge, self.events = bridge, events
        self.vehicle = Speaker(bridge)
        self.stranger = Speaker(bridge, host="127.0.0.2")

    def of(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]

    async def meet(self) -> None:
        self.vehicle.announce()
        await until(lambda: bool(self.bridge.nodes()), "the vehicle was noticed")
        self.vehicle.swim()
        await until(lambda: len(self.of(Sounding)) == 5, "its soundings are in")

    async def refused(self, reason: Refused, count: int) -> None:
        await until(lambda: self.bridge.admission.refused[reason] >= count, f"{count} packets were {reason}")


@pytest.fixture
async def scene(request: pytest.FixtureRequest) -> AsyncIterator[Any]:
    *announce_ports, port = free_ports(4)
    settings = BridgeSettings(
        port=port, loopback_only=True, announce_ports=tuple(announce_ports), **getattr(request, "param", {})
    )
    bridge = Bridge(settings)
    events: list[Any] = []
    await bridge.start(events.append)
    scene = Scene(bridge, events)
    yield scene
    assert not bridge.handler_errors
    scene.vehicle.close()
    scene.stranger.close()
    await bridge.close()


async def test_another_source_under_the_vehicles_id_changes_nothing(scene: Scene) -> None:
    await scene.meet()
    node = scene.bridge.nodes()[0]
    forged = Speaker(scene.bridge)  # the same machine, another port
    for who in (scene.stranger, forged):
        who.time_s = scene.vehicle.time_s
        who.swim()
    await until(lambda: scene.bridge.nodes()[0].foreign_address == 24, "all were noticed")
    assert len(scene.of(Sounding)) == 5
    after = scene.bridge.nodes()[0]
    assert (after.address, after.addresses) == (node.address, node.addresses)
    forged.close()


async def test_vehicles_place_on_the_network_is_its_own(scene: Scene) -> None:
    await scene.meet()
    stranger = scene.stranger
    stranger.time_s = scene.vehicle.time_s + 1.0
    stranger.announce()
    stranger.announce(uid=2)  # as if it had restarted
    await scene.refused(Refused.MOVED, 2)
    (node,) = scene.bridge.nodes()
    assert [host for host, _ in node.addresses] == ["127.0.0.1"]
    assert node.conflict is None
    stranger.announce(uid=2)
    await until(lambda: scene.bridge.nodes()[0].conflict is not None, "the operator is told")
    stranger.swim()
    scene.vehicle.swim()
    await until(lambda: len(scene.of(Sounding)) == 10, "the vehicle is still heard")


async def test_second_system_that_offers_the_vehicles_address_does_not_get_its_place(scene: Scene) -> None:
    await scene.meet()
    other = Speaker(scene.bridge, host="127.0.0.2", imc_id=0x77, name="other")
    other.announce(address=scene.vehicle.sock.getsockname())
    await until(lambda: len(scene.bridge.nodes()) == 2, "it was noticed")
    scene.vehicle.swim()
    await until(lambda: len(scene.of(Sounding)) == 10, "the vehicle is still heard")
    other.close()


async def test_recording_of_the_vehicle_changes_nothing_wherever_it_is_played_from(scene: Scene) -> None:
    await scene.meet()
    recorded = list(scene.vehicle.sent)
    scene.vehicle.swim(10.0)
    await until(lambda: len(scene.of(Sounding)) == 55, "it went on")
    for who in (scene.stranger, scene.vehicle):
        for packet, port in recorded:
            who.throw(packet, port)
            scene.vehicle.state(north_m=15.0)
    await scene.refused(Refused.OLD, 10)
    said = scene.vehicle.time_s

    def believed() -> Any:
        scene.vehicle.state(north_m=15.3)
        return scene.of(StateReport)[-1].time_s > said

    await until(believed, "it is where it says itself")
    assert len(scene.of(Sounding)) == 55
    times = [report.time_s for report in scene.of(StateReport)]
    assert times == sorted(times)


async def test_position_that_it_cannot_have_reached_is_not_believed(scene: Scene) -> None:
    """From the vehicle's own address and with its time: only what it says itself contradicts."""
    await scene.meet()
    for k in range(20):
        scene.vehicle.state(north_m=1.5 + 0.03 * k)
        scene.vehicle.state(north_m=400.0)
        scene.vehicle.measure(2.0)
    scene.vehicle.state(north_m=2.2)
    await scene.refused(Refused.PLACE, 20)
    lats = [report.lat_deg for report in scene.of(StateReport)]
    assert (max(lats) - min(lats)) * 111_000 < 10.0
    assert all((s.vehicle_lat_deg - lats[0]) * 111_000 < 10.0 for s in scene.of(Sounding))


@pytest.mark.parametrize("scene", [{"max_packets_per_s": 1000}], indirect=True)
async def test_flood_of_a_stranger_does_not_drown_the_vehicle(scene: Scene) -> None:
    await scene.meet()
    heartbeat = scene.stranger.packet(imcpy.Heartbeat())
    for k in range(3000):
        scene.stranger.throw(heartbeat)
        if k % 100 == 0:
            await asyncio.sleep(0)
    await scene.refused(Refused.FLOOD, 1000)
    scene.vehicle.swim()
    await until(lambda: len(scene.of(Sounding)) == 10, "the vehicle is heard")
    assert scene.bridge.admission.last[Refused.FLOOD].startswith("127.0.0.2:")


@pytest.mark.parametrize("scene", [{"allowed_addresses": ("127.0.0.1/32",), "allowed_ids": (VEHICLE,)}], indirect=True)
async def test_only_those_who_are_listed_are_taken_up(scene: Scene) -> None:
    await scene.meet()
    scene.stranger.imc_id = 0x77
    scene.stranger.announce()
    stranger_id = Speaker(scene.bridge, imc_id=0x78)
    stranger_id.announce()
    stranger_id.swim()
    await scene.refused(Refused.ADDRESS, 1)
    await scene.refused(Refused.ID, 13)
    assert [node.imc_id for node in scene.bridge.nodes()] == [VEHICLE]
    stranger_id.close()


async def test_vehicle_that_was_silent_for_long_may_come_back_elsewhere() -> None:
    *announce_ports, port = free_ports(4)
    settings = BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports), time_scale=1000.0)
    bridge = Bridge(settings)
    await bridge.start(lambda event: None)
    first, later = Speaker(bridge), Speaker(bridge, host="127.0.0.2")
    try:
        first.announce()
        await until(lambda: bool(bridge.nodes()), "it was noticed")

        def taken_up() -> Any:
            later.time_s = first.time_s + 100.0
            later.announce()
            return bridge.nodes()[0].addresses[0][0] == "127.0.0.2"

        await until(taken_up, "its new address counts")
    finally:
        first.close()
        later.close()
        await bridge.close()


@pytest.mark.slow
async def test_forged_packets_move_no_vehicle_that_is_led() -> None:
    """Its states, arrivals and aborts, from another port of its machine and from another host, while it is led."""
    async with open_sea() as sea:
        (name,) = await sea.ready()
        imc_id = sea.bridge.nodes()[0].imc_id
        forgers = [Speaker(sea.bridge, host, imc_id, name) for host in ("127.0.0.1", "127.0.0.2")]
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(1, 80.0, 80.0, 2.0))
        for forger in forgers:
            forger.time_s = 4e9 - 1e6
            for _ in range(20):
                forger.state()
                arrived = imcpy.FollowRefState()
                arrived.control_src, arrived.state, arrived.proximity = sea.settings.id, 3, 0x07
                forger.send(arrived)
                abort = imcpy.Abort()
                forger.send(abort)
                forger.send(imcpy.PlanControlState())
        await until(lambda: sea.bridge.nodes()[0].foreign_address >= 160, "the forgeries came")
        assert WaypointStatus.REACHED not in sea.statuses(name, 1)
        assert sea.bridge.nodes()[0].state is not NodeState.LOST
        await sea.reached(name, 1)
        reports = [event for event in sea.of(StateReport) if event.vehicle == name]
        assert all(report.time_s < 3.9e9 for report in reports)
        for forger in forgers:
            forger.close()
