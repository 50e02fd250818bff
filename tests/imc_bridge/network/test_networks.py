"""Several interfaces, multicast, broadcast, and TCP in the place of UDP."""

import asyncio
import socket
from collections.abc import AsyncIterator
from typing import Any

import imcpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge import Bridge, BridgeSettings, NodeState, WaypointStatus
from imc_bridge.network.streams import PacketSplitter
from imc_bridge.network.transport import Interface, list_interfaces
from tests.support.imc.sea import Peer, open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until

GROUP = "224.0.75.69"
LOOPBACK = Interface("127.0.0.1", "127.255.255.255")
SECOND = Interface("127.0.0.2", "127.255.255.255")


def settings_on(**changes: Any) -> BridgeSettings:
    *announce_ports, port = free_ports(4)
    return BridgeSettings(port=port, announce_ports=tuple(announce_ports), time_scale=20.0, **changes)


@pytest.fixture
async def two_interfaces(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Any]:
    """A bridge on a machine that seems to have two interfaces; both lie on the loopback device."""
    present = [LOOPBACK, SECOND]
    monkeypatch.setattr("imc_bridge.network.transport.list_interfaces", lambda: list(present))
    bridge = Bridge(settings_on(position=(41.0, -8.0)))
    await bridge.start(lambda event: None)
    yield bridge, present
    await bridge.close()


