"""Recorded sessions of real DUNE nodes, as the bridge understands them."""

import math
import statistics
from dataclasses import dataclass, field

import imcpy
import pytest

from imc_bridge import Bridge, BridgeEvent, BridgeSettings, LinkChange, NodeState, Sounding, StateReport
from imc_bridge.codec import encode
from imc_bridge.discovery import own_announce
from imc_bridge.follow import OPERATION_START, SentReference, plan_control
from tests.imc_bridge.conftest import read_capture

CONSOLE = ("127.0.0.1", 6101)


@dataclass
class Replay:
    """A recording fed to a bridge at the recording's pace."""

    bridge: Bridge
    events: list[BridgeEvent] = field(default_factory=list)
    from_vehicles: int = 0
    echoes: int = 0

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]


def replay(path, **settings) -> Replay:
    now = 0.0
    bridge = Bridge(BridgeSettings(state_events_per_s=1000.0, **settings), commanding=False, clock=lambda: now)
    result = Replay(bridge)
    bridge.listen(result.events.append)
    for record in read_capture(path):
        now = record.time_s
        if record.dst[1] in range(30100, 30105) and record.src != CONSOLE:
            bridge.on_announce(record.packet, record.src)
        elif record.dst == CONSOLE:
            result.from_vehicles += 1
            result.echoes += imcpy.Packet.deserialize(record.packet).src == 0x3F01
            bridge.on_packet(record.packet, record.src)
        bridge.pass_time()
    return result


@pytest.fixture(scope="module")
def udp(captures):
    return replay(captures / "udp_session.jsonl.gz")


def test_both_vehicles_are_known_by_name_id_and_address(udp):
    nodes = {node.name: node for node in udp.bridge.nodes()}
    assert {name: (node.imc_id, node.address) for name, node in nodes.items()} == {
        "lauv-xplore-1": (0x1E, "127.0.0.1:6002"),
        "lauv-xplore-2": (0x1F, "127.0.0.1:6003"),
    }
    assert all(node.imc_version == "5.4.31" and node.entities == 81 for node in nodes.values())


def test_every_packet_is_classified(udp):
    decoder = udp.bridge.decoder
    nodes = udp.bridge.nodes()
    assert not decoder.faults
    assert not udp.bridge.handler_errors
    assert sum(node.echoes for node in nodes) == udp.echoes > 300
    relayed = sum(node.relayed for node in nodes)
    assert decoder.decoded.total() + decoder.unwanted.total() + udp.echoes + relayed == udp.from_vehicles


def test_link_goes_through_its_states(udp):
    states = [change.state for change in udp.of(LinkChange) if change.vehicle == "lauv-xplore-1"]
    assert list(dict.fromkeys(states)) == [
        NodeState.ANNOUNCED,
        NodeState.ACTIVE,
        NodeState.IN_PLAN,
        NodeState.READY,
    ]
    assert states[-1] is NodeState.READY


def test_soundings_agree_with_the_vehicles_own_altitude(udp):
    soundings = udp.of(Sounding)
    reports = udp.of(StateReport)
    assert len(soundings) > 60
    errors = []
    for sounding in soundings:
        nearest = min(
            (report for report in reports if report.vehicle == sounding.vehicle),
            key=lambda report: abs(report.time_s - sounding.time_s),
        )
        if nearest.altitude_m is not None:
            errors.append(sounding.bottom_depth_m - nearest.depth_m - nearest.altitude_m)
    # The vehicle's own altitude is filtered, which lags.
    assert abs(statistics.median(errors)) < 0.5
    assert {sounding.source for sounding in soundings} == {"Altimeter"}


def test_position_uncertainty_is_carried_through(udp):
    sds = [s.position_sd_m for s in udp.of(Sounding) if s.position_sd_m is not None]
    assert len(sds) > 60
    assert all(0.0 < sd < 5.0 for sd in sds)


def test_positions_are_those_the_vehicle_announces(udp):
    first = next(report for report in udp.of(StateReport) if report.vehicle == "lauv-xplore-1")
    assert (first.lat_deg, first.lon_deg) == pytest.approx((math.degrees(0.718814), math.degrees(-0.151952)), abs=1e-4)


def test_reports_relayed_by_a_gateway_do_not_pass_for_telemetry(captures):
    result = replay(captures / "acoustic_session.jsonl.gz")
    nodes = {node.name: node for node in result.bridge.nodes()}
    assert nodes["manta-1"].relayed > 0
    assert not nodes["manta-1"].is_vehicle
    times = [report.time_s for report in result.of(StateReport) if report.vehicle == "lauv-xplore-1"]
    assert times == sorted(times)
    assert nodes["lauv-xplore-1"].report.battery_pct is None


def test_vehicle_under_water_in_a_plan_of_its_own_is_expected_to_be_silent(captures):
    # Simulated five times faster than the clock of the recording.
    result = replay(captures / "wifi_gap_x5.jsonl.gz", time_scale=5.0)
    changes = [change for change in result.of(LinkChange) if change.vehicle == "lauv-xplore-1"]
    states = [change.state for change in changes]
    gap = states.index(NodeState.EXPECTED_OFFLINE)
    assert "under water in plan" in changes[gap].reason
    assert NodeState.IN_PLAN in states[:gap]
    assert states[-1] in (NodeState.READY, NodeState.IN_PLAN)


def test_what_we_send_equals_what_worked_with_real_vehicles(captures):
    settings = BridgeSettings(plan_id="cao", name="ccu-cao")
    recorded, packets = {}, {}
    for record in read_capture(captures / "udp_session.jsonl.gz"):
        if record.src == CONSOLE:
            message = imcpy.Packet.deserialize(record.packet)
            recorded.setdefault(type(message).__name__, message)
            packets.setdefault(type(message).__name__, record.packet)
    start = plan_control(OPERATION_START, recorded["PlanControl"].request_id, settings)
    # The recording asked for an interval above the bottom, which DUNE does not keep.
    asked_plan = str(recorded["PlanControl"]).replace("altitude_interval: 1", "altitude_interval: 0")
    assert str(start).split("type:", 1)[1] == asked_plan.split("type:", 1)[1]
    asked = recorded["Reference"]
    ours = SentReference(asked.lat, asked.lon, asked.z.value, asked.speed.value)
    assert encode(ours.message(), src=asked.src, dst=asked.dst, time_s=asked.timestamp) == packets["Reference"]
    assert ours.echoed_by(asked)
    announce = own_announce(settings, ["127.0.0.1"])
    assert announce.services == recorded["Announce"].services
    assert (announce.sys_name, announce.sys_type, announce.owner) == (
        recorded["Announce"].sys_name,
        recorded["Announce"].sys_type,
        recorded["Announce"].owner,
    )


def test_forged_packets_do_not_fill_the_memory():
    bridge = Bridge(BridgeSettings(), commanding=False, clock=lambda: 0.0)
    for imc_id in range(1, 5000):
        heartbeat = imcpy.Heartbeat()
        heartbeat.src = imc_id
        bridge.on_packet(bytes(imcpy.Packet.serialize(heartbeat)), ("10.0.0.1", imc_id))
    assert len(bridge.nodes()) <= 256
