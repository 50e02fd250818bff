"""Vehicles that are spoken to by sound: requests are those of the recorded session, and legs go on without radio."""

import asyncio
import math
from pathlib import Path
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, Guidance, NodeState, RefusedError, Waypoint, WaypointStatus
from imc_bridge.control.acoustics import (
    DEADLINE_S,
    INSTANT_BYTES,
    REPORT_PERIOD_S,
    SoundPath,
    frame_bytes,
    report_request,
    transmission,
)
from imc_bridge.control.plans import OPERATION_START, OPERATION_STOP, goto_maneuver, leg_plan, plan_control
from simulator.dune.node import FakeDune
from tests.support.imc.sea import Peer, Sea, open_sea, read_capture
from tests.support.waiting import until

GATEWAY, GATEWAY_ID = "manta-1", 0x8012
WAYPOINT = Waypoint("m", 1, 41.185, -8.705, 3.0)
RADIO_M = 30.0
"""So short that a vehicle on its way has sound only."""
SENT = imcpy.TransmissionStatus.StatusEnum.SENT


@pytest.fixture(scope="module")
def recorded(captures: Path) -> Any:
    messages = []
    for record in read_capture(captures / "acoustic_session.jsonl.gz"):
        try:
            messages.append(imcpy.Packet.deserialize(record.packet))
        except RuntimeError:
            continue
    return messages


def test_requests_are_those_of_the_recorded_console_field_by_field(
    recorded: list[imcpy.Message | imcpy.Message],
) -> None:
    theirs = {m.req_id: m for m in recorded if isinstance(m, imcpy.TransmissionRequest) and m.src == 0x3F01}
    with_message = [m for m in theirs.values() if m.msg_data is not None]
    assert len(with_message) >= 3
    [abort] = [m for m in theirs.values() if m.data_mode == imcpy.TransmissionRequest.DataModeEnum.ABORT]
    ours = transmission(imcpy.Abort(), abort.destination, abort.req_id, abort.deadline)
    assert ours.serialize_fields() == abort.serialize_fields()
    for message in with_message:
        ours = transmission(message.msg_data, message.destination, message.req_id, message.deadline)
        assert ours.serialize_fields() == message.serialize_fields()
    [report] = [m.msg_data for m in with_message if isinstance(m.msg_data, imcpy.ReportControl)]
    assert report_request(GATEWAY).serialize_fields() == report.serialize_fields()


def test_frames_are_as_long_as_the_recorded_modem_made_them(recorded: list[imcpy.Message | imcpy.Message]) -> None:
    sent = [m.msg_data for m in recorded if isinstance(m, imcpy.TransmissionRequest) and m.msg_data is not None]
    frames = {len(m.data) for m in recorded if isinstance(m, imcpy.UamTxFrame) and m.src == GATEWAY_ID}
    assert {frame_bytes(m) for m in sent if m.msg_name in ("PlanControl", "Reference", "ReportControl")} <= frames
    assert frame_bytes(imcpy.Abort()) in frames


def test_what_has_to_get_through_at_once_is_an_instant_message() -> None:
    settings = BridgeSettings()
    leg = goto_maneuver(WAYPOINT, 3.0)
    up = leg_plan(settings, WAYPOINT, 3.0, descend=False, aim=(WAYPOINT.lat_deg, WAYPOINT.lon_deg))
    sizes = {
        "abort": frame_bytes(imcpy.Abort()),
        "stop": frame_bytes(plan_control(OPERATION_STOP, 1, settings)),
        "report": frame_bytes(report_request(GATEWAY)),
        "leg": frame_bytes(plan_control(OPERATION_START, 1, settings, leg)),
        "leg and up": frame_bytes(plan_control(OPERATION_START, 1, settings, up)),
    }
    assert {kind: sizes[kind] for kind in ("abort", "stop", "report", "leg")} == {
        "abort": 3,
        "stop": 54,
        "report": 40,
        "leg": 108,
    }
    assert sizes["leg and up"] > 3 * sizes["leg"], "so by sound it goes without"
    assert max(sizes[kind] for kind in ("abort", "stop", "report")) <= INSTANT_BYTES


