"""What the process that reads a log says, as bytes: text in which nothing but values of known kinds can be told.

The process has read what nobody vouches for, so everything that it says is checked, and no code runs by it.
"""

import base64
import json
from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, TypeAdapter

from app.missions.fleet.interface import PingReport, Position, SoundingReport, VehicleReport
from app.missions.operations.imports.log_batches import (
    BATCH,
    LogBatch,
    LogFacts,
    LogItem,
    OpenedLog,
    RefusedLog,
    Report,
    UnreadLog,
)

MAX_SAID_BYTES = 1 << 18
"""Of anything besides a batch: the casts of a day, told as finely as they may be, are a third of it."""


class _Ping(BaseModel):
    """A :class:`PingReport`; its arrays (b,) are base64 of little-endian float32."""

    model_config = ConfigDict(extra="forbid")

    vehicle: str
    time_s: float
    position: Position
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    angles_rad: str
    ranges_m: str
    source: str
    position_sd_m: float | None

    def report(self) -> PingReport:
        """Return what it stands for. Raises ValueError."""
        angles_rad, ranges_m = _array(self.angles_rad), _array(self.ranges_m)
        if angles_rad.size != ranges_m.size:
            raise ValueError("a ping has as many ranges as angles")
        plain = {name: getattr(self, name) for name in type(self).model_fields}
        return PingReport(**plain | {"angles_rad": angles_rad, "ranges_m": ranges_m})


def _kind(report: dict[str, Any]) -> str:
    return "sounding" if "footprint" in report else "ping" if "angles_rad" in report else "state"


class _Batch(BaseModel):
    """A :class:`LogBatch`."""

    model_config = ConfigDict(extra="forbid")

    reports: Annotated[
        list[
            Annotated[
                Annotated[SoundingReport, Tag("sounding")]
                | Annotated[VehicleReport, Tag("state")]
                | Annotated[_Ping, Tag("ping")],
                Discriminator(_kind),
            ]
        ],
        Field(min_length=1, max_length=BATCH),
    ]
    read_bytes: Annotated[int, Field(ge=0)]

    def batch(self) -> LogBatch:
        """Return what it stands for. Raises ValueError."""
        reports: list[Report] = [one.report() if isinstance(one, _Ping) else one for one in self.reports]
        return LogBatch(reports, self.read_bytes)


_BEGINS: dict[type, bytes] = {OpenedLog: b"O", LogBatch: b"B", LogFacts: b"F", RefusedLog: b"R", UnreadLog: b"U"}
"""The byte that an item begins with."""
_ITEMS: dict[bytes, TypeAdapter[Any]] = {
    begin: TypeAdapter(_Batch if kind is LogBatch else kind) for kind, begin in _BEGINS.items()
}


def item_bytes(item: LogItem) -> bytes:
    """Return an item as bytes."""
    if isinstance(item, LogBatch):
        plain = {"reports": [_plain(report) for report in item.reports], "read_bytes": item.read_bytes}
    else:
        plain = asdict(item)
    return _BEGINS[type(item)] + json.dumps(plain).encode()


def item_of(content: bytes) -> LogItem:
    """Return the item that bytes stand for. Raises ValueError where they are none."""
    adapter = _ITEMS.get(content[:1])
    if adapter is None or (content[:1] != b"B" and len(content) > MAX_SAID_BYTES):
        raise ValueError("this is no item of a log")
    item: LogItem | _Batch = adapter.validate_json(content[1:], strict=True)
    return item.batch() if isinstance(item, _Batch) else item


def _plain(report: Report) -> dict[str, Any]:
    if not isinstance(report, PingReport):
        return asdict(report)
    names = (name for name in _Ping.model_fields if name != "position")
    plain = {name: getattr(report, name) for name in names} | {"position": asdict(report.position)}
    return plain | {name: _text(plain[name]) for name in ("angles_rad", "ranges_m")}


def _text(values: NDArray[np.float32]) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")


def _array(text: str) -> NDArray[np.float32]:
    return np.frombuffer(base64.b64decode(text, validate=True), "<f4").astype(np.float32)
