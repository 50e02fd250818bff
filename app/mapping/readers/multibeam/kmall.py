"""KMALL files (Kongsberg): the depths of #MRZ datagrams.

The layout follows "EM datagrams on *.kmall format" (Kongsberg document 410224), whose structures state their own sizes,
so that later ones with more at their ends are read, too. All numbers are little-endian.
"""

import itertools
import math
import re
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import numpy as np

from app.mapping.readers.multibeam.types import BLOCK_BYTES, MAX_RECORD_BYTES, Content, FilePing, damaged, take
from app.mapping.readers.types import ReadError

DEPTHS = b"#MRZ"
NORMAL, EXTRA, REJECTED = 0, 1, 2
"""Types of detections; extra ones are targets in the water above the bottom."""

INVALID = 1
"""Status of a sensor."""

_TYPE = re.compile(rb"#[A-Z]{2}[A-Z0-9]")
_HEAD = struct.Struct("<I4sBBHII")
"""Length, type, version, system, sounder, seconds, nanoseconds."""
_END = struct.Struct("<I")
"""The length once more."""

_PARTITION = struct.Struct("<HH")
_COMMON = struct.Struct("<H")
_PING = struct.Struct("<H90xHHffff8xBBBxdd")
"""Size; at 92 number and size of sectors, heading, sound speed, transducer's depth, water line; statuses; position."""
_RECEIVER = struct.Struct("<HHHH16xHHHH")
"""Size, soundings, valid ones, size of each; at 24 an alarm, extra detections, their classes, size of each."""
_SOUNDING = {
    "type": (3, "u1"), "method": (4, "u1"), "sd": (20, "<f4"), "z": (96, "<f4"), "y": (100, "<f4"), "x": (104, "<f4"),
}  # fmt: skip
"""Where the numbers that are needed lie in a sounding."""
_SOUNDING_BYTES = 108
"""Of a sounding at least."""


class _Datagram(NamedTuple):
    where: str
    kind: bytes
    time_s: float
    content: bytes


class KmallFile:
    """A KMALL file that is open.

    The format states how well a bottom was detected (from the quality factor), not how well its depth is known.

    Raises
    ------
    ReadError
        When it is no KMALL.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._datagrams = _datagrams(file)
        self._first = next(self._datagrams, None)
        if self._first is None:
            raise _no_kmall()
        self._pings = 0
        self._extra = 0
        self.incomplete = 0

    def pings(self) -> Iterator[FilePing]:
        """Yield the pings one after the other; those of several swaths or receivers are as many.

        Raises
        ------
        ReadError
            When a datagram is damaged or cut off.
        """
        for datagram in itertools.chain([self._first], self._datagrams):
            if datagram is None or datagram.kind != DEPTHS:
                continue
            ping = self._ping(datagram)
            if ping is None:
                self.incomplete += 1
            else:
                yield ping

    @property
    def reduced_unknown(self) -> bool:
        """Whether the pings are reduced for the tide, and none says by how much."""
        return False

    def notes(self) -> list[str]:
        """Return what is to be known of all pings that were read, in words."""
        told = ["depths are below the water surface of their time, not reduced for the tide"]
        if self._extra:
            told.append(f"{self._extra} extra detections in the water above the bottom are left out")
        return told

    def _ping(self, datagram: _Datagram) -> FilePing | None:
        """Return a ping, None where it lacks what soundings need. Raises ReadError when the datagram is damaged."""
        self._pings += 1
        where = datagram.where
        content = Content(datagram.content, where)
        parts, _ = _PARTITION.unpack(content.take(_PARTITION.size))
        if parts != 1:
            raise ReadError(where, "it is part of a datagram, as they are sent", "send the file that the sonar wrote")
        content.structure(_COMMON)
        _, sectors, sector_bytes, heading, _, sonar_m, water_m, _, *statuses, lat, lon = content.structure(_PING)
        content.take(sectors * sector_bytes)
        _, main, _, each, _, extra, classes, class_bytes = content.structure(_RECEIVER)
        content.take(classes * class_bytes)
        if each < _SOUNDING_BYTES:
            raise damaged(where, f"{each} bytes are no sounding")
        table = np.frombuffer(
            content.take((main + extra) * each),
            np.dtype(
                {
                    "names": list(_SOUNDING),
                    "offsets": [at for at, _ in _SOUNDING.values()],
                    "formats": [kind for _, kind in _SOUNDING.values()],
                    "itemsize": each,
                }
            ),
        )
        self._extra += int(np.count_nonzero(table["type"] == EXTRA))
        table = table[table["type"] != EXTRA]
        # What is not known the format writes as 200 degrees.
        known = abs(lat) <= 90.0 and abs(lon) <= 180.0 and math.isfinite(heading) and math.isfinite(water_m)
        if not known or not len(table) or INVALID in statuses:
            return None
        rejected = table["type"] >= REJECTED
        sd = table["sd"].astype(np.float64)
        return FilePing(
            number=self._pings,
            time_s=datagram.time_s,
            lat_deg=lat,
            lon_deg=lon,
            heading_deg=heading % 360.0,
            sonar_depth_m=sonar_m,
            level_m=0.0,
            forward_m=table["x"].astype(np.float64),
            starboard_m=table["y"].astype(np.float64),
            depth_m=table["z"].astype(np.float64) - water_m,
            sd_m=np.full(len(table), np.nan),
            detection_sd_m=np.where(np.isfinite(sd) & (sd > 0.0), sd, 0.0),
            rejected=rejected,
            detected=table["method"] != 0,
        )


def _datagrams(file: BinaryIO) -> Iterator[_Datagram]:
    """Yield a file's datagrams; of those that nobody needs no content."""
    for number in itertools.count(1):
        where = f"datagram {number}"
        head = file.read(_HEAD.size)
        if not head:
            return
        if number == 1 and (len(head) < _HEAD.size or not _TYPE.fullmatch(head[4:8])):
            raise _no_kmall()
        if len(head) < _HEAD.size:
            raise ReadError(where, "the file ends within it", "copy the file again; what is missing is not guessed")
        size, kind, _, _, _, seconds, nanoseconds = _HEAD.unpack(head)
        if not _TYPE.fullmatch(kind) or size < _HEAD.size + _END.size:
            raise damaged(where, "it is none that the format has")
        left = size - _HEAD.size - _END.size
        content = b""
        if kind == DEPTHS:
            if size > MAX_RECORD_BYTES:
                raise damaged(where, f"it claims {size} bytes")
            content = take(file, left, where)
        else:
            while left:
                left -= len(take(file, min(left, BLOCK_BYTES), where))
        if _END.unpack(take(file, _END.size, where)) != (size,):
            raise damaged(where, "its length is another at its end")
        yield _Datagram(where, kind, seconds + nanoseconds * 1e-9, content)


def _no_kmall() -> ReadError:
    return ReadError("file", "it does not begin as KMALL does", "send a .kmall file that is whole and not packed")
