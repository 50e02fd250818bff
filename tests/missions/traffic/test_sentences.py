"""Sentences of real ships, as public examples of AIS have them, and whatever else may come."""

import contextlib

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from app.missions.traffic.sentences import (
    MOST_UNFINISHED,
    SentenceError,
    SentenceReader,
    ShipParticulars,
    ShipPosition,
)
from tests.support.missions.ais import CLASS_A, CLASS_B, RECORDED, STATIC, sentence


def read(*lines: bytes) -> list[ShipPosition | ShipParticulars]:
    reader = SentenceReader()
    return [one for line in lines for one in reader.read(line, "test", 0.0) or []]


def test_a_position_of_class_a_is_read() -> None:
    [told] = read(CLASS_A)
    assert isinstance(told, ShipPosition)
    assert told.mmsi == 367380120
    assert (told.lat_deg, told.lon_deg) == pytest.approx((37.806948, -122.404333))
    assert told.sog_mps == pytest.approx(0.1 * 1852 / 3600)
    assert told.cog_deg == pytest.approx(245.2)
    assert told.heading_deg is None  # 511: it has no compass
    assert told.status == "under way using engine"


def test_a_position_of_class_b_is_read() -> None:
    [told] = read(CLASS_B)
    assert isinstance(told, ShipPosition)
    assert told.status is None
    assert -90 <= told.lat_deg <= 90


def test_what_a_ship_is_comes_in_two_sentences() -> None:
    [told] = read(*STATIC)
    assert told == ShipParticulars(351759000, False, "EVER DIADEM", "3FOF8", "cargo", 225.0, 70.0, 1.0, 31.0, 12.2)


def test_recorded_sentences_are_read_without_a_single_loss() -> None:
    told = read(*RECORDED)
    assert len({one.mmsi for one in told}) >= 6


def test_tag_blocks_and_other_talkers_are_read() -> None:
    [told] = read(rb"\s:2573135,c:1671620143*0B\!AIVDM,1,1,,A,16:=?;0P00`SstvFnFbeGH6L088h,0*44")
    assert told.mmsi > 0


def test_a_ship_that_does_not_know_where_it_is_has_no_position() -> None:
    assert read(sentence(msg_type=1, mmsi=211000001, lat=91.0, lon=181.0, speed=0.0, course=0.0)) == []


def test_what_is_not_told_is_none() -> None:
    [told] = read(sentence(msg_type=1, mmsi=211000001, lat=41.0, lon=-8.0, speed=102.3, course=360.0, status=15))
    assert isinstance(told, ShipPosition)
    assert (told.sog_mps, told.cog_deg, told.status) == (None, None, None)


def test_sentences_of_other_instruments_are_passed_over() -> None:
    assert read(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47") == []


@pytest.mark.parametrize(
    "line",
    [
        b"nothing",
        b"!AIVDM",
        CLASS_A[:-2] + b"00",
        CLASS_A[:20],
        STATIC[1],
        b"!AIVDM,1,1,,B," + b"1" * 2000 + b",0*05",
        b"\\" * 50,
        b"!AIVDM,1,1,,B,\xff\xfe,0*05",
    ],
)
def test_what_is_damaged_is_refused(line: bytes) -> None:
    with pytest.raises(SentenceError):
        read(line)


@given(st.binary(max_size=200))
@example(b"!AIVDM,1,1,,B,,0*25")
def test_whatever_comes_is_read_or_refused(line: bytes) -> None:
    with contextlib.suppress(SentenceError):
        read(line)


def test_damaged_sentences_are_read_or_refused_and_never_anything_else() -> None:
    chance = np.random.default_rng(7)
    lines = [*RECORDED, *STATIC, CLASS_A, CLASS_B]
    reader = SentenceReader()
    refused = 0
    for _ in range(3000):
        line = bytearray(lines[chance.integers(len(lines))])
        for _ in range(chance.integers(1, 5)):
            line[chance.integers(len(line))] = chance.integers(256)
        try:
            reader.read(bytes(line), "test", 0.0)
        except SentenceError:
            refused += 1
    assert refused > 2000


def test_messages_that_never_end_take_no_memory() -> None:
    reader = SentenceReader()
    for number in range(1000):
        channel = "AB"[number % 2]
        begun = sentence(msg_type=5, mmsi=211000001, shipname="GHOST", channel=channel, part=0, seq_id=number % 10)
        reader.read(begun, f"source {number}", 0.0)
    assert len(reader._parts) <= MOST_UNFINISHED


def test_parts_that_come_late_do_not_belong_together() -> None:
    reader = SentenceReader()
    assert reader.read(STATIC[0], "test", 0.0) == []
    with pytest.raises(SentenceError):
        reader.read(STATIC[1], "other", 1.0)
    reader.read(STATIC[0], "test", 0.0)
    reader.read(sentence(msg_type=5, mmsi=1, shipname="X", part=0, seq_id=7), "test", 100.0)
    with pytest.raises(SentenceError):
        reader.read(STATIC[1], "test", 101.0)
