"""GSF: soundings where two other libraries have them, and files that are not what they should be."""

import io
import json
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bluemvmt_gsf.libgsf import GsfFile as LibraryFile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.georeferencing import place_soundings
from app.mapping.readers.multibeam.gsf import PING, SINGLE_BEAM, GsfFile
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import MapExtent, Points, ReadError, ReadOptions
from app.mapping.s44 import NORMAL_95
from app.mapping.types import Grid
from tests.support.mapping.multibeam import floor, line, write_gsf

FRAME = LocalFrame(41.1850, -8.7040)
PLACE = MapExtent(FRAME, Grid(-40.0, -40.0, 2.0, 40, 40), margin_m=10.0)
FRAME_BYTES = 8


def read(content: bytes, place: MapExtent = PLACE) -> Points:
    found = read_file(io.BytesIO(content), ".gsf", place)
    assert isinstance(found, Points)
    return found


def records(content: bytes) -> list[tuple[int, bytes]]:
    """Types and contents of a file's records."""
    found, at = [], 0
    while at < len(content):
        size, kind = struct.unpack_from(">II", content, at)
        found.append((kind, content[at + FRAME_BYTES : at + FRAME_BYTES + size]))
        at += FRAME_BYTES + size
    return found


def joined(parts: list[tuple[int, bytes]]) -> bytes:
    return b"".join(struct.pack(">II", len(content), kind) + content for kind, content in parts)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_gsf(tmp_path_factory.mktemp("gsf") / "a.gsf", line(FRAME))


@pytest.mark.parametrize("heading_deg", [0.0, 60.0, 200.0, 315.0])
@pytest.mark.parametrize("version", ["GSF-v03.09", "GSF-v02.09"])
def test_soundings_lie_where_they_were_measured(tmp_path: Path, heading_deg: float, version: str) -> None:
    pings = line(FRAME, heading_deg=heading_deg)
    found = read(write_gsf(tmp_path / "a.gsf", pings, version=version))
    assert len(found.z) == found.found == sum(len(ping.depth_m) for ping in pings)
    # Positions are written in 1e-7 degrees, distances in centimetres.
    np.testing.assert_allclose(found.z, floor(found.x, found.y), atol=0.01)
    assert np.hypot(found.x, found.y).max() == pytest.approx(np.hypot(20.0, 12.0), abs=4.0)
    assert (found.positive, found.lines.max()) == ("down", len(pings))
    placed = place_soundings(found, ReadOptions(crs="EPSG:32629", sd_m=0.3), PLACE)  # nothing has to be said
    np.testing.assert_allclose(placed.soundings.east_m, found.x, atol=1e-6)
    assert "crs is not used" in placed.notes[-2]
    assert found.notes[0].startswith("12 pings from 2023-11-14T22:13:20+00:00 to 2023-11-14T22:13:25+00:00; 0 of 252")


def test_the_format_s_own_library_reads_the_same(tmp_path: Path) -> None:
    path = tmp_path / "a.gsf"
    more = {"TideCorrector_m": -1.25, "DepthCorrector_m": 3.5}
    content = write_gsf(path, line(FRAME, error_95_m=np.linspace(0.1, 0.6, 21), flags=np.arange(21) % 4, more=more))
    with LibraryFile(path) as library:
        theirs = [json.loads(record)["json_record"] for record in library.next_json_record(PING)]
    for own, other in zip(GsfFile(io.BytesIO(content)).pings(), theirs, strict=True):
        np.testing.assert_allclose(own.depth_m, other["depth"], atol=1e-6)
        np.testing.assert_allclose(own.starboard_m, other["across_track"], atol=1e-6)
        np.testing.assert_allclose(own.sd_m * NORMAL_95, other["vertical_error"], atol=1e-6)
        assert own.time_s == pytest.approx(other["ping_time"], abs=1e-6)
        assert (own.lat_deg, own.lon_deg) == pytest.approx((other["latitude"], other["longitude"]), abs=1e-9)
        assert (own.level_m, own.sonar_depth_m) == (other["tide_corrector"], other["depth_corrector"])
        assert own.heading_deg == other["heading"]