def test_the_recorded_gateways_answers_are_understood(recorded: list[imcpy.Message | imcpy.Message]) -> None:
    sent: list[Any] = []
    numbers = iter(range(1, 10))
    path = SoundPath("lauv-xplore-1", GATEWAY, sent.append, lambda: next(numbers), lambda: 1e9)
    answers = [m for m in recorded if isinstance(m, imcpy.TransmissionStatus) and m.src == GATEWAY_ID]
    assert path.send(imcpy.PlanControl(), 0.0)
    left = [path.status(m) for m in answers if m.req_id == 1]
    assert left == ["", "PlanControl"], "queued, then sent"
    [report, *_] = [m for m in recorded if isinstance(m, imcpy.EstimatedState) and (m.src, m.src_ent) == (0x1E, 0x0B)]
    place = path.take_report(report)
    assert (round(place.lat_deg, 3), round(place.lon_deg, 3), place.depth_m) == (41.185, -8.706, 3.0)


def test_one_message_is_under_way_at_a_time_and_commands_go_before_reports() -> None:
    sent: list[Any] = []
    numbers = iter(range(1, 99))
    path = SoundPath("a", GATEWAY, sent.append, lambda: next(numbers), lambda: 0.0)
    path.ask(0.0)
    path.ask(1.0)
    assert [type(m.msg_data).__name__ for m in sent] == ["ReportControl"]
    assert path.send(imcpy.PlanControl(), 2.0), "a command does not wait for a report"
    assert not path.send(imcpy.PlanControl(), 3.0)
    assert path.send(imcpy.PlanControl(), 2.0 + DEADLINE_S), "nor for ever for one that got lost"
    status = imcpy.TransmissionStatus()
    status.req_id, status.status, status.info = 3, imcpy.TransmissionStatus.StatusEnum.TEMPORARY_FAILURE, "modem busy"
    assert path.status(status) == ""
    assert path.last_problem == "PlanControl by sound (39 bytes): failed for now (modem busy)"
    path.ask(REPORT_PERIOD_S + 30.0)
    assert isinstance(sent[-1].msg_data, imcpy.ReportControl)


class Modem(Peer):
    """A gateway whose sound reaches the vehicle wherever it is: answers as the recorded one does."""

    def __init__(self, sea: Sea) -> None:
        super().__init__(sea.settings, GATEWAY_ID, GATEWAY)
        self.sea = sea
        self.heard: list[str] = []

    @property
    def node(self) -> FakeDune:
        return self.sea.fleet.nodes[0]

    async def serve(self) -> None:
        beat = 0
        while True:
            if beat % 50 == 0:
                self.announce(self.sea.bridge.transport.announce_port, sys_type=imcpy.SystemType.STATICSENSOR)
            if beat % 10 == 0:
                self.send(imcpy.Heartbeat())
            beat += 1
            for request in self.take("TransmissionRequest"):
                self.received.remove(request)
                self.answer(request)
            await asyncio.sleep(0.01)

    def answer(self, request: imcpy.TransmissionRequest) -> None:
        for state in (imcpy.TransmissionStatus.StatusEnum.IN_PROGRESS, SENT):
            status = imcpy.TransmissionStatus()
            status.req_id, status.status = request.req_id, state
            self.send(status)
        message, node = request.msg_data, self.node
        self.heard.append(type(message).__name__)
        if isinstance(message, imcpy.PlanControl):
            message.src, message.dst = GATEWAY_ID, node.imc_id
            node.plan.on_plan_control(message, node.vehicle.time_s)
        elif isinstance(message, imcpy.ReportControl):
            there = node.vehicle.position
            report = imcpy.EstimatedState()
            lat, lon = node.vehicle.terrain.frame.to_geodetic(there.east_m, there.north_m)
            report.lat, report.lon, report.depth = math.radians(lat), math.radians(lon), round(there.depth_m)
            report.src, report.dst, report.timestamp = node.imc_id, 0xFFFF, 1.7e9
            self.sock.sendto(imcpy.Packet.serialize(report), ("127.0.0.1", self.settings.port))


def test_a_report_by_sound_that_holds_no_position_counts_for_nothing() -> None:
    """Each one that counts prolongs the time in which the vehicle is not missed."""
    path = SoundPath("v", GATEWAY, lambda _message: None, lambda: 1, lambda: 1.7e9)
    state = imcpy.EstimatedState()
    assert path.take_report(state) is None, "it has had no fix yet"
    state.lat, state.lon = math.nan, -0.15
    assert path.take_report(state) is None
    state.lat = 0.72
    assert path.take_report(state) is not None


