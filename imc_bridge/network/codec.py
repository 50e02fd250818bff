"""IMC packets to messages and back: imcpy does the coding, this module decides what is worth decoding.

A vehicle sends some 400 packets per second, most of which are not needed here. Their header is read first, so that
an unwanted packet costs no decoding. Nothing that arrives can raise out of :class:`Decoder`.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable
from enum import StrEnum
from functools import cache
from typing import Any, Literal, NamedTuple

import imcpy

Message = Any
"""An imcpy message object; the package has no usable type information."""

SYNC = 0xFE54
HEADER_SIZE = 20
FOOTER_SIZE = 2
BROADCAST_ID = 0xFFFF
ANY_ENTITY = 0xFF

MAX_FOREIGN = 32
_SYNC_HIGH = SYNC >> 8
_LITTLE = struct.Struct("<HHHdHBHB")
_BIG = struct.Struct(">HHHdHBHB")
_SYNC_LITTLE = struct.pack("<H", SYNC)
_SYNC_BIG = struct.pack(">H", SYNC)

_TEXT = -1
"""A text or raw data: its length, two bytes, and as many."""


class _Carried(NamedTuple):
    """A place for one message of these ids, or with ``many`` for a list of them."""

    ids: frozenset[int]
    many: bool = False


def _one(*ids: int) -> _Carried:
    return _Carried(frozenset(ids))


def _many(*ids: int) -> _Carried:
    return _Carried(frozenset(ids), many=True)


_LAYOUTS: dict[int, tuple[int | _Carried, ...]] = {
    211: (1, _TEXT, 4, _one()),  # AcousticOperation
    262: (1, _many(282), _many(283), 4),  # Distance
    276: (14, _many(283), _TEXT),  # SonarData
    480: (3, _one(479), 2),  # FollowRefState
    556: (4, _TEXT, _one(564, 558), _TEXT),  # PlanDB
    559: (4, _TEXT, 2, _one(564, 558), _TEXT),  # PlanControl
    802: (_TEXT, _many(801)),  # EntityParameters
}
"""Wanted messages that carry others, by id: bytes of plain fields, texts, and what may be inside."""
_INNER: dict[int, tuple[int | _Carried, ...]] = {
    282: (24,),  # DeviceState
    283: (8,),  # BeamConfig
    401: (5,),  # DesiredZ
    402: (9,),  # DesiredSpeed
    479: (1, _one(402), _one(401), 20),  # Reference
    558: (_TEXT, 12, _TEXT, _TEXT),  # PlanDBInformation; its checksum is written as texts are
    564: (_TEXT, 2, _TEXT, _TEXT, _TEXT, _TEXT),  # PlanStatistics
    801: (_TEXT, _TEXT),  # EntityParameter
}
"""What is read of them, in the same way."""
_AFTER_CARRIED = {211: 0, 556: 2, 559: 2}
"""Messages that are of use without what they carry: bytes of an empty text after it."""
NO_MESSAGE = 0xFFFF
"""Stands in a packet where a message could be carried inside."""


class PacketFault(StrEnum):
    """Why a packet did not become a message."""

    SYNC = "no IMC packet (synchronisation word)"
    LENGTH = "truncated or over-long packet"
    CHECKSUM = "wrong checksum or malformed payload"
    UNKNOWN = "message id unknown to this IMC version"


class Header(NamedTuple):
    """The 20 bytes before every payload."""

    msg_id: int
    size: int
    timestamp: float
    src: int
    src_ent: int
    dst: int
    dst_ent: int


def peek(packet: bytes, *, whole: bool = True) -> Header | PacketFault:
    """Read a packet's header in its sender's byte order, without verifying the payload.

    With ``whole`` false the header may stand alone, as at the beginning of a stream's next packet.
    """
    if len(packet) < HEADER_SIZE + (FOOTER_SIZE if whole else 0):
        return PacketFault.LENGTH
    sync = packet[:2]
    if sync == _SYNC_LITTLE:
        header = Header._make(_LITTLE.unpack_from(packet)[1:])
    elif sync == _SYNC_BIG:
        header = Header._make(_BIG.unpack_from(packet)[1:])
    else:
        return PacketFault.SYNC
    if whole and len(packet) != HEADER_SIZE + header.size + FOOTER_SIZE:
        return PacketFault.LENGTH
    return header


def sync_follows(data: bytes | bytearray, place: int) -> bool:
    """Whether a packet may begin at ``place``: a synchronisation word in either byte order."""
    return data[place : place + 2] in (_SYNC_LITTLE, _SYNC_BIG)


def foreign_version(packet: bytes) -> str:
    """IMC version of a packet whose synchronisation word is another version's: FE54 is 5.4; empty for no packet."""
    if len(packet) < HEADER_SIZE + FOOTER_SIZE or _SYNC_HIGH not in packet[:2]:
        return ""
    low = packet[0] if packet[1] == _SYNC_HIGH else packet[1]
    sized = _LITTLE if packet[1] == _SYNC_HIGH else _BIG
    return f"{low >> 4}.{low & 15}" if sized.unpack_from(packet)[2] + HEADER_SIZE + FOOTER_SIZE == len(packet) else ""


@cache
def message_name(msg_id: int) -> str | None:
    """Abbreviated name of a message id, None when this IMC version does not have it."""
    try:
        return str(imcpy.Factory.abbrev_from_id(msg_id))
    except RuntimeError:
        return None


def message_ids(names: Iterable[str]) -> frozenset[int]:
    """Ids of messages by abbreviated name."""
    return frozenset(int(imcpy.Factory.id_from_abbrev(name)) for name in names)


def _checksum_table() -> list[int]:
    table = list(range(256))
    for _ in range(8):
        table = [(value >> 1) ^ (0xA001 if value & 1 else 0) for value in table]
    return table