def test_what_the_file_rejects_is_left_out_and_counted(tmp_path: Path) -> None:
    pings = line(FRAME, pings=3, flags=np.arange(21) % 4)  # bit 1 only says how a beam was chosen
    pings[1].more = {"PingFlags": 1}
    pings[2].depth_m = pings[2].depth_m * (np.arange(21) != 2)
    found = read(write_gsf(tmp_path / "a.gsf", pings))
    assert found.found == 11 + 0 + 10
    assert set(found.lines) == {1, 3}
    assert "41 of 63 soundings are rejected in the file and left out, 1 have no depth" in found.notes[0]


def test_the_error_that_is_stated_at_95_per_cent_becomes_a_deviation_until_another_comes(tmp_path: Path) -> None:
    pings = line(FRAME, pings=3)
    pings[0].error_95_m = np.full(21, 0.49)
    pings[2].error_95_m = np.full(21, 0.98)
    found = read(write_gsf(tmp_path / "a.gsf", pings))
    assert found.sd_m == pytest.approx(np.repeat([0.25, 0.25, 0.5], 21), rel=1e-3)
    alone = read(write_gsf(tmp_path / "b.gsf", line(FRAME, pings=1)))
    with pytest.raises(ReadError, match="21 of its depths state no uncertainty"):
        place_soundings(alone, ReadOptions(), PLACE)
    assert place_soundings(alone, ReadOptions(order="1a"), PLACE).soundings.sd_m == pytest.approx(0.29, abs=0.01)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"TIDE_COMPENSATED": "YES"}, "says that its depths are reduced for the tide"),
        ({"TIDE_COMPENSATED": "NO"}, "does not say that its depths are reduced"),
        (None, "does not say that its depths are reduced"),
        ({"HEAVE_COMPENSATED": "NO"}, "not corrected for heave"),
        ({"DEPTH_CALCULATION": "RELATIVE_TO_1500_MS"}, "assume a sound speed of 1500 m/s"),
        ({"GEOID": "NAD-27"}, "another datum than WGS 84"),
        ({"GEOID": "WGS-84"}, "nobody may have looked for wrong soundings"),
    ],
)
def test_what_was_done_to_the_depths_is_told(tmp_path: Path, parameters: dict[str, str] | None, said: str) -> None:
    notes = read(write_gsf(tmp_path / "a.gsf", line(FRAME, pings=1), parameters)).notes
    assert any(said in note for note in notes), notes
    assert not any("NAD" in note for note in notes), "files are not quoted"


@pytest.mark.parametrize(("tide_m", "gps_m", "level_m"), [(-0.5, 0.0, -0.5), (99.99, 0.7, 0.7), (0.7, 0.7, 0.7)])
def test_the_level_that_was_added_is_known(tmp_path: Path, tide_m: float, gps_m: float, level_m: float) -> None:
    pings = line(FRAME, pings=1, more={"TideCorrector_m": tide_m, "GPSTideCorrector_m": gps_m})
    [ping] = GsfFile(io.BytesIO(write_gsf(tmp_path / "a.gsf", pings))).pings()
    assert ping.level_m == pytest.approx(level_m)


def test_two_levels_leave_open_which_was_added(tmp_path: Path) -> None:
    pings = line(FRAME, pings=1, more={"TideCorrector_m": 0.5, "GPSTideCorrector_m": 0.7})
    [ping] = GsfFile(io.BytesIO(write_gsf(tmp_path / "a.gsf", pings))).pings()
    assert np.isnan(ping.level_m)
    assert np.isnan(ping.sonar_depth_m)


def test_pings_without_a_place_and_soundings_of_one_beam_are_counted(tmp_path: Path, good: bytes) -> None:
    pings = line(FRAME, pings=4)
    pings[1].more = {"Heading_deg": 361.0}
    pings[2].more = {"Latitude_deg": 91.0, "Longitude_deg": 181.0}
    content = write_gsf(tmp_path / "a.gsf", pings)
    found = read(content + joined([(SINGLE_BEAM, bytes(60)), (1 << 12 | PING, b"private!")]))
    assert set(found.lines) == {1, 4}
    assert "2 pings are incomplete and left out" in found.notes[0]
    assert "1 soundings of single-beam records are left out" in found.notes


