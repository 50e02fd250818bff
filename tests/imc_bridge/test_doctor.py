"""The doctor names what is missing and what to do."""

from dataclasses import replace

import imcpy

from imc_bridge.doctor import Severity, diagnose, judge
from tests.imc_bridge.conftest import free_ports, open_sea, until


def problems(diagnosis):
    findings = [*diagnosis.own, *(finding for node in diagnosis.nodes for finding in node.findings)]
    return [finding for finding in findings if finding.severity is Severity.PROBLEM]


async def test_healthy_vehicles_pass():
    async with open_sea(vehicles=2) as sea:
        await sea.ready()
        await until(lambda: all(node.bottom_sensors for node in sea.bridge.nodes()), "each has measured the bottom")
        diagnosis = judge(sea.bridge, 1.0)
        assert diagnosis.healthy, diagnosis.text()
        assert "bottom measured by Altimeter" in diagnosis.text()
        assert "in service and ready" in diagnosis.text()


async def test_nothing_heard_is_a_problem_with_ports_to_check():
    *announce_ports, port = free_ports(3)
    async with open_sea() as sea:
        settings = replace(sea.settings, port=port, announce_ports=tuple(announce_ports))
        diagnosis = await diagnose(settings, 0.1)
    assert not diagnosis.healthy
    (problem,) = problems(diagnosis)
    assert "no vehicle was heard" in problem.text
    assert str(port) in problem.remedy


async def test_named_vehicle_that_is_absent_is_told():
    async with open_sea() as sea:
        await sea.ready()
        sea.bridge.settings = replace(sea.bridge.settings, vehicles=("lauv-sim-1", "lauv-seacon-9"))
        assert "lauv-seacon-9 was not heard" in judge(sea.bridge, 1.0).text()


async def test_diagnosing_commands_nothing():
    async with open_sea() as sea:
        await sea.ready()
        settings = sea.settings
        await sea.bridge.close()
        diagnosis = await diagnose(settings, 1.0)
        assert [node.name for node in diagnosis.nodes] == ["lauv-sim-1"]
        assert sea.fleet.nodes[0].plan.maneuver is None


async def test_port_that_changed_under_the_same_id_is_the_named_cause():
    async with open_sea() as sea:
        await sea.ready()
        await sea.bridge.close()
        bridge = await sea.connect(port=free_ports(1)[0])
        await until(lambda: any("another port" in node.reason for node in bridge.nodes()), "the cause is named")
        text = judge(bridge, 1.0).text()
        assert "restart DUNE or return to that port" in text


async def test_announce_is_missing_version_differs_and_ids_collide(harbour):
    bridge, peer = harbour
    peer.send(imcpy.Heartbeat())
    await until(lambda: bool(bridge.nodes()), "it was heard")
    assert "but no announce" in judge(bridge, 1.0).text()
    old = peer.services.replace("5.4.31", "4.0.1")
    peer.announce(bridge.transport.announce_port, services=old)
    await until(lambda: bridge.nodes()[0].imc_version == "4.0.1", "its version was read")
    assert "IMC 4.0.1 where we speak" in judge(bridge, 1.0).text()
    peer.announce(bridge.transport.announce_port, sys_name="twin")
    await until(lambda: bridge.nodes()[0].conflict is not None, "the twin was noticed")
    assert "give one another id" in judge(bridge, 1.0).text()


async def test_silence_after_telemetry_is_told(harbour):
    bridge, peer = harbour
    peer.announce(bridge.transport.announce_port)
    await until(lambda: bool(bridge.nodes()), "it is known")
    peer.send(imcpy.Heartbeat())
    await until(lambda: bridge.nodes()[0].age_s is not None, "a packet came")
    await until(lambda: "last packet" in judge(bridge, 1.0).text(), "the silence is told")
