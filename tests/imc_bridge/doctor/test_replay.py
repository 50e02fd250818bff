"""Recorded sessions of real DUNE nodes, as the bridge understands them."""

import math
import statistics
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeEvent, BridgeSettings, LinkChange, NodeState, Sounding, StateReport, Waypoint
from imc_bridge.control.plans import OPERATION_START, goto_maneuver, goto_plan, plan_control
from imc_bridge.control.references import REFERENCE_FLAGS, SentReference
from imc_bridge.doctor.replay import read_recording, replay
from imc_bridge.network.codec import encode
from imc_bridge.network.discovery import own_announce
from imc_bridge.sender import entity_query

CONSOLE = ("127.0.0.1", 6101)


@dataclass
class Replay:
    """A recording as a bridge in the console's place understood it."""

    bridge: Bridge
    taken: int
    events: list[BridgeEvent]

    def of(self, kind: type[Any]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


def replayed(path: Path, **settings: Any) -> Replay:
    events: list[Any] = []
    session = replay(path, BridgeSettings(**settings), events.append)
    return Replay(session.bridge, session.taken, events)


@pytest.fixture(scope="module")
def udp(captures: Path) -> Any:
    return replayed(captures / "udp_session.jsonl.gz")


def test_both_vehicles_are_known_by_name_id_and_address(udp: Replay) -> None:
    nodes = {node.name: node for node in udp.bridge.nodes()}
    assert {name: (node.imc_id, node.address) for name, node in nodes.items()} == {
        "lauv-xplore-1": (0x1E, "127.0.0.1:6002"),
        "lauv-xplore-2": (0x1F, "127.0.0.1:6003"),
    }
    assert all(node.imc_version == "5.4.31" and node.entities == 81 for node in nodes.values())


@pytest.mark.parametrize("session", ["udp_session", "acoustic_session", "wifi_gap_x5"])
def test_every_packet_is_classified(captures: Path, session: str) -> None:
    result = replayed(captures / f"{session}.jsonl.gz")
    decoder, nodes = result.bridge.decoder, result.bridge.nodes()
    assert not decoder.faults
    assert not result.bridge.announces.faults
    assert not result.bridge.handler_errors
    to_console = [r.packet for r in read_recording(captures / f"{session}.jsonl.gz") if r.dst == CONSOLE]
    sources = Counter(imcpy.Packet.deserialize(packet).src for packet in to_console)
    assert sum(node.echoes for node in nodes) == sources[0x3F01]
    relayed = sum(node.relayed for node in nodes)
    own = sum(decoder.decoded.values()) + decoder.unwanted.total()
    strangers = sum(node.foreign_address for node in nodes)
    assert strangers == 0
    # What is relayed to all or to the relaying node is looked at, too: it may be another console's abort.
    assert result.taken <= own + relayed + sources[0x3F01] <= result.taken + relayed
    assert all(node.imc_version == "5.4.31" for node in nodes)


def test_link_goes_through_its_states(udp: Replay) -> None:
    states = [change.state for change in udp.of(LinkChange) if change.vehicle == "lauv-xplore-1"]
    assert list(dict.fromkeys(states)) == [
        NodeState.ANNOUNCED,
        NodeState.ACTIVE,
        NodeState.IN_PLAN,
        NodeState.READY,
    ]
    assert states[-1] is NodeState.READY


def test_soundings_agree_with_the_vehicles_own_altitude(udp: Replay) -> None:
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


def test_position_uncertainty_is_carried_through(udp: Replay) -> None:
    sds = [s.position_sd_m for s in udp.of(Sounding) if s.position_sd_m is not None]
    assert len(sds) > 60
    assert all(0.0 < sd < 5.0 for sd in sds)


def test_positions_are_those_the_vehicle_announces(udp: Replay) -> None:
    first = next(report for report in udp.of(StateReport) if report.vehicle == "lauv-xplore-1")
    assert (first.lat_deg, first.lon_deg) == pytest.approx((math.degrees(0.718814), math.degrees(-0.151952)), abs=1e-4)


def test_reports_relayed_by_a_gateway_do_not_pass_for_telemetry(captures: Path) -> None:
    result = replayed(captures / "acoustic_session.jsonl.gz")
    nodes = {node.name: node for node in result.bridge.nodes()}
    assert nodes["manta-1"].relayed > 0
    assert not nodes["manta-1"].is_vehicle
    times = [report.time_s for report in result.of(StateReport) if report.vehicle == "lauv-xplore-1"]
    assert times == sorted(times)
    assert nodes["lauv-xplore-1"].report.battery_pct is None


def test_vehicle_under_water_in_a_plan_of_its_own_is_expected_to_be_silent(captures: Path) -> None:
    # Simulated five times faster than the clock of the recording.
    result = replayed(captures / "wifi_gap_x5.jsonl.gz")
    assert result.bridge.settings.time_scale == pytest.approx(5.0, abs=0.2)
    changes = [change for change in result.of(LinkChange) if change.vehicle == "lauv-xplore-1"]
    states = [change.state for change in changes]
    gap = states.index(NodeState.EXPECTED_OFFLINE)
    assert "under water in our plan" in changes[gap].reason
    assert NodeState.IN_PLAN in states[:gap]
    assert states[-1] in (NodeState.READY, NodeState.IN_PLAN)


def ours_to_send(message: imcpy.Message, settings: BridgeSettings) -> imcpy.Message:
    """The message as our own code makes it."""
    match type(message).__name__:
        case "Heartbeat":
            return imcpy.Heartbeat()
        case "EntityList":
            return entity_query()
        case "PlanControl":
            return plan_control(OPERATION_START, message.request_id, settings, goto_plan_like(message.arg))
        case "Reference":
            reference = SentReference(message.lat, message.lon, message.z.value, message.speed.value)
            assert reference.echoed_by(message)
            return reference.message()
        case "Announce":
            return own_announce(settings, ["127.0.0.1"], (message.lat, message.lon))
    return None


def goto_plan_like(plan: imcpy.Message) -> imcpy.Message | None:
    """A plan of Gotos to the same places as our own code makes it, None for another one; its timeouts are free."""
    if not all(isinstance(item.data, imcpy.Goto) for item in plan.maneuvers):
        return None
    steps = []
    for item in plan.maneuvers:
        goto = item.data
        place = math.degrees(goto.lat), math.degrees(goto.lon)
        ours = goto_maneuver(Waypoint("m", 1, *place, goto.z, speed_mps=goto.speed), goto.z)
        assert (ours.lat, ours.lon) == pytest.approx((goto.lat, goto.lon), abs=1e-12)
        ours.lat, ours.lon, ours.timeout = goto.lat, goto.lon, goto.timeout
        steps.append((item.maneuver_id, ours))
    return goto_plan(plan.plan_id, steps)


def by_depth(reference: imcpy.Message) -> bool:
    """Whether it is one that we would send: to a place at a depth, not to an altitude, nor the end of a maneuver."""
    return reference.flags == REFERENCE_FLAGS and reference.z.z_units == imcpy.ZUnits.DEPTH


OTHERS: dict[str, set[str]] = {
    "udp_session": set(),
    "acoustic_session": {"TransmissionRequest", "AcousticOperation", "AcousticSystemsQuery", "ReportControl"},
    "wifi_gap_x5": set(),
}
"""What the console sent besides: acoustics, of which test_acoustics takes what is ours to send."""


@pytest.mark.parametrize("session", OTHERS)
def test_what_we_send_equals_byte_for_byte_what_worked_with_real_vehicles(captures: Path, session: str) -> None:
    # The recording asked for an interval above the bottom, which DUNE does not keep.
    plan_id = "two" if session == "wifi_gap_x5" else "cao"
    settings = BridgeSettings(plan_id=plan_id, name="ccu-cao", altitude_interval_m=1.0)
    sent: Counter[Any] = Counter()
    for record in read_recording(captures / f"{session}.jsonl.gz"):
        if record.src != CONSOLE:
            continue
        message = imcpy.Packet.deserialize(record.packet)
        kind = type(message).__name__
        sent[kind] += 1
        if kind in OTHERS[session] or (kind == "Reference" and not by_depth(message)):
            continue
        ours = ours_to_send(message, settings)
        assert ours is not None, f"nothing of ours stands for a {kind}"
        packet = encode(ours, src=settings.id, dst=message.dst, time_s=message.timestamp, dst_ent=int(message.dst_ent))
        assert packet == record.packet, f"{kind}: {ours} instead of {message}"
    assert sum(sent.values()) > 50


def test_forged_packets_do_not_fill_the_memory() -> None:
    bridge = Bridge(BridgeSettings(), commanding=False, clock=lambda: 0.0)
    for imc_id in range(1, 5000):
        heartbeat = imcpy.Heartbeat()
        heartbeat.src = imc_id
        bridge.on_packet(bytes(imcpy.Packet.serialize(heartbeat)), ("10.0.0.1", imc_id))
    assert len(bridge.nodes()) <= 256
