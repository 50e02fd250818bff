"""A ping as multibeam files have it."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO, Protocol

from app.arrays import BoolArray, FloatArray
from app.mapping.readers.types import ReadError

BLOCK_BYTES = 1 << 16
MAX_RECORD_BYTES = 1 << 24
"""Of a record that is read as a whole; neither format's programs write longer ones."""


@dataclass(frozen=True, slots=True, eq=False)
class FilePing:
    """Soundings of one ping, n of them, with attitude and sound speed applied by who wrote the file.

    Attributes
    ----------
    number
        Of the ping in the file, from 1, for messages.
    time_s
        Seconds since 1970 UTC.
    lat_deg, lon_deg, heading_deg
        WGS 84 position that the soundings are counted from, and where forward points, clockwise from north.
    sonar_depth_m
        Of the transducer below the water surface; NaN: not stated.
    level_m
        Was added to all depths for the water's level, 0 where none was; NaN: the file can be understood in two ways.
    forward_m, starboard_m, depth_m : (n,)
        Place on the bottom, level; depth below the water surface with ``level_m`` added.
    sd_m : (n,)
        Standard deviation of the depth; NaN: not stated.
    detection_sd_m : (n,)
        Of the detection alone, where the depth's is not stated; 0: not stated either.
    rejected, detected : (n,)
        What the file says not to use, and where the sonar found a bottom.
    """

    number: int
    time_s: float
    lat_deg: float
    lon_deg: float
    heading_deg: float
    sonar_depth_m: float
    level_m: float
    forward_m: FloatArray
    starboard_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray
    detection_sd_m: FloatArray
    rejected: BoolArray
    detected: BoolArray

    def __len__(self) -> int:
        return len(self.depth_m)


class MultibeamFile(Protocol):
    """An open file of a multibeam sonar.

    Attributes
    ----------
    incomplete
        Pings so far that have no position, heading or soundings, and were passed over.
    """

    incomplete: int

    def pings(self) -> Iterator[FilePing]:
        """Yield the pings one after the other. Raises ReadError where the file is not what it should be."""
        ...

    def notes(self) -> list[str]:
        """Return what is to be known of all pings that were read, in words."""
        ...

    @property
    def reduced_unknown(self) -> bool:
        """Whether the pings that were read are reduced for the tide, and none says by how much."""
        ...


def take(file: BinaryIO, size: int, where: str) -> bytes:
    """Read so many bytes, in blocks: what a file claims and does not have takes no memory.

    Raises
    ------
    ReadError
        When the file ends before; ``where`` names what it ends within.
    """
    parts = []
    while size:
        part = file.read(min(size, BLOCK_BYTES))
        if not part:
            raise ReadError(where, "the file ends within it", "copy the file again; what is missing is not guessed")
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


class Content:
    """Goes through the bytes of a record, never past their end.

    Parameters
    ----------
    where
        What the record is called in messages.
    """

    def __init__(self, content: bytes, where: str) -> None:
        self._content = content
        self._where = where
        self._at = 0

    @property
    def left(self) -> int:
        """How many bytes are left."""
        return len(self._content) - self._at

    def take(self, size: int) -> bytes:
        """Return the next bytes. Raises ReadError where there are fewer."""
        begin, self._at = self._at, self._at + size
        if self._at > len(self._content):
            raise damaged(self._where, "it ends before what it should hold")
        return self._content[begin : self._at]

    def structure(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Return the begin of a structure that says its size first, and go behind it, wherever it ends.

        Raises ReadError where it is smaller than the layout or there is less of it than it says.
        """
        values = layout.unpack(self.take(layout.size))
        if values[0] < layout.size:
            raise damaged(self._where, "a structure of it is smaller than it can be")
        self.take(values[0] - layout.size)
        return values


def damaged(where: str, why: str) -> ReadError:
    """Return what is raised for a record that cannot be as it is."""
    return ReadError(where, why, "copy the file again, or send one that is whole")
