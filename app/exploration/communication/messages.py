"""What goes over the water, bit by bit: 64 bytes hold a header and ten landmark entries (AURO15 sec. 3.4).

All numbers are big-endian. The header takes 14 bytes:

====== ==== ==============================================================================
byte   bits content
====== ==== ==============================================================================
0      2    version of the format (1)
0      1    0: vehicle to station, 1: station to vehicle
0      1    acknowledgement: this step's report arrived, or: the answer to the last report arrived
0      4    number of neighbours appended (station to vehicle only)
1      8    number of the vehicle
2-3    16   step, modulo 65536; of an order that of the last report that arrived
4-12   3x24 east, north, depth: the vehicle's own position, or its next waypoint
13     8    number of entries
====== ==== ==============================================================================

Every entry takes 5 bytes: index of the landmark (16 bits), flag "accurately estimated" (1), code of the standard
deviation (7), depth (16). Every neighbour takes 10: number (8), east, north, depth (3x24). Positions and depths are
multiples of a 2^24-1-th (2^16-1-th) part of their range and saturate at its ends. The standard deviation is
``accuracy * 2^((code - 32) / 16)``, rounded up so that no sender claims too much: steps of
4.4 % from a quarter of the accuracy threshold to 58 times it; code 127 stands for anything larger (infinite).

Beyond the paper, an entry about a landmark that is not accurate carries the sender's *estimate from all its own looks*
and its standard deviation instead of a single range. For a Gaussian estimate that is all that the ranges have to say,
one entry replaces all earlier ones of the same sender, and an entry that arrives twice does no harm.
"""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray

VERSION = 1
HEADER_BYTES = 14
ENTRY_BYTES = 5
NEIGHBOUR_BYTES = 10
MAX_ENTRIES = 255
MAX_NEIGHBOURS = 15
MAX_VEHICLES = 256
MAX_LANDMARKS = 1 << 16
STEPS = 1 << 16

_POSITION_TOP = (1 << 24) - 1
_DEPTH_TOP = (1 << 16) - 1
_SD_TOP = 127
_SD_ONE = 32
_SD_PER_OCTAVE = 16
_MARGIN = 0.1


class MessageError(ValueError):
    """Bytes that are no message of this format, or values that do not fit it."""


@dataclass(frozen=True)
class Entries:
    """Landmark entries, (k,) each.

    Attributes
    ----------
    index : (k,)
        Which landmarks.
    depth_m, sd_m : (k,)
        Estimates and their standard deviations; a deviation may be inf.
    accurate : (k,)
        Whether the sender counts the landmark to ``A``.
    """

    index: IntArray
    depth_m: FloatArray
    sd_m: FloatArray
    accurate: BoolArray

    @classmethod
    def none(cls) -> "Entries":
        """Return no entries."""
        return cls(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_))

    def __len__(self) -> int:
        return len(self.index)


@dataclass(frozen=True)
class StatusReport:
    """Vehicle to station: where the vehicle is, (3,), and what it has learned."""

    step: int
    vehicle: int
    position: FloatArray
    acknowledges: bool
    entries: Entries


@dataclass(frozen=True)
class MoveOrder:
    """Station to vehicle: its next waypoint (3,), vehicles in its reachable exploration area, what others have learned.

    ``neighbours`` (m,) are numbers of vehicles, ``neighbour_positions`` (m, 3) where they are.
    """

    step: int
    vehicle: int
    waypoint: FloatArray
    acknowledges: bool
    neighbours: IntArray
    neighbour_positions: FloatArray
    entries: Entries


