"""Packets in and out."""

import os
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import imcpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.network.codec import (
    Decoder,
    Header,
    PacketFault,
    checksum,
    encode,
    message_name,
    peek,
    readable,
)
from imc_bridge.receiver import WANTED
from tests.support.imc.sea import read_capture

SESSIONS = ["udp_session", "acoustic_session", "wifi_gap_x5"]


def packet_of(message: imcpy.Message, src: int = 0x1E, dst: int = 0xFFFF, time_s: float = 1.5) -> bytes:
    return encode(message, src=src, dst=dst, time_s=time_s)


def swapped(packet: bytes) -> bytes:
    """The header as a sender of the other byte order writes it."""
    fields = struct.unpack_from("<HHHdHBHB", packet)
    return struct.pack(">HHHdHBHB", *fields) + packet[20:]


@pytest.mark.parametrize("session", SESSIONS)
def test_every_recorded_packet_is_decoded_and_serialises_to_the_same_bytes(captures: Path, session: str) -> None:
    decoder = Decoder(WANTED)
    seen = 0
    for record in read_capture(captures / f"{session}.jsonl.gz"):
        seen += 1
        header = decoder.header(record.packet)
        assert header is not None
        message = decoder.message(record.packet)
        assert (message.msg_id, message.src, message.dst, message.timestamp) == (
            header.msg_id,
            header.src,
            header.dst,
            header.timestamp,
        )
        assert imcpy.Packet.serialize(message) == record.packet
    assert seen > 2000
    assert not decoder.faults
    assert decoder.decoded.total() == seen


def test_header_is_read_in_either_byte_order() -> None:
    packet = packet_of(imcpy.Heartbeat(), src=0x1234, dst=0x4321)
    assert peek(packet) == peek(swapped(packet)) == Header(150, 0, 1.5, 0x1234, 0, 0x4321, 0xFF)


@pytest.mark.parametrize(
    ("packet", "fault"),
    [
        (b"", PacketFault.LENGTH),
        (b"\x54\xfe\x96", PacketFault.LENGTH),
        (bytes(22), PacketFault.SYNC),
        (packet_of(imcpy.Heartbeat())[:-1] + b"", PacketFault.LENGTH),
        (packet_of(imcpy.Heartbeat()) + b"x", PacketFault.LENGTH),
    ],
    ids=["empty", "stump", "other protocol", "truncated", "over-long"],
)
def test_what_is_no_packet_is_counted_by_its_fault(packet: bytes, fault: PacketFault) -> None:
    decoder = Decoder(WANTED)
    assert decoder.header(packet) is None
    assert decoder.faults == Counter({fault: 1})


def test_wrong_checksum_is_counted() -> None:
    packet = bytearray(packet_of(imcpy.VehicleState()))
    packet[25] ^= 0x10
    decoder = Decoder(WANTED)
    assert decoder.message(bytes(packet)) is None
    assert decoder.faults == Counter({PacketFault.CHECKSUM: 1})


def test_unknown_ids_are_counted_and_skipped() -> None:
    packet = bytearray(packet_of(imcpy.Heartbeat()))
    packet[2:4] = (9999).to_bytes(2, "little")
    decoder = Decoder(WANTED)
    header = decoder.header(bytes(packet))
    assert header is not None
    assert not decoder.wants(header)
    assert decoder.unknown_ids == Counter({9999: 1})
    assert message_name(9999) is None


def test_unwanted_messages_are_counted_without_being_decoded() -> None:
    packet = bytearray(packet_of(imcpy.ServoPosition()))
    packet[-1] ^= 0xFF
    decoder = Decoder(WANTED)
    header = decoder.header(bytes(packet))
    assert header is not None
    assert not decoder.wants(header)
    assert decoder.unwanted == Counter({"ServoPosition": 1})
    assert not decoder.faults


def test_time_that_is_no_number_is_refused() -> None:
    decoder = Decoder(WANTED)
    assert decoder.message(packet_of(imcpy.VehicleState(), time_s=float("nan"))) is None
    assert decoder.faults == Counter({PacketFault.CHECKSUM: 1})


@given(st.binary(max_size=200), st.integers(0, 60), st.integers(0, 255))
def test_no_packet_whatever_raises(noise: bytes, place: int, value: int) -> None:
    decoder = Decoder(WANTED)
    state = imcpy.EstimatedState()
    mutated = bytearray(packet_of(state))
    mutated[place] = value
    for packet in (noise, b"\x54\xfe" + noise, bytes(mutated)):
        header = decoder.header(packet)
        if header is not None and decoder.wants(header):
            decoder.message(packet)
    assert decoder.faults.total() + decoder.decoded.total() + decoder.unwanted.total() == 3


def test_the_checksum_is_that_of_the_packets(captures: Path) -> None:
    for record in list(read_capture(captures / "udp_session.jsonl.gz"))[:300]:
        assert checksum(record.packet[:-2]) == int.from_bytes(record.packet[-2:], "little")


def plan_control(argument: imcpy.Message | None = None) -> imcpy.Message:
    message = imcpy.PlanControl()
    message.type, message.op, message.request_id, message.flags = 1, 2, 777, 3
    message.plan_id, message.info = "survey-7", "said the vehicle"
    if argument is not None:
        message.arg = argument
    return message


def statistics() -> imcpy.Message:
    carried = imcpy.PlanStatistics()
    carried.plan_id, carried.durations, carried.fuel = "survey-7", "Total=12", "Total=1.5"
    return carried


def test_sound_statistics_and_the_text_after_them_stay() -> None:
    packet = packet_of(plan_control(statistics()))
    assert readable(packet) == packet
    assert imcpy.Packet.deserialize(packet).info == "said the vehicle"


