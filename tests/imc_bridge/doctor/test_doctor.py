"""The doctor names the cause of what is wrong and what to do, against real sockets and fake DUNE nodes."""

import asyncio
import math
import socket
from pathlib import Path

import imcpy
import pytest

from imc_bridge.bridge import Bridge
from imc_bridge.doctor.diagnosis import Diagnosis
from imc_bridge.doctor.doctor import Cause, diagnose, diagnose_recording, judge
from imc_bridge.doctor.replay import RecordingError
from imc_bridge.events import SwathPing
from imc_bridge.settings import BridgeSettings
from simulator.dune import DuneFleet, DuneOptions, VehicleSpec
from simulator.dune.telemetry import Telemetry
from simulator.network import NetworkFaults
from tests.support.imc.sea import Peer, Sea, open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until

LISTEN_S = 1.2
"""24 s of vehicles that live 20 times faster."""


async def examine(sea: Sea) -> Diagnosis:
    """What the doctor says of the sea to someone who has nothing running."""
    await sea.bridge.close()
    return await diagnose(sea.settings, LISTEN_S)


async def test_healthy_vehicles_pass() -> None:
    async with open_sea(vehicles=2) as sea:
        await sea.ready()
        await until(lambda: judge(sea.bridge, 1.0).healthy, "nothing is wrong with them")
        diagnosis = judge(sea.bridge, 1.0)
        assert diagnosis.causes == ()
        assert "bottom measured by Altimeter" in diagnosis.text()
        assert "in service and ready" in diagnosis.text()
        assert diagnosis.nodes[0].history[0].state == "announced"


async def test_states_without_a_position_are_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    state = Telemetry.estimated_state

    def lost(telemetry: Telemetry) -> imcpy.EstimatedState:
        message = state(telemetry)
        message.lat = math.nan
        return message

    monkeypatch.setattr(Telemetry, "estimated_state", lost)
    async with open_sea() as sea:
        await sea.ready()
        await until(lambda: "and no position in any" in judge(sea.bridge, 1.0).text(), "it is told")
        assert Cause.LOW_RATE in judge(sea.bridge, 1.0).causes


async def test_nothing_heard_is_a_problem_with_ports_to_check() -> None:
    *announce_ports, port = free_ports(3)
    async with open_sea() as sea:
        settings = sea.settings.changed(port=port, announce_ports=tuple(announce_ports))
        diagnosis = await diagnose(settings, 0.1)
    assert diagnosis.causes == (Cause.NO_VEHICLE,)
    assert str(port) in diagnosis.text()


async def test_packets_without_an_announce() -> None:
    async with open_sea(connected=False) as sea:
        # The vehicle sends to us whether it knows us or not; a switch drops what it announces.
        heard_on = sea.settings.announce_ports[1]
        sea.options["static_destinations"] = (("127.0.0.1", sea.settings.port),)
        sea.faults = NetworkFaults(blocked_ports=frozenset({heard_on}))
        await sea.launch()
        diagnosis = await examine(sea)
        assert diagnosis.causes == (Cause.NO_ANNOUNCE,)
        assert "drops multicast" in diagnosis.text()