_CHECKSUM = _checksum_table()


def checksum(data: bytes) -> int:
    """CRC-16-IBM of a packet without its footer."""
    crc = 0
    for byte in data:
        crc = (crc >> 8) ^ _CHECKSUM[(crc ^ byte) & 0xFF]
    return crc


def readable(packet: bytes) -> bytes | None:
    """Return a packet whose messages inside can all be read to their ends; None where there is none.

    Plan messages and those of modems are read without what they carry (and the text after that) where that cannot be
    read. imcpy 1.1.2 loses memory for good with every inner message that it cannot read: a flood of them would bring
    the service down.
    """
    order: Literal["little", "big"] = "little" if packet[:2] == _SYNC_LITTLE else "big"
    msg_id = int.from_bytes(packet[2:4], order)
    layout = _LAYOUTS.get(msg_id)
    if layout is None:
        return packet
    content = packet[:-FOOTER_SIZE]
    if _after(layout, content, HEADER_SIZE, order) is not None:
        return packet
    place = next(index for index, part in enumerate(layout) if isinstance(part, _Carried))
    at = _after(layout[:place], content, HEADER_SIZE, order)
    if msg_id not in _AFTER_CARRIED or at is None or content[at : at + 2] in (b"", NO_MESSAGE.to_bytes(2, order)):
        return None
    if checksum(content) != int.from_bytes(packet[-FOOTER_SIZE:], order):
        return None
    bare = content[:at] + NO_MESSAGE.to_bytes(2, order) + bytes(_AFTER_CARRIED[msg_id])
    bare = bare[:4] + (len(bare) - HEADER_SIZE).to_bytes(2, order) + bare[6:]
    return bare + checksum(bare).to_bytes(2, order)


def _after(layout: tuple[int | _Carried, ...], content: bytes, at: int, order: Literal["little", "big"]) -> int | None:
    """Where what follows a layout begins; None where the content ends before."""
    for part in layout:
        if isinstance(part, _Carried):
            after = _after_carried(part, content, at, order)
            if after is None:
                return None
            at = after
        elif part == _TEXT:
            at += 2 + int.from_bytes(content[at : at + 2], order)
        else:
            at += part
        if at > len(content):
            return None
    return at


def _after_carried(place: _Carried, content: bytes, at: int, order: Literal["little", "big"]) -> int | None:
    count = 1
    if place.many:
        count, at = int.from_bytes(content[at : at + 2], order), at + 2
    for _ in range(count):
        msg_id, at = int.from_bytes(content[at : at + 2], order), at + 2
        if at > len(content) or msg_id not in (NO_MESSAGE, *place.ids):
            return None
        after = at if msg_id == NO_MESSAGE else _after(_INNER[msg_id], content, at, order)
        if after is None:
            return None
        at = after
    return at


class Decoder:
    """Decodes the wanted messages and counts everything else.

    Parameters
    ----------
    wanted
        Abbreviated names of the messages worth decoding.

    Attributes
    ----------
    decoded, unwanted : Counter[str]
        Packets by message name.
    faults : Counter[PacketFault]
    unknown_ids : Counter[int]
    foreign_versions : Counter[tuple[str, str]]
        Packets of another IMC version (by the synchronisation word), by host and version.
    """

    def __init__(self, wanted: Iterable[str]) -> None:
        self.wanted = message_ids(wanted)
        self.decoded: Counter[str] = Counter()
        self.unwanted: Counter[str] = Counter()
        self.faults: Counter[PacketFault] = Counter()
        self.unknown_ids: Counter[int] = Counter()
        self.foreign_versions: Counter[tuple[str, str]] = Counter()

    def header(self, packet: bytes, host: str = "") -> Header | None:
        """The header of a sound packet, None (and a count) otherwise."""
        header = peek(packet)
        if isinstance(header, Header):
            return header
        self.faults[header] += 1
        version = foreign_version(packet) if header is PacketFault.SYNC else ""
        if version and (len(self.foreign_versions) < MAX_FOREIGN or (host, version) in self.foreign_versions):
            self.foreign_versions[(host, version)] += 1
        return None

    def wants(self, header: Header) -> bool:
        """Whether the packet is worth decoding; when not, it is counted here."""
        if header.msg_id in self.wanted:
            return True
        name = message_name(header.msg_id)
        if name is None:
            self.faults[PacketFault.UNKNOWN] += 1
            self.unknown_ids[header.msg_id] += 1
        else:
            self.unwanted[name] += 1
        return False

    def received(self, packet: bytes) -> Message | None:
        """Decode a packet from the network, like :meth:`message`, at no cost of memory whatever it carries inside."""
        sound = readable(packet)
        if sound is None:
            self.faults[PacketFault.CHECKSUM] += 1
            return None
        return self.message(sound)

    def message(self, packet: bytes) -> Message | None:
        """Decode a packet whose header was taken; None (and a count) when its contents are wrong."""
        try:
            message = imcpy.Packet.deserialize(packet)
        except (RuntimeError, UnicodeDecodeError, ValueError):
            self.faults[PacketFault.CHECKSUM] += 1
            return None
        if not math.isfinite(message.timestamp):
            self.faults[PacketFault.CHECKSUM] += 1
            return None
        self.decoded[type(message).__name__] += 1
        return message


def encode(message: Message, *, src: int, dst: int, time_s: float, dst_ent: int = ANY_ENTITY) -> bytes:
    """Serialise a message as sent by ``src`` to ``dst`` at ``time_s`` (Unix seconds)."""
    message.src = src
    message.src_ent = 0
    message.dst = dst
    message.dst_ent = dst_ent
    message.timestamp = time_s
    return bytes(imcpy.Packet.serialize(message))
