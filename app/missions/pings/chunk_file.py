"""Some thousand pings of a vehicle as one Parquet file, a row for each."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from app.arrays import IntArray
from app.mapping.swath.pings import BeamArray, Pings
from app.missions.pings.codec import BEAM_COLUMNS, PING_COLUMNS, JudgedPings, joined

ROW_GROUP = 1024


@dataclass(frozen=True)
class PingBlock:
    """Pings that were judged together, with the number that says in which order."""

    number: int
    step: int
    received_at: datetime
    source: str
    judged: JudgedPings


@dataclass(frozen=True)
class Chunk:
    """What a file holds; ``block`` and ``step`` (n,) are the numbers of the pings' blocks and steps."""

    block: IntArray
    step: IntArray
    judged: JudgedPings


def write_chunk(blocks: Sequence[PingBlock], mission_id: str, vehicle: str) -> bytes:
    """Return the file of some blocks, the same whenever it is made of the same."""
    import pyarrow as pa  # slow to import, and needed by those only who have pings
    import pyarrow.parquet as pq

    sizes = [len(block.judged) for block in blocks]
    pings = joined([block.judged.pings for block in blocks])

    def of_each(values: Sequence[Any], kind: Any) -> Any:
        return pa.array([value for value, size in zip(values, sizes, strict=True) for _ in range(size)], type=kind)

    columns = {
        "block": of_each([block.number for block in blocks], pa.int64()),
        "step": of_each([block.step for block in blocks], pa.int32()),
        "received_at": of_each([block.received_at for block in blocks], pa.timestamp("us", tz="UTC")),
        "source": of_each([block.source for block in blocks], pa.string()),
        "reason": pa.array([reason for block in blocks for reason in block.judged.reasons], type=pa.string()),
    }
    columns |= {name: pa.array(getattr(pings, name)) for name in PING_COLUMNS}
    # Beams that only fill a shorter ping up are not written.
    there = ~np.isnan(pings.angle_rad) | ~np.isnan(pings.range_m)
    width = there.shape[1]
    lengths = np.where(there.any(axis=1), width - there[:, ::-1].argmax(axis=1), 0) if width else np.zeros(len(pings))
    written = np.arange(width) < lengths[:, None]
    offsets = pa.array(np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32))
    for name in BEAM_COLUMNS:
        columns[name] = pa.ListArray.from_arrays(offsets, pa.array(getattr(pings, name)[written]))
    table = pa.table(columns).replace_schema_metadata({"mission_id": mission_id, "vehicle": vehicle})
    out = pa.BufferOutputStream()
    pq.write_table(
        table,
        out,
        compression="zstd",
        row_group_size=ROW_GROUP,
        # Angles are often the same in every ping; ranges never are.
        use_dictionary=["step", "received_at", "source", "reason", "angle_rad.list.element"],
        use_byte_stream_split=[*PING_COLUMNS, "range_m.list.element"],
    )
    return bytes(out.getvalue())


def read_chunk(content: bytes) -> Chunk:
    """Return what a file holds."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(pa.BufferReader(content)).combine_chunks()
    columns = {name: np.asarray(table[name]) for name in PING_COLUMNS}
    columns |= {name: _padded(table[name].combine_chunks()) for name in BEAM_COLUMNS}
    reasons = tuple(table["reason"].to_pylist())
    judged = JudgedPings(Pings(**columns), reasons)
    return Chunk(np.asarray(table["block"]), np.asarray(table["step"]), judged)


def _padded(lists: Any) -> BeamArray:
    """Return lists as rows, the shorter ones filled up with NaN."""
    offsets = np.asarray(lists.offsets)
    values = np.asarray(lists.values)[offsets[0] : offsets[-1]]
    lengths = np.diff(offsets)
    if len(lengths) and (lengths == lengths[0]).all():
        return values.reshape(len(lengths), -1)
    rows = np.full((len(lengths), int(lengths.max(initial=0))), np.nan, np.float32)
    rows[np.arange(rows.shape[1]) < lengths[:, None]] = values
    return rows