def test_checksums_are_looked_at(good: bytes) -> None:
    parts = []
    for kind, content in records(good):
        parts.append(struct.pack(">III", len(content), kind | 1 << 31, sum(content) % 2**32) + content)
    assert len(read(b"".join(parts)).z) == len(read(good).z)
    damaged = bytearray(b"".join(parts))
    damaged[-10] ^= 1
    with pytest.raises(ReadError, match="checksum is another"):
        read(bytes(damaged))


def test_intensities_are_passed_over(good: bytes) -> None:
    """Their word counts itself, unlike those of all other subrecords."""
    parts = records(good)
    series = struct.pack(">I", 21 << 24 | 4 + 8) + bytes(8)
    flags = struct.pack(">I", 16 << 24 | 21) + bytes([1] * 21)
    kind, content = parts[1]
    parts[1] = (kind, content + series + flags)
    assert 1 not in read(joined(parts)).lines


def edited(change: Callable[[list[tuple[int, bytes]]], Any]) -> Callable[[bytes], bytes]:
    def edit(content: bytes) -> bytes:
        parts = records(content)
        change(parts)
        return joined(parts)

    return edit


def without_scales(ping: bytes) -> bytes:
    [word] = struct.unpack_from(">I", ping, SCALES_AT)
    return ping[:SCALES_AT] + ping[SCALES_AT + 4 + (word & 0xFFFFFF) :]


SCALES_AT = 56
"""Where the scale factors begin in a file's first ping."""


@pytest.mark.parametrize(
    ("change", "field", "said"),
    [
        (lambda content: b"", "file", "does not begin as GSF does"),
        (lambda content: b"%PDF-1.7 " + content, "file", "does not begin as GSF does"),
        (lambda content: content.replace(b"GSF-v03", b"GSF-v01"), "file", "a version of GSF that is not read"),
        (lambda content: content[:-1], "record 13", "ends within it"),
        (lambda content: content + bytes(3), "record 14", "ends within it"),
        (lambda content: content + bytes(64), "record 14", "none that the format has"),
        (lambda content: content + struct.pack(">II", 2**32 - 4, PING), "record 14", "it claims 4294967292 bytes"),
        (lambda content: content + struct.pack(">II", 2**32 - 4, 12), "record 14", "ends within it"),
        (edited(lambda parts: parts.__setitem__(1, (PING, parts[1][1][:50]))), "record 2", "ends before"),
        (edited(lambda parts: parts.__setitem__(1, (PING, parts[1][1][:90]))), "record 2", "ends before"),
        (edited(lambda parts: parts.__setitem__(1, (PING, without_scales(parts[1][1])))), "record 2", "no scale"),
        (edited(lambda parts: parts.insert(1, (4, bytes(8) + b"\xff\xff"))), "record 2", "ends before"),
        (lambda content: content[:20], "file", "of 0 in 0 pings 0 are rejected"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(
    good: bytes, change: Callable[[bytes], bytes], field: str, said: str
) -> None:
    with pytest.raises(ReadError, match=said) as refused:
        read(change(good))
    assert refused.value.field == field


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (SCALES_AT + 8 + 4, bytes(4), "scale factor of it is 0"),
        (SCALES_AT + 8 + 1, b"\x41", "compressed"),
        (SCALES_AT + 4, struct.pack(">I", 2**31), "ends before"),
        (16, struct.pack(">H", 20), "no values of 20 beams"),
        (SCALES_AT + 8 + 4, struct.pack(">I", 1), "deeper than 11100 m"),
    ],
)
def test_a_ping_that_lies_is_refused(good: bytes, at: int, value: bytes, said: str) -> None:
    parts = records(good)
    kind, content = parts[1]
    parts[1] = (kind, content[:at] + value + content[at + len(value) :])
    with pytest.raises(ReadError, match=said):
        read(joined(parts))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, 1200), st.binary(min_size=1, max_size=4)), min_size=1, max_size=4))
def test_whatever_comes_is_read_or_refused(good: bytes, changes: list[tuple[int, bytes]]) -> None:
    content = bytearray(good)
    for at, piece in changes:
        content[at : at + len(piece)] = piece
    with suppress(ReadError):
        found = read(bytes(content))
        assert np.isfinite([found.x, found.y, found.z]).all()
