"""A vehicle's own log (``Data.lsf``, ``Data.lsf.gz``) as the soundings and positions that were measured.

An LSF file is IMC packets one after another. DUNE writes everything into it that passes on board, at the full rates:
what radio never carried while the vehicle was under water is here. The same intake as for live telemetry judges it.
"""

from __future__ import annotations

import gzip
import hashlib
import os
import re
import struct
import zlib
from collections import Counter
from collections.abc import Generator, Iterator
from io import BufferedReader
from pathlib import PurePath
from typing import Literal, Protocol, cast

import imcpy

from imc_bridge.events import PingRefused, Sounding, SoundingRefused, SoundSpeedSample, StateReport, SwathPing
from imc_bridge.network.codec import (
    FOOTER_SIZE,
    HEADER_SIZE,
    SYNC,
    Decoder,
    Header,
    Message,
    PacketFault,
    message_ids,
)
from imc_bridge.network.discovery import read_announce
from imc_bridge.network.text_fields import text
from imc_bridge.nodes.node import Node, listed_entities
from imc_bridge.nodes.vehicle_clock import Tick, VehicleClock
from imc_bridge.settings import BridgeSettings
from imc_bridge.telemetry.soundings import offer_distance
from imc_bridge.telemetry.water import MESSAGES as WATER_MESSAGES

BLOCK_BYTES = 1 << 20
GZIP_MAGIC = b"\x1f\x8b"
_ORDERS = {struct.pack(f"{order}H", SYNC): struct.Struct(f"{order}H") for order in "<>"}
"""How a packet's size is read, by its first two bytes."""
_SYNC = re.compile(b"|".join(map(re.escape, _ORDERS)))
SIZE_OFFSET = 4
UNREADABLE = (EOFError, gzip.BadGzipFile, zlib.error)
"""What a log raises that was cut off while it was written or copied."""
SPARE_BYTES = 1 << 27
WASTED_TIMES = 8
"""So many bytes, and so many times those of its packets, may be looked at in vain: what reading costs has a bound."""
UNPACKED_TIMES = 100
"""Telemetry is packed to a tenth. What grows more than this and ``SPARE_BYTES`` was made to fill a machine."""

OWN = (
    "EstimatedState",
    "Distance",
    "NavigationUncertainty",
    "EntityList",
    "EntityInfo",
    "FuelLevel",
    "SonarData",
    *WATER_MESSAGES,
)
IDENTIFYING = ("Announce", "EntityList", "EntityInfo")
VEHICLE_SENDS = message_ids(("EstimatedState",))

LogEvent = StateReport | Sounding | SoundingRefused | SwathPing | PingRefused | SoundSpeedSample