@pytest.mark.slow
async def test_legs_go_on_by_sound_where_radio_does_not_reach() -> None:
    async with open_sea(radio_range_m=RADIO_M, bridge={"unknown_bottom_depth_m": 3.0}) as sea:
        modem = Modem(sea)
        serving = asyncio.create_task(modem.serve())
        try:
            [name] = [name for name in await sea.ready() if name != GATEWAY]
            await until(lambda: any(node.name == GATEWAY for node in sea.bridge.nodes()), "the gateway is heard")
            await sea.bridge.engage(name, Guidance.ACOUSTIC, GATEWAY)
            start = modem.node.vehicle.position
            # So far that it is out of radio's reach wherever a report may count as arrival.
            away = (start.east_m, 85.0)
            sea.bridge.goto(name, sea.waypoint(0, *away, 2.0))
            await sea.reached(name, 0)
            assert modem.node.vehicle.position.horizontal_distance_m(start.east_m, start.north_m) > RADIO_M
            assert "ReportControl" in modem.heard
            assert "PlanControl" not in modem.heard, "the first leg went by radio"
            sea.bridge.goto(name, sea.waypoint(1, start.east_m, start.north_m, 2.0))
            await sea.reached(name, 1)
            assert "PlanControl" in modem.heard, "the second one could go by sound only"
            assert WaypointStatus.REFUSED not in sea.statuses(name, 1)
            await until(lambda: sea.state(name) is NodeState.READY, "it is home, in reach of radio")
            assert (await sea.bridge.stop(name)).acknowledged
        finally:
            serving.cancel()
            modem.sock.close()


@pytest.mark.parametrize("ahead_s", [0.0, 600.0, -600.0])
async def test_deadlines_are_by_the_gateways_clock(ahead_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway holds them against its own: on a console that is slow every command would be too late at once."""
    now_s, wall_s = 1000.0, 1.7e9
    bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: now_s, wall_clock=lambda: wall_s)
    requests: list[imcpy.TransmissionRequest] = []

    def sent(packet: bytes, address: tuple[str, int]) -> bool:
        message = imcpy.Packet.deserialize(packet)
        requests.extend([message] if isinstance(message, imcpy.TransmissionRequest) else [])
        return True

    monkeypatch.setattr(bridge.transport, "send", sent)

    def hear(imc_id: int, port: int, *messages: imcpy.Message, announce: bool = False) -> None:
        for message in messages:
            message.src, message.dst = imc_id, 0xFFFF
            message.timestamp = wall_s + (ahead_s if imc_id == GATEWAY_ID else 0.0)
            take = bridge.on_announce if announce else bridge.on_packet
            take(bytes(imcpy.Packet.serialize(message)), ("127.0.0.1", port))

    for imc_id, name, kind, port in ((GATEWAY_ID, GATEWAY, "STATICSENSOR", 6020), (0x1E, "a", "UUV", 6002)):
        announce = imcpy.Announce()
        announce.sys_name, announce.sys_type = name, getattr(imcpy.SystemType, kind)
        announce.services = f"imc+udp://127.0.0.1:{port}/"
        hear(imc_id, port, announce, announce=True)
        hear(imc_id, port, imcpy.Heartbeat())
    ready = imcpy.PlanControlState()
    ready.state = imcpy.PlanControlState.StateEnum.READY
    place = imcpy.EstimatedState()
    place.lat, place.lon = math.radians(WAYPOINT.lat_deg), math.radians(WAYPOINT.lon_deg)
    hear(0x1E, 6002, imcpy.VehicleState(), ready, place)
    engaging = asyncio.create_task(bridge.engage("a", Guidance.ACOUSTIC, GATEWAY))
    await asyncio.sleep(0)
    bridge.pass_time()
    bridge.goto("a", WAYPOINT)
    now_s += 9.0  # radio is silent
    bridge.pass_time()
    engaging.cancel()
    assert [request.deadline - wall_s - ahead_s for request in requests[:1]] == [DEADLINE_S]


async def test_a_gateway_that_nobody_heard_of_is_refused() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        with pytest.raises(RefusedError, match="gateway 'manta-9' was never heard of"):
            await sea.bridge.engage(name, Guidance.ACOUSTIC, "manta-9")
