"""Pings as they were judged, and as bytes in the database."""

import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from app.arrays import BoolArray
from app.mapping.swath.pings import Pings
from app.missions.fleet.interface import PingReport

VERSION = 1
_HEAD = struct.Struct("<BII")
BEAM_COLUMNS = ("angle_rad", "range_m")
PING_COLUMNS = tuple(column.name for column in fields(Pings) if column.name not in BEAM_COLUMNS)


@dataclass(frozen=True)
class JudgedPings:
    """Pings of one vehicle in the order in which they were judged, and why each is refused; empty where it is not."""

    pings: Pings
    reasons: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.reasons)

    @property
    def is_accepted(self) -> BoolArray:
        """Whether each is accepted, (n,)."""
        return np.array([not reason for reason in self.reasons], dtype=bool)

    @property
    def accepted(self) -> Pings:
        """Those that are accepted."""
        return self.pings if not any(self.reasons) else self.pings.take(self.is_accepted)


def columns_of(reports: Sequence[PingReport]) -> Pings:
    """Return reports as columns."""
    most = max((len(report.angles_rad) for report in reports), default=0)
    angle = np.full((len(reports), most), np.nan, np.float32)
    range_m = np.full((len(reports), most), np.nan, np.float32)
    for row, report in enumerate(reports):
        angle[row, : len(report.angles_rad)] = report.angles_rad
        range_m[row, : len(report.ranges_m)] = report.ranges_m
    return Pings(
        time_s=np.array([report.time_s for report in reports], dtype=float),
        lat_deg=np.array([report.position.lat_deg for report in reports], dtype=float),
        lon_deg=np.array([report.position.lon_deg for report in reports], dtype=float),
        depth_m=np.array([report.position.depth_m for report in reports], dtype=float),
        roll_rad=np.array([report.roll_rad for report in reports], dtype=float),
        pitch_rad=np.array([report.pitch_rad for report in reports], dtype=float),
        heading_rad=np.array([report.heading_rad for report in reports], dtype=float),
        position_sd_m=np.array(
            [np.nan if report.position_sd_m is None else report.position_sd_m for report in reports], dtype=float
        ),
        angle_rad=angle,
        range_m=range_m,
    )


def joined(parts: Sequence[Pings]) -> Pings:
    """Return all pings of many parts in their order."""
    if len({part.angle_rad.shape[1] for part in parts}) != 1:
        return Pings.joined(parts)
    names = (*PING_COLUMNS, *BEAM_COLUMNS)
    return Pings(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def pack(judged: JudgedPings) -> bytes:
    """Return pings as they are stored: a version, how many of how many beams, and the columns, compressed by zlib.

    Columns are little-endian numbers, those of pings as float64, then those of beams as float32: first the first bytes
    of all of them, then the second ones and so on, which compresses better. Then come the reasons as JSON.
    """
    pings = judged.pings
    parts = [
        _by_bytes(np.array([getattr(pings, name) for name in PING_COLUMNS], dtype="<f8")),
        _by_bytes(np.array([getattr(pings, name) for name in BEAM_COLUMNS], dtype="<f4")),
        orjson.dumps(judged.reasons) if any(judged.reasons) else b"",
    ]
    return _HEAD.pack(VERSION, *pings.angle_rad.shape) + zlib.compress(b"".join(parts), level=1)


def unpack(stored: bytes) -> JudgedPings:
    """Return stored pings. Raises ValueError when they are of another version or damaged."""
    version, count, beams = _HEAD.unpack_from(stored)
    if version != VERSION:
        raise ValueError(f"pings are stored in version {version}, this program reads {VERSION}")
    try:
        content = memoryview(zlib.decompress(memoryview(stored)[_HEAD.size :]))
    except zlib.error as error:
        raise ValueError(f"stored pings are damaged: {error}") from None
    of_pings, content = _from_bytes(content, (len(PING_COLUMNS), count), "<f8")
    of_beams, content = _from_bytes(content, (len(BEAM_COLUMNS), count, beams), "<f4")
    columns = dict(zip(PING_COLUMNS, of_pings, strict=True)) | dict(zip(BEAM_COLUMNS, of_beams, strict=True))
    reasons = tuple(orjson.loads(content)) if content else ("",) * count
    return JudgedPings(Pings(**columns), reasons)


def _by_bytes(numbers: NDArray[np.floating]) -> bytes:
    return numbers.reshape(-1).view(np.uint8).reshape(-1, numbers.itemsize).T.tobytes()


def _from_bytes(content: memoryview, shape: tuple[int, ...], kind: str) -> tuple[NDArray[Any], memoryview]:
    """Return the numbers at the begin of some bytes, and what follows them."""
    bytes_each = int(kind[2:])
    size = math.prod(shape) * bytes_each
    if len(content) < size:
        raise ValueError("stored pings are damaged: there are fewer bytes than they say")
    by_bytes = np.frombuffer(content[:size], np.uint8).reshape(bytes_each, -1)
    return np.ascontiguousarray(by_bytes.T).view(kind).reshape(shape), content[size:]
