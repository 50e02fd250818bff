"""GSF files (Generic Sensor Format, versions 2 and 3): pings of swath bathymetry.

The layout follows the Generic Sensor Format Specification, version 03.06 and later, section 4.3. All numbers are
big-endian.
"""

import itertools
import math
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.mapping.readers.multibeam.types import BLOCK_BYTES, MAX_RECORD_BYTES, Content, FilePing, damaged, take
from app.mapping.readers.types import ReadError
from app.mapping.s44 import NORMAL_95

HEADER, PING, PARAMETERS, SINGLE_BEAM = 1, 2, 4, 10
"""Types of records."""

DEPTH, ACROSS, ALONG, FLAGS, VERTICAL_ERROR, INTENSITIES, SCALES = 1, 2, 3, 16, 19, 21, 100
"""Types of subrecords of a ping."""

CHECKSUM_FOLLOWS = 1 << 31
TYPE_BITS = 0x3FFFFF
"""Registry and type: private records have a registry and so are none of these."""

IGNORED = 1
"""Bit of a ping's or beam's flags: not to be used."""

BEGIN = b"GSF-v"
VERSIONS = (2, 3)
NO_CORRECTOR_CM = 9999
"""Stands for a corrector that is not known."""

_FRAME = struct.Struct(">II")
_WORD = struct.Struct(">I")
_PING = struct.Struct(">iiiiHHHhhiHhhhHH")
"""Time, longitude, latitude, beams, centre, flags, spare, tide, depth corrector, heading, attitude, course, speed."""

_BEHIND_PING = {2: struct.Struct(""), 3: struct.Struct(">iiih")}
"""Height, separation, tide by GPS and a spare, which version 3 adds to a ping's head."""

_SCALE = np.dtype([("type", "u1"), ("compression", "u1"), ("spare", ">u2"), ("multiplier", ">u4"), ("offset", ">i4")])
_SCALED = (DEPTH, ACROSS, ALONG, VERTICAL_ERROR)
_SIGNED = (ACROSS, ALONG)
_DEGREES, _HEADING_DEGREES, _CM, _MM = 1e-7, 1e-2, 1e-2, 1e-3


class _Record(NamedTuple):
    where: str
    kind: int
    content: bytes


class _Scale(NamedTuple):
    multiplier: float
    offset: float
    compressed: bool


