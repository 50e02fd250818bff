"""KMALL: soundings where another library has them, and files that are not what they should be."""

import io
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from KMALL.kmall import kmall

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.georeferencing import place_soundings
from app.mapping.readers.multibeam.kmall import KmallFile
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import MapExtent, Points, ReadError, ReadOptions
from app.mapping.types import Grid
from tests.support.mapping.multibeam import floor, line, write_kmall

FRAME = LocalFrame(41.1850, -8.7040)
PLACE = MapExtent(FRAME, Grid(-40.0, -40.0, 2.0, 40, 40), margin_m=10.0)
BEAMS = 21


def read(content: bytes) -> Points:
    found = read_file(io.BytesIO(content), ".kmall", PLACE)
    assert isinstance(found, Points)
    return found


def other_datagram(kind: bytes = b"#SPO", size: int = 40) -> bytes:
    return struct.pack("<I4s12x", size, kind) + bytes(size - 24) + struct.pack("<I", size)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_kmall(tmp_path_factory.mktemp("kmall") / "a.kmall", line(FRAME))


@pytest.mark.filterwarnings("ignore:The inplace keyword:DeprecationWarning")
@pytest.mark.parametrize("heading_deg", [0.0, 200.0])
@pytest.mark.parametrize("version", [0, 1, 3])
def test_soundings_lie_where_another_library_has_them(tmp_path: Path, heading_deg: float, version: int) -> None:
    path = tmp_path / "a.kmall"
    found = read(other_datagram() + write_kmall(path, line(FRAME, heading_deg=heading_deg), version) + other_datagram())
    assert len(found.z) == found.found == 12 * BEAMS
    np.testing.assert_allclose(found.z, floor(found.x, found.y), atol=1e-3)
    library = kmall(str(path))
    lon, lat, depth = library.extractLonLatZ()
    library.closeFile()
    east, north = FRAME.to_local(lat, lon)
    np.testing.assert_allclose(found.x, east, atol=0.01)  # it adds small angles in single precision
    np.testing.assert_allclose(found.y, north, atol=0.01)
    np.testing.assert_allclose(found.z, depth, atol=1e-5)
    assert found.notes[0].startswith("12 pings from 2023-11-14T22:13:20+00:00 to 2023-11-14T22:13:25+00:00; 0 of 252")


def test_what_was_not_detected_or_is_rejected_is_left_out_and_counted(tmp_path: Path) -> None:
    [ping] = line(FRAME, pings=1)
    ping.beams = {"detectionType": [0] * 15 + [2] * 4 + [1] * 2, "detectionMethod": [0] * 3 + [1] * 6 + [2] * 12}
    found = read(write_kmall(tmp_path / "a.kmall", [ping]))
    assert found.found == 12
    assert "4 of 19 soundings are rejected in the file and left out, 3 have no depth" in found.notes[0]
    assert "2 extra detections in the water above the bottom are left out" in found.notes


def test_the_deviation_of_a_detection_is_added_to_what_is_assumed(tmp_path: Path) -> None:
    [ping] = line(FRAME, pings=1)
    ping.beams = {"detectionUncertaintyVer_m": [0.3] * 20 + [np.nan]}
    found = read(write_kmall(tmp_path / "a.kmall", [ping]))
    with pytest.raises(ReadError, match="21 of its depths state no uncertainty"):
        place_soundings(found, ReadOptions(), PLACE)
    placed = place_soundings(found, ReadOptions(sd_m=0.4), PLACE)
    assert placed.soundings.sd_m == pytest.approx([0.5] * 20 + [0.4])


@pytest.mark.parametrize(
    "more",
    [
        {"latitude_deg": 200.0, "longitude_deg": 200.0},
        {"latitude_deg": np.nan},
        {"posSensorStatus": 1},
        {"attitudeSensorStatus": 1},
        {"headingVessel_deg": np.nan},
        {"z_waterLevelReRefPoint_m": np.inf},
    ],
)
def test_pings_without_what_soundings_need_are_counted(tmp_path: Path, more: dict[str, float]) -> None:
    pings = line(FRAME, pings=3)
    pings[1].more = more
    found = read(write_kmall(tmp_path / "a.kmall", pings))
    assert set(found.lines) == {1, 3}
    assert "1 pings are incomplete and left out" in found.notes[0]


