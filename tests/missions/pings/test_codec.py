"""Pings come back from bytes and from files as they were, to the last bit."""

from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.mapping.swath.pings import Pings
from app.missions.pings.chunk_file import PingBlock, read_chunk, write_chunk
from app.missions.pings.codec import PING_COLUMNS, VERSION, JudgedPings, pack, unpack
from tests.support.missions.pings import same

AT = datetime(2026, 6, 1, 12, 30, tzinfo=UTC)


def three_pings() -> Pings:
    beams = np.ones((3, 4), np.float32)
    columns = {name: np.arange(3.0) for name in PING_COLUMNS}
    return Pings(**columns, angle_rad=beams.copy(), range_m=beams.copy())


@st.composite
def judged(draw: st.DrawFn) -> JudgedPings:
    count, beams = draw(st.integers(0, 6)), draw(st.integers(0, 7))
    single = arrays(np.float64, count, elements=st.floats(allow_nan=True, allow_infinity=True, width=64))
    beam = arrays(np.float32, (count, beams), elements=st.floats(allow_nan=True, allow_infinity=True, width=32))
    columns = {name: draw(single) for name in PING_COLUMNS}
    reasons = draw(st.lists(st.sampled_from(["", "", "position: far", "time_s: ü"]), min_size=count, max_size=count))
    return JudgedPings(Pings(**columns, angle_rad=draw(beam), range_m=draw(beam)), tuple(reasons))


@given(judged())
def test_bytes_hold_all_of_it(pings: JudgedPings) -> None:
    found = unpack(pack(pings))
    assert found.reasons == pings.reasons
    assert found.pings.range_m.shape == pings.pings.range_m.shape
    assert same(found.pings, pings.pings)


@given(st.lists(judged(), min_size=1, max_size=4))
def test_a_file_holds_all_of_its_blocks(parts: list[JudgedPings]) -> None:
    blocks = [PingBlock(10 + i, i, AT, "sonar", part) for i, part in enumerate(parts)]
    content = write_chunk(blocks, "m1", "a")
    assert content == write_chunk(blocks, "m1", "a"), "a file that is written again is the same"
    found = read_chunk(content)
    assert found.judged.reasons == tuple(reason for part in parts for reason in part.reasons)
    assert found.block.tolist() == [10 + i for i, part in enumerate(parts) for _ in range(len(part))]
    assert same(found.judged.pings, Pings.joined([part.pings for part in parts]))


def test_others_can_read_a_file() -> None:
    pings = three_pings()
    pings.angle_rad[1, 2:] = pings.range_m[1, 2:] = np.nan
    content = write_chunk([PingBlock(1, 5, AT, "sonar", JudgedPings(pings, ("", "far", "")))], "m1", "a")
    table = pq.read_table(pa.BufferReader(content))
    assert table.num_rows == 3
    assert table["range_m"].to_pylist() == [[1.0] * 4, [1.0] * 2, [1.0] * 4]
    assert table["reason"].to_pylist() == ["", "far", ""]
    assert table["received_at"].to_pylist() == [AT] * 3
    assert table.schema.metadata == {b"mission_id": b"m1", b"vehicle": b"a"}


def test_other_versions_and_damage_are_noticed() -> None:
    pings = three_pings()
    stored = pack(JudgedPings(pings, ("",) * 3))
    with pytest.raises(ValueError, match=f"version 9, this program reads {VERSION}"):
        unpack(b"\x09" + stored[1:])
    with pytest.raises(ValueError, match="damaged"):
        unpack(stored[:-5])
    with pytest.raises(ValueError, match="fewer bytes"):
        unpack(stored[:1] + b"\xff" + stored[2:])