def hears(port: int, address: str = "") -> socket.socket:
    """A socket of another system that listens for announces, by multicast too."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind((address, port))
    sock.setblocking(False)
    for interface in (LOOPBACK, SECOND):
        member = socket.inet_aton(GROUP) + socket.inet_aton(interface.address)
        try:
            sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        except OSError:
            continue
    return sock


def drained(sock: socket.socket) -> list[tuple[imcpy.Message, tuple[str, int]]]:
    found: list[Any] = []
    while True:
        try:
            packet, address = sock.recvfrom(65536)
        except BlockingIOError:
            return found
        found.append((imcpy.Packet.deserialize(packet), address))


async def test_announces_leave_on_every_interface_and_to_this_host(
    two_interfaces: tuple[Bridge, list[Interface]],
) -> None:
    bridge, _ = two_interfaces
    sock = hears(bridge.settings.announce_ports[-1])
    heard = []
    try:

        def complete() -> Any:
            heard.extend(drained(sock))
            offers = [message.services for message, _ in heard]
            firsts = {offer.partition(";")[0] for offer in offers}
            port = bridge.settings.port
            return {f"imc+udp://127.0.0.1:{port}/", f"imc+udp://127.0.0.2:{port}/"} <= firsts

        await until(complete, "each interface offered its own address first")
        # The sender's own address is among those it offers: vehicles check that.
        for message, (host, port) in heard:
            assert f"imc+udp://{host}:{port}/" in message.services
        assert {(round(m.lat, 3), round(m.lon, 3)) for m, _ in heard} == {(0.716, -0.14)}
    finally:
        sock.close()


@pytest.mark.parametrize("way", ["multicast", "broadcast", "unicast"])
async def test_vehicles_are_heard_by(two_interfaces: tuple[Bridge, list[Interface]], way: str) -> None:
    bridge, _ = two_interfaces
    peer = Peer(bridge.settings)
    message = imcpy.Announce()
    message.sys_name, message.sys_type, message.services = "v", imcpy.SystemType.UUV, peer.services
    message.src = peer.imc_id
    peer.sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    peer.sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
    target = {"multicast": GROUP, "broadcast": "127.255.255.255", "unicast": "127.0.0.1"}[way]
    peer.sock.sendto(imcpy.Packet.serialize(message), (target, bridge.transport.announce_port))
    await until(lambda: [node.name for node in bridge.nodes()] == ["v"], "it was heard")
    # Its address is known, so it gets heartbeats.
    await until(lambda: bool(peer.take("Heartbeat")), "it was answered")
    peer.close()


async def test_interface_that_comes_later_is_taken_up_and_one_that_goes_is_left(
    two_interfaces: tuple[Bridge, list[Interface]],
) -> None:
    bridge, present = two_interfaces
    third = Interface("127.0.0.3", "127.255.255.255")
    present.append(third)
    await until(lambda: third in bridge.transport.interfaces, "it was taken up")
    assert "127.0.0.3" in bridge.transport.own_addresses()
    present.remove(SECOND)
    await until(lambda: SECOND not in bridge.transport.interfaces, "it was left")
    assert not bridge.handler_errors


async def test_only_the_chosen_interfaces_are_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("imc_bridge.network.transport.list_interfaces", lambda: [LOOPBACK, SECOND])
    bridge = Bridge(settings_on(interfaces=("127.0.0.2",)))
    await bridge.start(lambda event: None)
    try:
        assert bridge.transport.interfaces == [SECOND]
    finally:
        await bridge.close()


def test_interfaces_of_this_machine_have_their_networks_broadcast_address() -> None:
    for interface in list_interfaces():
        assert socket.inet_aton(interface.address)
        assert socket.inet_aton(interface.broadcast)


async def test_vehicle_that_announces_two_addresses_is_reached_at_the_one_that_works(
    harbour: tuple[Bridge, Peer],
) -> None:
    bridge, peer = harbour
    dead = free_ports(1)[0]
    port = peer.sock.getsockname()[1]
    peer.announce(bridge.transport.announce_port, services=f"imc+udp://127.0.0.1:{dead}/;imc+udp://127.0.0.1:{port}/")
    await until(lambda: bool(peer.take("Heartbeat")), "a heartbeat came to the second address")
    peer.send(imcpy.Heartbeat())
    await until(lambda: bridge.nodes()[0].address == f"127.0.0.1:{port}", "commands go to where it answers from")


async def test_packets_that_nobody_takes_are_noticed(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    dead = ("127.0.0.1", free_ports(1)[0])
    peer.announce(bridge.transport.announce_port, services=f"imc+udp://127.0.0.1:{dead[1]}/")
    await until(lambda: dead in bridge.transport.unreachable, "the refusal came back")
    assert bridge.transport.unreachable[dead] == "Connection refused"


async def test_every_refusal_is_noticed(harbour: tuple[Bridge, Peer]) -> None:
    # Two sockets share the bridge's port, and the system returns errors to either, by a hash of both addresses.
    bridge, _ = harbour
    dead = {("127.0.0.1", port) for port in free_ports(16)}
    for address in dead:
        bridge.transport.send(b"anyone there?", address)
    await until(lambda: dead <= bridge.transport.unreachable.keys(), "all refusals came back")


async def test_a_mission_by_tcp() -> None:
    async with open_sea(tcp=True, bridge={"transport": "tcp"}) as sea:
        (name,) = await sea.ready()
        (node,) = sea.bridge.nodes()
        assert node.address.startswith("127.0.0.1:70")
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 40, 1.0))
        await sea.reached(name, 0)
        assert (await sea.bridge.stop(name)).acknowledged
        assert sea.fleet.nodes[0].contacts.destinations == []


async def test_broken_stream_is_made_again() -> None:
    async with open_sea(tcp=True, bridge={"transport": "tcp"}) as sea:
        (name,) = await sea.ready()
        await sea.vanish()
        await until(lambda: sea.state(name) is NodeState.LOST, "it is lost")
        await sea.launch()
        await until(lambda: sea.state(name) is NodeState.READY, "it is ready again")


async def test_vehicle_without_tcp_is_spoken_to_by_udp() -> None:
    async with open_sea(bridge={"transport": "tcp"}) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 40, 1.0))
        await until(lambda: WaypointStatus.ACKNOWLEDGED in sea.statuses(name, 0), "it was acknowledged")


def packet_of(size: int) -> bytes:
    message = imcpy.LogBookEntry()
    message.text = "x" * size
    return bytes(imcpy.Packet.serialize(message))


@given(
    st.lists(st.integers(0, 300), min_size=1, max_size=8),
    st.lists(st.integers(1, 90), min_size=1, max_size=30),
    st.binary(max_size=20),
)
def test_stream_is_cut_into_its_packets_however_it_arrives(sizes: Any, cuts: Any, rubbish: bytes) -> None:
    packets = [packet_of(size) for size in sizes]
    stream = rubbish.replace(b"\x54", b"").replace(b"\xfe", b"") + b"".join(packets)
    splitter, start = PacketSplitter(), 0
    found: list[bytes] = []
    while start < len(stream):
        for cut in cuts:
            found += splitter.feed(stream[start : start + cut])
            start += cut
    assert found == packets


async def test_interface_settings_are_checked_when_the_bridge_starts() -> None:
    settings = settings_on().changed(interfaces=("203.0.113.9",))
    with pytest.raises(ValueError, match="this machine has no address 203"):
        await Bridge(settings).start(lambda event: None)
    await asyncio.sleep(0)