class LogError(Exception):
    """A file cannot be used as a log; ``remedy`` says what would be right."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


class LogContent(Protocol):
    """A file, which a :class:`pathlib.Path` is; it is opened several times, one after the other."""

    @property
    def name(self) -> str:
        """Without its folder."""
        ...

    def stat(self) -> os.stat_result:
        """Return what the system knows of it. Raises OSError."""
        ...

    def open(self, mode: Literal["rb"]) -> BufferedReader:
        """Open it at its beginning. Raises OSError."""
        ...


class OpenLog:
    """A file that is open already, under the name that it had elsewhere."""

    def __init__(self, descriptor: int, name: str) -> None:
        self.name = PurePath(name).name
        self._descriptor = descriptor

    def __str__(self) -> str:
        return self.name

    def stat(self) -> os.stat_result:
        """Return what the system knows of it."""
        return os.fstat(self._descriptor)

    def open(self, _mode: Literal["rb"]) -> BufferedReader:
        """Return it at its beginning; what was returned before is at another place then."""
        file = os.fdopen(os.dup(self._descriptor), "rb")
        file.seek(0)
        return file


class PacketFile:
    """The packets of an LSF file in their order; what is no packet is skipped and counted.

    Attributes
    ----------
    size_bytes, read_bytes : int
        Of the file as it lies on disk, for showing how far reading has come.
    packets, skipped_bytes : int
    wasted_bytes : int
        How many bytes were looked at that turned out to be of no packet, each as often as that was done.
    cut_off : bool
        Whether the file ends in the middle of a packet or of its compression, as after a power loss.
    """

    def __init__(self, path: LogContent) -> None:
        self.size_bytes = path.stat().st_size
        self.read_bytes = 0
        self.packets = 0
        self.skipped_bytes = 0
        self.wasted_bytes = 0
        self.cut_off = False
        self._packet_bytes = 0
        self._path = path

    def __iter__(self) -> Iterator[bytes]:
        """Yield every packet from the beginning. Raises LogError where hardly anything is one."""
        self.packets = self.skipped_bytes = self.wasted_bytes = self._packet_bytes = 0
        rest = b""
        for block in self._blocks():
            data = rest + block
            used = yield from self._packets(data, last=False)
            rest = data[used:]
        self.read_bytes = self.size_bytes
        used = yield from self._packets(rest, last=True)
        self.cut_off |= used < len(rest)

    def unpacked_sha256(self) -> str:
        """Return the SHA-256 of what a compressed file holds, in hexadecimal digits; of another one nothing.

        Raises LogError as reading does.
        """
        with self._path.open("rb") as raw:
            if raw.read(len(GZIP_MAGIC)) != GZIP_MAGIC:
                return ""
        digest = hashlib.sha256()
        for block in self._blocks():
            digest.update(block)
        return digest.hexdigest()

    def _blocks(self) -> Iterator[bytes]:
        """Yield the content from the beginning, unpacked. Raises LogError where there is far more than in the file."""
        self.read_bytes = unpacked_bytes = 0
        self.cut_off = False
        with self._path.open("rb") as raw:
            compressed = raw.read(len(GZIP_MAGIC)) == GZIP_MAGIC
            raw.seek(0)
            stream = cast(BufferedReader, gzip.GzipFile(fileobj=raw)) if compressed else raw
            while block := self._block(stream, raw):
                unpacked_bytes += len(block)
                if compressed and unpacked_bytes > SPARE_BYTES + UNPACKED_TIMES * self.size_bytes:
                    raise LogError(
                        f"{self._path.name} unpacks to more than {UNPACKED_TIMES} times its size",
                        "unpack it, and send what is a log",
                    )
                yield block

    def _block(self, stream: BufferedReader, raw: BufferedReader) -> bytes:
        try:
            # Not read(), which of a file that is cut off would throw away what was unpacked already.
            block = stream.read1(BLOCK_BYTES)
        except UNREADABLE:
            self.cut_off = True
            return b""
        self.read_bytes = min(raw.tell(), self.size_bytes)
        return block

    def _packets(self, data: bytes, *, last: bool) -> Generator[bytes, None, int]:
        """Yield the whole packets in ``data``; returns how many of its bytes are done with."""
        place, end = 0, len(data)
        while end - place >= HEADER_SIZE + FOOTER_SIZE:
            order = _ORDERS.get(data[place : place + 2])
            if order is None:
                place = self._skip(data, place)
                continue
            size = HEADER_SIZE + order.unpack_from(data, place + SIZE_OFFSET)[0] + FOOTER_SIZE
            after = place + size
            if after + 2 > end and not (last and after == end):
                if last:
                    # A size that was damaged must not swallow the packets behind it.
                    place = self._skip(data, place)
                    continue
                break
            if after < end and data[after : after + 2] not in _ORDERS and not _sound(data[place:after]):
                self._waste(size)
                place = self._skip(data, place)
                continue
            self.packets += 1
            self._packet_bytes += size
            yield data[place:after]
            place = after
        return place

    def _skip(self, data: bytes, place: int) -> int:
        """Return where the next packet may begin."""
        # One search for either beginning: one that occurs nowhere would be looked for to the end of the data each time.
        found = _SYNC.search(data, place + 1)
        after = len(data) - 1 if found is None else found.start()
        self.skipped_bytes += after - place
        self._waste(after - place)
        return after

    def _waste(self, count: int) -> None:
        """Count bytes that were looked at in vain. Raises LogError where these are too many."""
        self.wasted_bytes += count
        if self.wasted_bytes > SPARE_BYTES + WASTED_TIMES * self._packet_bytes:
            raise LogError(
                f"{self._path.name} holds hardly any whole IMC packet",
                "copy the file again, or send what was written of it without damage",
            )


def _sound(packet: bytes) -> bool:
    try:
        imcpy.Packet.deserialize(packet)
    except (RuntimeError, UnicodeDecodeError, ValueError):
        return False
    return True


class VehicleLog:
    """One vehicle's log as events in the order of the file.

    Parameters
    ----------
    path
        ``.lsf`` or ``.lsf.gz``, a Path or a file that is open; what it is shows from its content.
    settings
        Geometry of the altimeter and the largest range.
    vehicle
        The vehicle's name; without it the name that the vehicle announces in the log.

    Raises
    ------
    LogError
        When the file holds no IMC, no vehicle's states, or no name and none is given.
    OSError
        When it cannot be read.
    """

    def __init__(self, path: LogContent, settings: BridgeSettings, vehicle: str | None = None) -> None:
        self.file = PacketFile(path)
        self.refused: Counter[str] = Counter()
        self.pings_refused: Counter[str] = Counter()
        self._settings = settings
        self._decoder = Decoder(OWN)
        self._path = path
        self.imc_id, name, self._entities = self._identify()
        if vehicle is None and not name:
            raise LogError(
                f"{path.name} does not tell its vehicle's name", "say whose it is: --vehicle NAME, by REST vehicle=NAME"
            )
        self.vehicle = vehicle or name

    @property
    def faults(self) -> dict[str, int]:
        """How many packets could not be read, by reason."""
        return {fault.value: count for fault, count in self._decoder.faults.items() if fault is not PacketFault.UNKNOWN}

    def _identify(self) -> tuple[int, str, dict[int, str]]:
        """The log's vehicle, its name, and its entities by id: read up to the vehicle's own announce."""
        decoder = Decoder(IDENTIFYING)
        states: Counter[int] = Counter()
        names: dict[int, str] = {}
        entities: dict[int, dict[int, str]] = {}
        for packet in self.file:
            header = decoder.header(packet)
            if header is None:
                continue
            if header.msg_id in VEHICLE_SENDS:
                states[header.src] += 1
            elif decoder.wants(header) and (message := decoder.message(packet)) is not None:
                if isinstance(message, imcpy.Announce):
                    announcement = read_announce(message)
                    names[header.src] = announcement.name
                else:
                    _note_entities(entities.setdefault(header.src, {}), message)
            if states and states.most_common(1)[0][0] in names:
                break
        if not self.file.packets:
            raise LogError(
                f"{self._path.name} holds no IMC packet",
                "give a DUNE log, Data.lsf or Data.lsf.gz; a multibeam's own file has to be called .gsf or .kmall",
            )
        if not states:
            raise LogError(f"{self._path.name} holds no EstimatedState", "give the log that DUNE wrote on the vehicle")
        own = states.most_common(1)[0][0]
        return own, names.get(own, ""), entities.get(own, {})

    def events(self) -> Iterator[LogEvent]:
        """Yield states, soundings and pings, and what was refused; the same file gives the same events every time."""
        node = Node(self.imc_id, self.vehicle, self._settings, 0.0)
        # A log has no arrival times and only one sender: a leap of the clock counts once it repeats.
        node.clock = VehicleClock(quiet_s=0.0)
        node.entities = dict(self._entities) or None
        self.refused.clear()
        self.pings_refused.clear()
        for packet in self.file:
            header = self._decoder.header(packet)
            if header is None or header.src != self.imc_id or not self._decoder.wants(header):
                continue
            message = self._decoder.message(packet)
            if message is not None:
                yield from self._counted(_take(node, header, message))
        yield from self._counted(_placed(node))
        yield from self._counted(node.intake.give_up())
        yield from self._counted(node.pings.give_up())

    def _counted(self, events: Iterator[LogEvent]) -> Iterator[LogEvent]:
        for event in events:
            if isinstance(event, SoundingRefused):
                self.refused[event.reason] += 1
            elif isinstance(event, PingRefused):
                self.pings_refused[event.reason] += 1
            yield event


def _placed(node: Node) -> Iterator[LogEvent]:
    """Yield what became of what was measured before the last state."""
    yield from node.intake.resolve(node.history, node.position_sd_m())
    yield from node.pings.resolve(node.history, node.position_sd_m())
    yield from node.water.resolve(node.history)


def _take(node: Node, header: Header, message: Message) -> Iterator[LogEvent]:
    if node.take_time(message.timestamp, 0.0, message.timestamp) is Tick.DOUBTFUL:
        return
    match type(message).__name__:
        case "EstimatedState":
            report = node.take_state(message, message.timestamp)
            if isinstance(report, StateReport):
                yield report
            yield from _placed(node)
        case "Distance":
            refused = offer_distance(node.intake, node.entity_name(header.src_ent), message)
            if refused is not None:
                yield refused
        case "SonarData":
            lost = node.pings.offer(node.entity_name(header.src_ent), message)
            if lost is not None:
                yield lost
        case name if name in WATER_MESSAGES:
            node.water.offer(name, node.entity_name(header.src_ent), message)
        case "NavigationUncertainty":
            node.take_uncertainty(message)
        case "FuelLevel":
            node.take_fuel(message)
        case _:
            names = dict(node.entities or {})
            _note_entities(names, message)
            node.entities = names or None


def _note_entities(names: dict[int, str], message: Message) -> None:
    """EntityList lists all of them, EntityInfo describes one."""
    if isinstance(message, imcpy.EntityInfo):
        names[int(message.id)] = text(message, "label")
    elif isinstance(message, imcpy.EntityList) and message.op == imcpy.EntityList.OperationEnum.REPORT:
        names.update(listed_entities(message))