async def test_announce_without_traffic(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    await bridge.close()

    async def announce_on() -> None:
        while True:
            peer.announce(bridge.settings.announce_ports[0])
            await asyncio.sleep(0.05)

    task = asyncio.create_task(announce_on())
    try:
        diagnosis = await diagnose(bridge.settings, LISTEN_S)
    finally:
        task.cancel()
    assert diagnosis.causes == (Cause.NO_TRAFFIC,)
    assert "firewalls on both sides" in diagnosis.text()


async def test_address_where_nothing_listens() -> None:
    async with open_sea(connected=False) as sea:
        await sea.launch()
        # Its transport has died, its announcer has not.
        sea.fleet.nodes[0]._endpoint.close()
        diagnosis = await examine(sea)
        assert diagnosis.causes == (Cause.UNREACHABLE,)
        assert "Connection refused" in diagnosis.text()


async def test_a_multibeam_measures_the_bottom_too() -> None:
    async with open_sea(equipment={"sensor": "multibeam"}) as sea:
        (name,) = await sea.ready()
        await until(lambda: any(event.vehicle == name for event in sea.of(SwathPing)), "it pings")
        (node,) = sea.bridge.nodes()
        assert node.bottom_sensors == ("Multibeam",)
        diagnosis = judge(sea.bridge, 10.0)
        assert diagnosis.causes == ()
        assert "bottom measured by Multibeam" in diagnosis.text()
        assert "pings refused: entity names not known yet" in diagnosis.text() or not node.pings_refused


async def test_wrong_imc_version() -> None:
    async with open_sea(imc_version="5.0.9") as sea:
        await sea.ready()
        await until(lambda: judge(sea.bridge, 1.0).causes == (Cause.WRONG_VERSION,), "nothing else is wrong with it")
        assert "IMC 5.0.9 where we speak" in judge(sea.bridge, 1.0).text()


async def test_version_whose_packets_cannot_even_be_read(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    packet = bytearray(imcpy.Packet.serialize(imcpy.Heartbeat()))
    packet[0] = 0x41
    for port in (peer.settings.port, bridge.transport.announce_port):
        peer.sock.sendto(bytes(packet), ("127.0.0.1", port))
    await until(lambda: bridge.decoder.faults.total() == 1, "the packet was looked at")
    diagnosis = judge(bridge, 1.0)
    assert diagnosis.causes[0] is Cause.NO_VEHICLE
    assert Cause.WRONG_VERSION in diagnosis.causes
    assert "from 127.0.0.1 are of IMC 4.1" in diagnosis.text()


async def test_port_that_a_firewall_blocks() -> None:
    async with open_sea(connected=False) as sea:
        sea.faults = NetworkFaults(blocked_ports=frozenset({sea.settings.port}))
        await sea.launch()
        diagnosis = await examine(sea)
        assert diagnosis.causes == (Cause.BLOCKED_PORT,)
        assert f"allow UDP {sea.settings.port}" in diagnosis.text()


async def test_port_that_another_program_holds() -> None:
    async with open_sea(connected=False) as sea:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", sea.settings.port))
            diagnosis = await examine(sea)
        assert diagnosis.causes == (Cause.PORT_IN_USE,)
        assert "is held by" in diagnosis.text()


async def test_port_that_changed_under_the_same_id() -> None:
    async with open_sea() as sea:
        await sea.ready()
        sea.settings = sea.settings.changed(port=free_ports(1)[0])
        diagnosis = await examine(sea)
        assert diagnosis.causes == (Cause.STALE_PORT,)
        assert "restart DUNE" in diagnosis.text()


async def test_service_that_cannot_ask_under_other_ids_names_both_causes_of_silence() -> None:
    async with open_sea() as sea:
        await sea.ready()
        await sea.bridge.close()
        bridge = await sea.connect(port=free_ports(1)[0])
        await until(lambda: any("another port" in node.reason for node in bridge.nodes()), "the cause is named")
        assert judge(bridge, 1.0).causes == (Cause.NO_TRAFFIC,)


async def test_vehicle_that_comes_back_on_another_port_is_followed_there() -> None:
    async with open_sea() as sea:
        await sea.ready()
        await sea.vanish()
        sea.base_port = free_ports(1)[0]
        await sea.launch()
        await until(
            lambda: (
                sea.bridge.nodes()[0].address == f"127.0.0.1:{sea.base_port}" and sea.state("lauv-sim-1") == "ready"
            ),
            "it is ready at its new port",
        )


@pytest.mark.parametrize("name", ["lauv-sim-1", "lauv-twin"])
async def test_same_id_twice(name: str) -> None:
    async with open_sea() as sea:
        await sea.ready()
        spec = VehicleSpec(name, sea.fleet.nodes[0].imc_id, free_ports(1)[0], (20.0, 20.0, 0.0))
        elsewhere = free_ports(1)
        options = DuneOptions(announce_ports=(*elsewhere, *sea.settings.announce_ports))
        async with DuneFleet(sea.floor, [spec], speed=sea.settings.time_scale, options=options):
            diagnosis = await examine(sea)
            assert diagnosis.causes == (Cause.SAME_ID_TWICE,)
            assert ("give one another id" if name == "lauv-twin" else "stop one of them") in diagnosis.text()


async def test_vehicle_of_a_doubtful_id_is_not_engaged(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "it is known")
    peer.announce(bridge.transport.announce_port, sys_name="twin")
    await until(lambda: bridge.nodes()[0].conflict is not None, "the twin was noticed")
    with pytest.raises(Exception, match="could reach the wrong vehicle"):
        await bridge.engage("lauv-noptilus-1")


async def test_our_own_id_in_use_elsewhere(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.imc_id = bridge.settings.id
    peer.announce(bridge.transport.announce_port, sys_name="ccu-other")
    await until(lambda: bool(bridge.double), "it was noticed")
    assert Cause.OUR_ID_TAKEN in judge(bridge, 1.0).causes
    assert "'ccu-other'" in judge(bridge, 1.0).text()


@pytest.mark.slow
async def test_clock_that_is_off_by_hours() -> None:
    async with open_sea(speed=1.0, clock_offset_s=3 * 3600.0, boot_s=0.1, bridge={"position": (41.18, -8.7)}) as sea:
        await sea.ready()
        await until(lambda: all(node.bottom_sensors for node in sea.bridge.nodes()), "it has measured the bottom")
        diagnosis = judge(sea.bridge, 1.0)
        assert diagnosis.causes == (Cause.CLOCK_OFF,)
        assert "its clock is 3.0 h ahead of ours" in diagnosis.text()


async def test_packets_from_an_address_that_was_not_announced(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port, services=f"imc+udp://127.0.0.1:{free_ports(1)[0]}/")
    peer.send(imcpy.Heartbeat())
    await until(lambda: any(n.foreign_address and n.announce_age_s is not None for n in bridge.nodes()), "it was heard")
    assert judge(bridge, 1.0).causes == (Cause.FOREIGN_ADDRESS,)


async def test_named_vehicle_that_is_absent_is_told() -> None:
    async with open_sea() as sea:
        await sea.ready()
        sea.bridge.settings = sea.bridge.settings.changed(vehicles=("lauv-sim-1", "lauv-seacon-9"))
        assert "lauv-seacon-9 was not heard" in judge(sea.bridge, 1.0).text()


async def test_diagnosing_commands_nothing() -> None:
    async with open_sea() as sea:
        await sea.ready()
        diagnosis = await examine(sea)
        assert [node.name for node in diagnosis.nodes] == ["lauv-sim-1"]
        assert sea.fleet.nodes[0].plan.maneuver is None


async def test_silence_after_telemetry_is_told(harbour: tuple[Bridge, Peer]) -> None:
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "it is known")
    peer.send(imcpy.Heartbeat())
    await until(lambda: bridge.nodes()[0].age_s is not None, "a packet came")
    await until(lambda: "last packet" in judge(bridge, 1.0).text(), "the silence is told")


@pytest.mark.parametrize("session", ["udp_session", "acoustic_session", "wifi_gap_x5"])
def test_recorded_sessions_of_real_vehicles_are_judged(captures: Path, session: str) -> None:
    diagnosis = diagnose_recording(str(captures / f"{session}.jsonl.gz"), BridgeSettings())
    assert diagnosis.causes == ()
    assert [node.name for node in diagnosis.nodes] == ["lauv-xplore-1", "lauv-xplore-2"]
    assert "ready" in diagnosis.text()
    times = [change.at_s for change in diagnosis.nodes[0].history]
    assert times == sorted(times)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "holds no packet"),
        ("not json\n", "line 1"),
        ('{"t": 1, "src": "a:1"}\n', "line 1: 'hex'"),
        ('{"t": 1, "src": "a:1", "dst": "b:2", "hex": "zz"}\n', "a line must be"),
    ],
    ids=["empty", "no JSON", "missing", "no hex"],
)
def test_file_that_is_no_recording_is_refused_with_its_line(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "session.jsonl"
    path.write_text(content)
    with pytest.raises(RecordingError, match=words):
        diagnose_recording(str(path), BridgeSettings())


async def test_a_machine_without_a_network_is_well_when_its_vehicles_live_on_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("imc_bridge.network.transport.list_interfaces", list)
    async with open_sea(bridge={"loopback_only": False}) as sea:
        await sea.ready()
        await until(lambda: judge(sea.bridge, 1.0).healthy, "nothing is wrong")
        assert "no network interface besides loopback" in judge(sea.bridge, 1.0).text()
        await sea.vanish()


async def test_a_machine_without_a_network_that_hears_nobody_is_told_to_connect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("imc_bridge.network.transport.list_interfaces", list)
    *announce_ports, port = free_ports(3)
    diagnosis = await diagnose(BridgeSettings(port=port, announce_ports=tuple(announce_ports)), 0.1)
    assert Cause.NO_INTERFACE in diagnosis.causes


async def test_an_honest_vehicle_that_sends_much_is_not_called_a_stranger() -> None:
    async with open_sea(bridge={"max_packets_per_s": 100}) as sea:
        await sea.ready()
        node = sea.fleet.nodes[0]
        beat = imcpy.Heartbeat()
        beat.src = node.imc_id

        def is_too_much() -> bool:
            for _ in range(500):
                beat.timestamp = sea.fleet.clock.now()
                node._endpoint.send(bytes(beat.serialize()), ("127.0.0.1", sea.bridge.settings.port))
            return any("max_packets_per_s" in f.text for f in judge(sea.bridge, 1.0).own)

        await until(is_too_much, "it sends too much")
        [finding] = [f for f in judge(sea.bridge, 1.0).own if "max_packets_per_s" in f.text]
        assert "a vehicle of yours" in finding.remedy
        assert "multiplied by time_scale" in finding.remedy


async def test_what_would_bring_a_vehicle_home_is_told() -> None:
    async with open_sea(lost_comms_s=120.0, lost_comms_plan="lost_comms") as sea:
        await sea.ready()
        text = (await examine(sea)).text()
        assert "starts plan 'lost_comms' after 120 s without a console" in text
        assert "0x3F01 is no console" in text
        sea.settings = sea.settings.changed(id=0x4F01)
        assert "is no console" not in (await diagnose(sea.settings, LISTEN_S)).text()


async def test_a_vehicle_that_nothing_would_bring_home_is_well_and_told_what_to_enable() -> None:
    async with open_sea() as sea:
        await sea.ready()
        diagnosis = await examine(sea)
        assert diagnosis.causes == ()
        assert "[Supervisors.AUV.LostComms]" in diagnosis.text()