@pytest.mark.parametrize("session", SESSIONS)
def test_what_recorded_vehicles_answer_stays_as_it_is(captures: Path, session: str) -> None:
    for record in read_capture(captures / f"{session}.jsonl.gz"):
        message = Decoder(WANTED).message(record.packet)
        if isinstance(message, imcpy.PlanControl | imcpy.PlanDB) and int(message.type) != 0:
            assert readable(record.packet) == record.packet


def test_what_else_a_plan_message_carries_is_left_out_and_the_rest_stays() -> None:
    plan = imcpy.PlanSpecification()
    plan.plan_id = "survey-7"
    bare = Decoder(WANTED).received(packet_of(plan_control(plan)))
    assert (bare.type, bare.op, bare.request_id, bare.flags) == (1, 2, 777, 3)
    assert (bare.plan_id, bare.arg, bare.src, bare.timestamp) == ("survey-7", None, 0x1E, 1.5)


@given(cut=st.integers(1, 60))
def test_statistics_that_end_too_early_are_left_out(cut: int) -> None:
    packet = bytearray(packet_of(plan_control(statistics())))
    packet = packet[: max(22, len(packet) - cut)]
    packet[4:6] = (len(packet) - 22).to_bytes(2, "little")
    packet[-2:] = checksum(bytes(packet[:-2])).to_bytes(2, "little")
    decoder = Decoder(WANTED)
    message = decoder.received(bytes(packet))
    assert message is None or message.arg is None


@pytest.mark.parametrize("message", [plan_control(), imcpy.PlanDB(), imcpy.Heartbeat(), imcpy.VehicleState()])
def test_packets_that_carry_nothing_stay_as_they_are(message: imcpy.Message) -> None:
    assert readable(packet_of(message)) == packet_of(message)


@given(st.binary(max_size=40), st.integers(0, 30), st.booleans())
def test_whatever_is_carried_imcpy_never_reads_it(rubbish: bytes, cut: int, right: bool) -> None:
    """What imcpy cannot read inside costs it memory for good; a wrong checksum it notices before."""
    packet = bytearray(packet_of(plan_control()))
    at = 20 + 4 + 2 + len("survey-7") + 2
    packet[at:-2] = b"\x10\x27" + rubbish
    packet = packet[: max(22, len(packet) - cut)]
    packet[4:6] = (len(packet) - 22).to_bytes(2, "little")
    packet[-2:] = checksum(bytes(packet[:-2])).to_bytes(2, "little") if right else b"??"
    decoder = Decoder(WANTED)
    message = decoder.received(bytes(packet))
    assert message is None or (message.arg is None and message.plan_id == "survey-7")


def _whole(message: imcpy.Message) -> imcpy.Message:
    """A message with something in each place where it can carry a message."""
    if isinstance(message, imcpy.FollowRefState):
        message.reference = imcpy.Reference()
        message.reference.speed, message.reference.z = imcpy.DesiredSpeed(), imcpy.DesiredZ()
    if isinstance(message, imcpy.Distance):
        message.location.append(imcpy.DeviceState())
    if isinstance(message, imcpy.Distance | imcpy.SonarData):
        message.beam_config.append(imcpy.BeamConfig())
        message.beam_config.append(imcpy.BeamConfig())
    if isinstance(message, imcpy.SonarData):
        message.data = b"ranges"
    if isinstance(message, imcpy.EntityParameters):
        parameter = imcpy.EntityParameter()
        parameter.name, parameter.value = "Rate Limiters", "Distance:5"
        message.name = "UDP"
        message.params.append(parameter)
    if isinstance(message, imcpy.AcousticOperation):
        message.system = "manta-1"
    return message


CARRIERS = [imcpy.FollowRefState, imcpy.Distance, imcpy.SonarData, imcpy.EntityParameters, imcpy.AcousticOperation]


def _cut(packet: bytes, by: int) -> bytes:
    """A packet that ends early, with the length and the checksum of one that is whole."""
    cut = bytearray(packet[: len(packet) - 2 - by] + bytes(2))
    cut[4:6] = (len(cut) - 22).to_bytes(2, "little")
    cut[-2:] = checksum(bytes(cut[:-2])).to_bytes(2, "little")
    return bytes(cut)


@pytest.mark.parametrize("kind", CARRIERS[:-1])
def test_messages_that_carry_others_are_read_when_whole_and_refused_wherever_they_end_early(kind: type[Any]) -> None:
    packet = packet_of(_whole(kind()))
    assert imcpy.Packet.serialize(Decoder(WANTED).received(packet)) == packet
    for by in range(1, len(packet) - 22):
        decoder = Decoder(WANTED)
        assert decoder.received(_cut(packet, by)) is None
        assert decoder.faults == {PacketFault.CHECKSUM: 1}


def test_a_modem_that_tells_of_what_it_carries_is_heard_without_that() -> None:
    message = imcpy.AcousticOperation()
    message.system, message.range, message.msg = "manta-1", 120.0, imcpy.Heartbeat()
    heard = Decoder(WANTED).received(packet_of(message))
    assert (heard.system, heard.range, heard.msg) == ("manta-1", 120.0, None)


def _memory_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize("kind", CARRIERS)
def test_a_flood_of_messages_that_carry_what_cannot_be_read_costs_no_memory(kind: type[Any]) -> None:
    packet = _cut(packet_of(_whole(kind())), 7)
    decoder = Decoder(WANTED)
    for _ in range(2000):
        decoder.received(packet)
    before = _memory_bytes()
    for _ in range(30_000):
        decoder.received(packet)
    assert _memory_bytes() - before < 1e6
