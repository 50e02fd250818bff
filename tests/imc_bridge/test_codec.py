"""Packets in and out."""

import struct
from collections import Counter
from pathlib import Path

import imcpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.codec import Decoder, Header, PacketFault, encode, message_name, peek
from imc_bridge.hearing import WANTED
from tests.imc_bridge.conftest import read_capture

SESSIONS = ["udp_session", "acoustic_session", "wifi_gap_x5"]


def packet_of(message, src=0x1E, dst=0xFFFF, time_s=1.5):
    return encode(message, src=src, dst=dst, time_s=time_s)


def swapped(packet: bytes) -> bytes:
    """The header as a sender of the other byte order writes it."""
    fields = struct.unpack_from("<HHHdHBHB", packet)
    return struct.pack(">HHHdHBHB", *fields) + packet[20:]


@pytest.mark.parametrize("session", SESSIONS)
def test_every_recorded_packet_is_decoded_and_serialises_to_the_same_bytes(captures: Path, session: str):
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


def test_header_is_read_in_either_byte_order():
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
def test_what_is_no_packet_is_counted_by_its_fault(packet: bytes, fault: PacketFault):
    decoder = Decoder(WANTED)
    assert decoder.header(packet) is None
    assert decoder.faults == Counter({fault: 1})


def test_wrong_checksum_is_counted():
    packet = bytearray(packet_of(imcpy.VehicleState()))
    packet[25] ^= 0x10
    decoder = Decoder(WANTED)
    assert decoder.message(bytes(packet)) is None
    assert decoder.faults == Counter({PacketFault.CHECKSUM: 1})


def test_unknown_ids_are_counted_and_skipped():
    packet = bytearray(packet_of(imcpy.Heartbeat()))
    packet[2:4] = (9999).to_bytes(2, "little")
    decoder = Decoder(WANTED)
    header = decoder.header(bytes(packet))
    assert header is not None
    assert not decoder.wants(header)
    assert decoder.unknown_ids == Counter({9999: 1})
    assert message_name(9999) is None


def test_unwanted_messages_are_counted_without_being_decoded():
    packet = bytearray(packet_of(imcpy.ServoPosition()))
    packet[-1] ^= 0xFF
    decoder = Decoder(WANTED)
    header = decoder.header(bytes(packet))
    assert header is not None
    assert not decoder.wants(header)
    assert decoder.unwanted == Counter({"ServoPosition": 1})
    assert not decoder.faults


def test_time_that_is_no_number_is_refused():
    decoder = Decoder(WANTED)
    assert decoder.message(packet_of(imcpy.VehicleState(), time_s=float("nan"))) is None
    assert decoder.faults == Counter({PacketFault.CHECKSUM: 1})


@given(st.binary(max_size=200), st.integers(0, 60), st.integers(0, 255))
def test_no_packet_whatever_raises(noise: bytes, place: int, value: int):
    decoder = Decoder(WANTED)
    state = imcpy.EstimatedState()
    mutated = bytearray(packet_of(state))
    mutated[place] = value
    for packet in (noise, b"\x54\xfe" + noise, bytes(mutated)):
        header = decoder.header(packet)
        if header is not None and decoder.wants(header):
            decoder.message(packet)
    assert decoder.faults.total() + decoder.decoded.total() + decoder.unwanted.total() == 3
