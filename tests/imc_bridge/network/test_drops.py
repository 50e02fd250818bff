"""Packets that this machine threw away are counted as our loss, and told."""

import socket

import imcpy
import pytest

from app.missions import metrics
from app.missions.fleet.links.imc import ImcFleetLink
from imc_bridge import Bridge, BridgeSettings, PacketsDropped, PortInUseError
from imc_bridge.doctor.doctor import Cause, judge
from imc_bridge.network.drops import RECENT_WALL_S, DropMeter
from imc_bridge.network.packet_filter import LOUD
from tests.support.imc.sea import open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until


def flood(port: int, count: int = 20_000) -> None:
    """Send more than any buffer holds while nobody reads."""
    packet = bytes(imcpy.Rpm().serialize()) + bytes(2000)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(count):
            sender.sendto(packet, ("127.0.0.1", port))


def test_the_meter_knows_the_total_and_the_last_minute() -> None:
    count = 0
    meter = DropMeter(lambda: count)
    assert meter.look(0.0) == 0
    count = 7
    assert meter.look(0.5) == 0, "it looks once a second"
    assert meter.look(1.0) == 7
    count = 9
    assert meter.look(2.0) == 2
    assert (meter.total, meter.recent) == (9, 9)
    assert meter.look(3.0 + RECENT_WALL_S) == 0
    assert (meter.total, meter.recent) == (9, 0)


async def test_what_our_socket_could_not_hold_is_told_counted_and_no_vehicles_fault() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        flood(sea.settings.port)
        await until(lambda: bool(sea.of(PacketsDropped)), "the loss is noticed")
        assert sum(event.count for event in sea.of(PacketsDropped)) == sea.bridge.drops.total
        diagnosis = judge(sea.bridge, 1.0)
        assert Cause.PACKETS_DROPPED in diagnosis.causes
        [finding] = [f for f in diagnosis.own if f.cause is Cause.PACKETS_DROPPED]
        assert "this machine threw" in finding.text
        assert "rate_limiters" in finding.remedy
        sea.fleet.nodes[0].limiter.passes = lambda *_: False
        await until(lambda: "EstimatedState" not in sea.bridge.nodes()[0].rates_hz, "its states do not arrive")
        [judged] = judge(sea.bridge, 1.0).nodes
        assert Cause.LOW_RATE not in judged.causes, f"{name} is not blamed"


async def test_a_mission_and_the_metrics_hear_of_it() -> None:
    *announce_ports, port = free_ports(6)
    link = ImcFleetLink(BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports)))
    before = metrics.PACKETS_DROPPED._value.get()
    await link.start(lambda _event: None)
    try:
        flood(port)
        await until(lambda: metrics.PACKETS_DROPPED._value.get() > before, "it is counted")
    finally:
        await link.close()


async def test_every_engaged_vehicle_is_asked_to_send_seldom_what_is_loud() -> None:
    async with open_sea(chatter=True, speed=5.0) as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name)
        limiter = sea.fleet.nodes[0]
        await until(lambda: "ServoPosition:0.1" in limiter._rate_text, "it was asked")
        assert "Distance:5" in limiter._rate_text
        assert "SimulatedState:0.5" in limiter._rate_text, "what it limits by itself stays limited"
        await sea.bridge.stop(name)
        await until(lambda: "ServoPosition" not in limiter._rate_text, "it has its own rates back")


async def test_what_nobody_needs_is_neither_read_nor_a_loss() -> None:
    async with open_sea() as sea:
        await sea.ready()
        read, loud = sea.bridge.decoder.unwanted["Rpm"], [getattr(imcpy, name)() for name in LOUD]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _ in range(2000):
                for message in loud:
                    sender.sendto(message.serialize(), ("127.0.0.1", sea.settings.port))
            rpm = imcpy.Rpm()
            sender.sendto(rpm.serialize(), ("127.0.0.1", sea.settings.port))
        await until(lambda: sea.bridge.decoder.unwanted["Rpm"] > read, "what came last was read")
        assert not any(sea.bridge.decoder.unwanted[name] for name in LOUD)
        sea.bridge.drops.look(1e9)
        assert sea.bridge.drops.total == 0


async def test_the_port_is_nobody_elses_all_the_same() -> None:
    async with open_sea() as sea:
        with pytest.raises(PortInUseError):
            await Bridge(sea.settings).start(lambda _event: None)