def test_the_sonar_s_depth_and_time_are_known(tmp_path: Path) -> None:
    pings = line(FRAME, pings=2)
    first, second = KmallFile(io.BytesIO(write_kmall(tmp_path / "a.kmall", pings))).pings()
    assert (first.sonar_depth_m, first.level_m) == (1.5, 0.0)
    assert second.time_s - first.time_s == pytest.approx(0.5, abs=1e-6)


COMMON_AT, INFORMATION_AT = 24, 36
RECEIVER_AT = INFORMATION_AT + 156 + 2 * 48


@pytest.mark.parametrize(
    ("change", "field", "said"),
    [
        (lambda content: b"", "file", "does not begin as KMALL does"),
        (lambda content: b"%PDF-1.7 " + content, "file", "does not begin as KMALL does"),
        (lambda content: content[:-1], "datagram 12", "ends within it"),
        (lambda content: content + bytes(3), "datagram 13", "ends within it"),
        (lambda content: content + bytes(64), "datagram 13", "none that the format has"),
        (lambda content: content + struct.pack("<I4s12x", 2**32 - 1, b"#MRZ"), "datagram 13", "it claims 4294967295"),
        (lambda content: content + struct.pack("<I4s12x", 2**32 - 1, b"#MWC"), "datagram 13", "ends within it"),
        (lambda content: content + other_datagram(size=24)[:-4] + bytes(4), "datagram 13", "another at its end"),
        (lambda content: content + struct.pack("<I4s12x", 23, b"#SPO") + bytes(8), "datagram 13", "none that"),
        (lambda content: other_datagram(b"#MRZ", 60), "datagram 1", "part of a datagram"),
        (lambda content: other_datagram(), "file", "of 0 in 0 pings 0 are rejected"),
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
        (20, 2, "part of a datagram"),
        (COMMON_AT, 1, "smaller than it can be"),
        (COMMON_AT, 65535, "ends before"),
        (INFORMATION_AT, 100, "smaller than it can be"),
        (INFORMATION_AT + 92, 65535, "ends before"),
        (RECEIVER_AT, 8, "smaller than it can be"),
        (RECEIVER_AT + 2, 65535, "ends before"),
        (RECEIVER_AT + 6, 90, "90 bytes are no sounding"),
        (RECEIVER_AT + 26, 65535, "ends before"),
        (RECEIVER_AT + 28, 65535, None),
    ],
)
def test_a_datagram_that_lies_is_refused(good: bytes, at: int, value: int, said: str | None) -> None:
    content = bytearray(good)
    struct.pack_into("<H", content, at, value)
    if said is None:  # classes of no bytes each, whatever their number
        assert read(bytes(content)).found == 12 * BEAMS
        return
    with pytest.raises(ReadError, match=said) as refused:
        read(bytes(content))
    assert refused.value.field == "datagram 1"


def test_longer_soundings_of_later_versions_are_read(tmp_path: Path, good: bytes) -> None:
    [ping] = line(FRAME, pings=1)
    content = write_kmall(tmp_path / "a.kmall", [ping])
    first = RECEIVER_AT + 32
    parts = [content[first + 120 * i : first + 120 * (i + 1)] + b"more" for i in range(BEAMS)]
    longer = bytearray(content[:first] + b"".join(parts) + content[-4:])
    struct.pack_into("<H", longer, RECEIVER_AT + 6, 124)
    for at in (0, len(longer) - 4):
        struct.pack_into("<I", longer, at, len(longer))
    np.testing.assert_array_equal(read(bytes(longer)).z, read(content).z)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, 6000), st.binary(min_size=1, max_size=4)), min_size=1, max_size=4))
def test_whatever_comes_is_read_or_refused(good: bytes, changes: list[tuple[int, bytes]]) -> None:
    content = bytearray(good)
    for at, piece in changes:
        content[at : at + len(piece)] = piece
    with suppress(ReadError):
        found = read(bytes(content))
        assert np.isfinite([found.x, found.y, found.z]).all()