@dataclass(frozen=True)
class WireFormat:
    """Packs and unpacks messages; both sides must have been given the same ranges before they dive.

    Attributes
    ----------
    low, high : (3,)
        Ends of the ranges of east, north and depth.
    accuracy_sd_m : float
        The accuracy threshold, in which standard deviations are counted.
    """

    low: FloatArray
    high: FloatArray
    accuracy_sd_m: float

    @classmethod
    def around(
        cls, area: FloatArray, min_depth_m: float, max_depth_m: float, accuracy_sd_m: float = 0.02
    ) -> "WireFormat":
        """Return a format for an area (n_vertices, 2) and a band of depths, with a tenth to spare on every side."""
        low = np.array([*area.min(axis=0), min_depth_m])
        high = np.array([*area.max(axis=0), max_depth_m])
        spare = _MARGIN * (high - low)
        return cls(low - spare, high + spare, accuracy_sd_m)

    @property
    def position_resolution_m(self) -> FloatArray:
        """Smallest difference of positions, (3,)."""
        return np.asarray((self.high - self.low) / _POSITION_TOP, dtype=np.float64)

    @property
    def depth_resolution_m(self) -> float:
        """Smallest difference of the entries' depths."""
        return float((self.high[2] - self.low[2]) / _DEPTH_TOP)

    @property
    def largest_sd_m(self) -> float:
        """Standard deviations above this arrive as infinite."""
        return float(self.accuracy_sd_m * 2.0 ** ((_SD_TOP - 1 - _SD_ONE) / _SD_PER_OCTAVE))

    def encode_report(self, report: StatusReport) -> bytes:
        """Return the message; ``HEADER_BYTES + ENTRY_BYTES * len(entries)`` bytes."""
        head = self._header(
            0, report.acknowledges, 0, report.vehicle, report.step, report.position, len(report.entries)
        )
        return head + self._pack_entries(report.entries)

    def encode_order(self, order: MoveOrder) -> bytes:
        """Return the message, ``NEIGHBOUR_BYTES`` longer than a report for every neighbour."""
        m = len(order.neighbours)
        if m > MAX_NEIGHBOURS:
            raise MessageError(f"order: {m} neighbours do not fit; at most {MAX_NEIGHBOURS}")
        head = self._header(1, order.acknowledges, m, order.vehicle, order.step, order.waypoint, len(order.entries))
        others = b"".join(
            _number(int(k), MAX_VEHICLES, "neighbour", 1) + self._pack_position(position)
            for k, position in zip(order.neighbours, order.neighbour_positions, strict=True)
        )
        return head + self._pack_entries(order.entries) + others

    def decode_report(self, message: bytes) -> StatusReport:
        """Return what was encoded. Raises MessageError for anything else."""
        acknowledges, _, vehicle, step, position, entries, _ = self._open(message, 0)
        return StatusReport(step, vehicle, position, acknowledges, entries)

    def decode_order(self, message: bytes) -> MoveOrder:
        """Return what was encoded. Raises MessageError for anything else."""
        acknowledges, m, vehicle, step, waypoint, entries, rest = self._open(message, 1)
        rows = np.frombuffer(rest, np.uint8).reshape(m, NEIGHBOUR_BYTES)
        positions = np.array([self._unpack_position(row[1:].tobytes()) for row in rows]).reshape(m, 3)
        return MoveOrder(step, vehicle, waypoint, acknowledges, rows[:, 0].astype(np.int64), positions, entries)

    def _header(
        self, direction: int, acknowledges: bool, m: int, vehicle: int, step: int, position: FloatArray, k: int
    ) -> bytes:
        if k > MAX_ENTRIES:
            raise MessageError(f"message: {k} entries do not fit; at most {MAX_ENTRIES}")
        first = VERSION << 6 | direction << 5 | int(acknowledges) << 4 | m
        number = _number(vehicle, MAX_VEHICLES, "vehicle", 1)
        return bytes([first]) + number + (step % STEPS).to_bytes(2, "big") + self._pack_position(position) + bytes([k])

    def _open(self, message: bytes, direction: int) -> tuple[bool, int, int, int, FloatArray, Entries, bytes]:
        if len(message) < HEADER_BYTES:
            raise MessageError(f"message: {len(message)} bytes are fewer than the header's {HEADER_BYTES}")
        first, vehicle, k = message[0], message[1], message[13]
        if first >> 6 != VERSION or (first >> 5) & 1 != direction:
            raise MessageError(f"message: first byte {first:#04x} is of another version or direction")
        m = first & 0x0F
        wanted = HEADER_BYTES + ENTRY_BYTES * k + NEIGHBOUR_BYTES * m
        if len(message) != wanted:
            raise MessageError(f"message: {len(message)} bytes where the header announces {wanted}")
        end = HEADER_BYTES + ENTRY_BYTES * k
        entries = self._unpack_entries(message[HEADER_BYTES:end], k)
        step = int.from_bytes(message[2:4], "big")
        return bool(first & 0x10), m, vehicle, step, self._unpack_position(message[4:13]), entries, message[end:]

    def _pack_position(self, position: FloatArray) -> bytes:
        fraction = np.clip((position - self.low) / (self.high - self.low), 0.0, 1.0)
        return b"".join(int(q).to_bytes(3, "big") for q in np.rint(fraction * _POSITION_TOP))

    def _unpack_position(self, packed: bytes) -> FloatArray:
        q = np.array([int.from_bytes(packed[i : i + 3], "big") for i in (0, 3, 6)], dtype=np.float64)
        return np.asarray(self.low + q * self.position_resolution_m, dtype=np.float64)

    def _pack_entries(self, entries: Entries) -> bytes:
        if len(entries) and not (entries.index.min() >= 0 and entries.index.max() < MAX_LANDMARKS):
            raise MessageError(f"entries: an index lies outside [0, {MAX_LANDMARKS})")
        fraction = np.clip((entries.depth_m - self.low[2]) / (self.high[2] - self.low[2]), 0.0, 1.0)
        depth = np.rint(fraction * _DEPTH_TOP).astype(np.uint64)
        octaves = np.log2(np.maximum(entries.sd_m, 1e-300) / self.accuracy_sd_m)
        # A value that came out of a message must keep its code, whatever the logarithm's last digit.
        code = np.clip(np.ceil(octaves * _SD_PER_OCTAVE + _SD_ONE - 1e-9), 0, _SD_TOP).astype(np.uint64)
        word = entries.index.astype(np.uint64) << np.uint64(24)
        word |= entries.accurate.astype(np.uint64) << np.uint64(23) | code << np.uint64(16) | depth
        shifts = np.array([32, 24, 16, 8, 0], dtype=np.uint64)
        return bytes(((word[:, None] >> shifts) & np.uint64(0xFF)).astype(np.uint8).tobytes())

    def _unpack_entries(self, packed: bytes, k: int) -> Entries:
        octets = np.frombuffer(packed, np.uint8).reshape(k, ENTRY_BYTES).astype(np.int64)
        code = octets[:, 2] & 0x7F
        sd = self.accuracy_sd_m * 2.0 ** ((code - _SD_ONE) / _SD_PER_OCTAVE)
        return Entries(
            octets[:, 0] << 8 | octets[:, 1],
            self.low[2] + (octets[:, 3] << 8 | octets[:, 4]) * self.depth_resolution_m,
            np.where(code == _SD_TOP, np.inf, sd),
            (octets[:, 2] & 0x80) != 0,
        )


def _number(value: int, below: int, what: str, size: int) -> bytes:
    if not 0 <= value < below:
        raise MessageError(f"{what}: number {value} lies outside [0, {below})")
    return value.to_bytes(size, "big")