class GsfFile:
    """A GSF file that is open.

    Standard deviations are those of the vertical error, which the format states at 95 %; the error that a sonar alone
    makes and the older error of depth, whose confidence nothing states, are not taken for it.

    Raises
    ------
    ReadError
        When it is no GSF of these versions.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._records = _records(file)
        self._behind = _BEHIND_PING[_version(next(self._records, None))]
        self._parameters = _Parameters()
        self._single = 0
        self._scales: dict[int, _Scale] = {}
        self._error_m: FloatArray | None = None
        self._pings = 0
        self._flagged = False
        self._levelled = False
        self.incomplete = 0

    def pings(self) -> Iterator[FilePing]:
        """Yield the pings one after the other.

        Raises
        ------
        ReadError
            When a record is damaged or cut off, or the file has no end of a record where it should.
        """
        for record in self._records:
            if record.kind == PING:
                ping = self._ping(record)
                if ping is None:
                    self.incomplete += 1
                else:
                    yield ping
            elif record.kind == PARAMETERS:
                self._parameters.take(record)
            elif record.kind == SINGLE_BEAM:
                self._single += 1

    @property
    def reduced_unknown(self) -> bool:
        """Whether the pings that were read are reduced for the tide, and none says by how much."""
        return self._parameters.reduced and not self._levelled

    def notes(self) -> list[str]:
        """Return what is to be known of all pings that were read, in words."""
        told = self._parameters.notes(levelled=self._levelled)
        if not self._flagged:
            told.append("no ping of it has flags of beams: nobody may have looked for wrong soundings")
        if self._single:
            told.append(f"{self._single} soundings of single-beam records are left out")
        return told

    def _ping(self, record: _Record) -> FilePing | None:
        """Return a ping, None where it lacks what soundings need. Raises ReadError when the record is damaged."""
        self._pings += 1
        content = Content(record.content, record.where)
        head = _PING.unpack(content.take(_PING.size))
        seconds, nanoseconds, lon, lat, beams, _, flags, _, tide_cm, sonar_cm, heading = head[:11]
        behind = self._behind.unpack(content.take(self._behind.size))
        arrays = self._arrays(content, record.where, beams)
        beam_flags = arrays.get(FLAGS)
        self._flagged |= beam_flags is not None
        if VERTICAL_ERROR in arrays:
            self._error_m = arrays[VERTICAL_ERROR]
        level_m = _level_m(tide_cm, behind[2] if behind else 0)
        self._levelled |= level_m != 0.0
        lon_deg, lat_deg, heading_deg = lon * _DEGREES, lat * _DEGREES, heading * _HEADING_DEGREES
        # What is not known the format writes as 181, 91 and 361 degrees.
        known = abs(lon_deg) <= 180.0 and abs(lat_deg) <= 90.0 and heading_deg <= 360.0
        if not known or not beams or DEPTH not in arrays or ACROSS not in arrays:
            return None
        rejected = np.zeros(beams, bool) if beam_flags is None else (beam_flags.astype(np.uint8) & IGNORED).astype(bool)
        depth = arrays[DEPTH]
        stated = self._error_m is not None and len(self._error_m) == beams
        return FilePing(
            number=self._pings,
            time_s=seconds + nanoseconds * 1e-9,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            heading_deg=heading_deg,
            sonar_depth_m=math.nan if sonar_cm == NO_CORRECTOR_CM else sonar_cm * _CM,
            level_m=level_m,
            forward_m=arrays.get(ALONG, np.zeros(beams)),
            starboard_m=arrays[ACROSS],
            depth_m=depth,
            sd_m=self._error_m / NORMAL_95 if self._error_m is not None and stated else np.full(beams, np.nan),
            detection_sd_m=np.zeros(beams),
            rejected=np.ones(beams, bool) if flags & IGNORED else rejected,
            # The format writes depth 0 where a beam found no bottom.
            detected=np.abs(depth) > 0.5 / self._scales[DEPTH].multiplier,
        )

    def _arrays(self, content: Content, where: str, beams: int) -> dict[int, FloatArray]:
        """Return the arrays that are needed, (beams,) each, in metres; flags as they are."""
        arrays = {}
        # Records are filled up to whole words.
        while content.left > _WORD.size:
            [word] = _WORD.unpack(content.take(_WORD.size))
            kind, size = word >> 24, word & 0xFFFFFF
            # Programs of the format count this word only of intensities.
            part = content.take(max(size - _WORD.size, 0) if kind == INTENSITIES else size)
            if kind == SCALES:
                self._scales |= _scales(part, where)
            elif kind == FLAGS and beams and part:
                arrays[kind] = _numbers(part, beams, where, signed=False).astype(np.float64)
            elif kind in _SCALED and beams and part:
                scale = self._scales.get(kind)
                if scale is None:
                    raise ReadError(where, "no scale factor comes before its values", "send the file's begin too")
                if scale.compressed:
                    raise ReadError(where, "its values are compressed, which is not read", "write it uncompressed")
                raw = _numbers(part, beams, where, signed=kind in _SIGNED)
                arrays[kind] = raw / scale.multiplier - scale.offset
        return arrays


def _records(file: BinaryIO) -> Iterator[_Record]:
    """Yield a file's records; of those that nobody needs no content."""
    for number in itertools.count(1):
        where = f"record {number}"
        head = file.read(_FRAME.size)
        if not head:
            return
        if len(head) < _FRAME.size:
            raise ReadError(where, "the file ends within it", "copy the file again; what is missing is not guessed")
        size, identifier = _FRAME.unpack(head)
        kind = identifier & TYPE_BITS
        if number == 1 and (kind != HEADER or not len(BEGIN) < size <= BLOCK_BYTES):
            raise _no_gsf()
        if not kind or not size:
            raise damaged(where, "it is none that the format has")
        checksum = None
        if identifier & CHECKSUM_FOLLOWS:
            [checksum] = _WORD.unpack(take(file, _WORD.size, where))
        if kind in (HEADER, PING, PARAMETERS):
            if size > MAX_RECORD_BYTES:
                raise damaged(where, f"it claims {size} bytes")
            content = take(file, size, where)
            total = 0 if checksum is None else _sum(content)
        else:
            content, total, left = b"", 0, size
            while left:
                block = take(file, min(left, BLOCK_BYTES), where)
                total, left = total + (0 if checksum is None else _sum(block)), left - len(block)
        if checksum is not None and total % (1 << 32) != checksum:
            raise damaged(where, "its checksum is another")
        yield _Record(where, kind, content)


