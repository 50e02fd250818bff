"""Ports, announces and heartbeats on real sockets."""

import asyncio
import socket
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, NodeState, PortInUseError
from tests.support.imc.sea import Peer, open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until


async def test_taken_port_is_told_with_a_remedy() -> None:
    async with open_sea() as sea:
        second = Bridge(sea.settings)
        with pytest.raises(PortInUseError, match=rf"port {sea.settings.port} .*stop it or set another"):
            await second.start(print)


async def test_first_free_announce_port_is_taken_and_all_taken_is_told() -> None:
    *announce_ports, port = free_ports(4)
    settings = BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports))
    listeners = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in announce_ports]
    try:
        listeners[0].bind(("127.0.0.1", announce_ports[0]))
        bridge = Bridge(settings)
        await bridge.start(print)
        assert bridge.transport.announce_port == announce_ports[1]
        await bridge.close()
        for listener, taken in zip(listeners[1:], announce_ports[1:], strict=True):
            listener.bind(("127.0.0.1", taken))
        with pytest.raises(PortInUseError, match="all announce ports"):
            await Bridge(settings).start(print)
    finally:
        for listener in listeners:
            listener.close()


async def test_interface_that_this_machine_lacks_is_refused() -> None:
    bridge = Bridge(BridgeSettings(port=free_ports(1)[0], interfaces=("203.0.113.77",)))
    with pytest.raises(ValueError, match=r"interfaces: this machine has no address 203\.0\.113\.77; it has"):
        await bridge.start(print)


async def test_newcomer_is_answered_by_an_announce_and_heartbeats(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: len(peer.take("Heartbeat")) >= 3, "three heartbeats came")
    assert {(m.src, m.dst) for m in peer.take("Heartbeat")} == {(0x3F01, 0x1E)}
    (node,) = bridge.nodes()
    assert (node.name, node.state) == ("lauv-noptilus-1", NodeState.ANNOUNCED)


async def test_announced_but_mute_node_is_explained_after_a_while(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour

    def reason() -> Any:
        peer.announce(bridge.transport.announce_port)
        return bridge.nodes()[0].reason if bridge.nodes() else ""

    await until(lambda: "remember id 0x3F01 at another port" in reason(), "the causes are named")
    assert "firewall" in reason()


async def test_packets_without_announce_are_heard_and_explained(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.send(imcpy.Heartbeat())
    await until(lambda: bool(bridge.nodes()), "the packet was heard")
    (node,) = bridge.nodes()
    assert (node.name, node.state) == ("0x001E", NodeState.HEARD)
    assert "announce" in node.reason
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bridge.nodes()[0].name == "lauv-noptilus-1", "its name was learnt")


async def test_telemetry_counts_only_from_the_announced_address(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    stranger = Peer(peer.settings)
    stranger.send(imcpy.VehicleState())
    relay = Peer(peer.settings, imc_id=0x1F, name="relay")
    relay.announce(bridge.transport.announce_port)
    await until(lambda: len(bridge.nodes()) == 2, "both are known")
    state = imcpy.EstimatedState()
    state.src, state.timestamp = 0x1E, 1.7e9
    relay.sock.sendto(imcpy.Packet.serialize(state), ("127.0.0.1", peer.settings.port))
    await until(lambda: bridge.nodes()[1].relayed == 1, "the relayed packet was noticed")
    first = bridge.nodes()[0]
    assert first.report is None
    assert first.operation_mode is None
    assert first.foreign_address == 1
    stranger.close()
    relay.close()


async def test_entity_names_are_asked_for_until_they_come(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "it is known")
    peer.send(imcpy.Heartbeat())
    await until(lambda: len(peer.take("EntityList")) >= 2, "the names were asked for twice")
    report = imcpy.EntityList()
    report.op, report.list = imcpy.EntityList.OperationEnum.REPORT, "Altimeter=58;Echo Sounder=59"
    peer.send(report)
    await until(lambda: bridge.nodes()[0].entities == 2, "the names were taken in")


async def test_same_id_under_two_names_is_a_conflict(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "it is known")
    peer.announce(bridge.transport.announce_port, sys_name="lauv-seacon-2")
    await until(lambda: bridge.nodes()[0].conflict is not None, "the conflict was noticed")
    assert "'lauv-noptilus-1' and by 'lauv-seacon-2'" in (bridge.nodes()[0].conflict or "")


async def test_rubbish_leaves_the_bridge_alive(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    for rubbish in (b"", b"\x54\xfe", bytes(300), b"\x54\xfe" + bytes(40)):
        for port in (peer.settings.port, bridge.transport.announce_port):
            peer.sock.sendto(rubbish, ("127.0.0.1", port))
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "a good packet still counts")
    assert bridge.decoder.faults.total() == 4
    assert bridge.announces.faults.total() == 4
    assert not bridge.handler_errors


async def test_closing_twice_and_starting_twice() -> None:
    *announce_ports, port = free_ports(3)
    settings = BridgeSettings(port=port, loopback_only=True, announce_ports=tuple(announce_ports))
    bridge = Bridge(settings)
    await bridge.start(print)
    with pytest.raises(RuntimeError, match="started already"):
        await bridge.start(print)
    await bridge.close()
    await bridge.close()
    again = Bridge(settings.changed())
    await again.start(print)
    await again.close()
    await asyncio.sleep(0)