def _sum(content: bytes) -> int:
    return int(np.frombuffer(content, np.uint8).sum(dtype=np.uint64))


def _version(record: _Record | None) -> int:
    """Return the major version of a file by its first record."""
    if record is None or not record.content.startswith(BEGIN):
        raise _no_gsf()
    said = record.content[len(BEGIN) : len(BEGIN) + 2]
    if not said.isdigit() or int(said) not in VERSIONS:
        raise ReadError("file", "it is of a version of GSF that is not read", "send GSF of version 2 or 3")
    return int(said)


class _Parameters:
    """What the file says was done to its depths."""

    NAMES = (b"TIDE_COMPENSATED", b"HEAVE_COMPENSATED", b"DEPTH_CALCULATION", b"GEOID")

    def __init__(self) -> None:
        self._said: dict[bytes, set[bytes]] = {name: set() for name in self.NAMES}

    def take(self, record: _Record) -> None:
        """Note the parameters that matter. Raises ReadError where the record ends before they do."""
        content = Content(record.content, record.where)
        content.take(8)  # its time
        for _ in range(int.from_bytes(content.take(2))):
            name, _, value = content.take(int.from_bytes(content.take(2))).partition(b"=")
            if (name := name.strip().upper()) in self._said:
                self._said[name].add(value.strip(b" \0\r\n").upper())

    @property
    def reduced(self) -> bool:
        """Whether they say that depths are reduced for the tide."""
        return b"YES" in self._said[b"TIDE_COMPENSATED"]

    def notes(self, *, levelled: bool) -> list[str]:
        """Return what follows for who takes the depths; ``levelled``: whether pings name a correction for the tide."""
        told = []
        if self.reduced or levelled:
            told.append("the file says that its depths are reduced for the tide")
        else:
            told.append("the file does not say that its depths are reduced for the tide; they are taken as they are")
        if b"NO" in self._said[b"HEAVE_COMPENSATED"]:
            told.append("the file says that its depths are not corrected for heave")
        if b"RELATIVE_TO_1500_MS" in self._said[b"DEPTH_CALCULATION"]:
            told.append("the file says that its depths assume a sound speed of 1500 m/s")
        if self._said[b"GEOID"] - {b"WGS-84"}:
            told.append("the file names another datum than WGS 84; its positions are taken as WGS 84")
        return told


def _level_m(tide_cm: int, gps_tide_mm: int) -> float:
    """Return what was added to a ping's depths for the water's level; NaN where two values say two things."""
    tide_m = 0.0 if tide_cm == NO_CORRECTOR_CM else tide_cm * _CM
    gps_tide_m = gps_tide_mm * _MM
    if not tide_m or not gps_tide_m or abs(tide_m - gps_tide_m) <= _CM:
        return tide_m or gps_tide_m
    return math.nan  # one of them was added, and which one the format leaves to its users


def _scales(part: bytes, where: str) -> dict[int, _Scale]:
    """Return a subrecord's scale factors by the type of the array that they are for."""
    content = Content(part, where)
    count = int.from_bytes(content.take(_WORD.size))
    table = np.frombuffer(content.take(count * _SCALE.itemsize), _SCALE)
    if not table["multiplier"].all():
        raise damaged(where, "a scale factor of it is 0")
    return {
        int(row["type"]): _Scale(float(row["multiplier"]), float(row["offset"]), bool(row["compression"] & 0x0F))
        for row in table
    }


def _numbers(part: bytes, beams: int, where: str, *, signed: bool) -> NDArray[np.integer]:
    """Return an array of whole numbers, (beams,), of one, two or four bytes each."""
    width, over = divmod(len(part), beams)
    if over or width not in (1, 2, 4):
        raise damaged(where, f"{len(part)} bytes are no values of {beams} beams")
    return np.frombuffer(part, f">{'i' if signed else 'u'}{width}")


def _no_gsf() -> ReadError:
    return ReadError("file", "it does not begin as GSF does", "send a GSF file that is whole and not packed")
