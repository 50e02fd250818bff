"""Vehicles' own logs, as soundings: what the file holds is what comes out, however damaged the file is."""

import gzip
import hashlib
import math
import statistics
from itertools import pairwise
from pathlib import Path
from typing import SupportsIndex

import imcpy
import numpy as np
import pytest
from imcpy.coordinates import WGS84

from imc_bridge import (
    BridgeSettings,
    PingRefused,
    Sounding,
    SoundingRefused,
    SoundSpeedSample,
    StateReport,
    SwathPing,
    logs,
)
from imc_bridge.logs import LogError, PacketFile, VehicleLog
from tests.support.imc import log_writer as writer

SETTINGS = BridgeSettings()


def soundings_of(log: VehicleLog) -> list[Sounding]:
    return [event for event in log.events() if isinstance(event, Sounding)]


@pytest.mark.parametrize("name", ["Data.lsf", "Data.lsf.gz"])
def test_soundings_lie_where_and_how_deep_the_bottom_was(tmp_path: Path, name: str) -> None:
    log = VehicleLog(writer.write(tmp_path / name, writer.survey(200)), SETTINGS)
    found = soundings_of(log)
    assert log.vehicle == writer.NAME
    assert len(found) == 200
    for sounding in found:
        north_m = writer.SPEED_MPS * (sounding.time_s - writer.START_S)
        lat = math.degrees(WGS84.displace(writer.LAT_RAD, writer.LON_RAD, north_m, 5.0)[0])
        assert sounding.lat_deg == pytest.approx(lat, abs=1e-8)
        assert sounding.bottom_depth_m == pytest.approx(writer.bottom_m(north_m), abs=1e-3)
    assert log.refused == {}
    assert not log.file.cut_off
    assert log.file.read_bytes == log.file.size_bytes


def test_sound_speeds_are_of_where_the_vehicle_was(tmp_path: Path) -> None:
    begin_s = writer.START_S + 60.0
    late = [writer.sound_speed(begin_s + 300.0, 1500.0), writer.sound_speed(begin_s + 50.0, 1500.0, writer.OTHER_ID)]
    packets = [*writer.survey(5), *writer.dive(begin_s, 12.0, 100), *late]
    log = VehicleLog(writer.write(tmp_path / "Data.lsf", packets), SETTINGS)
    found = [event for event in log.events() if isinstance(event, SoundSpeedSample)]
    assert len(found) == 100, "neither those that are none, nor far from any state, nor another vehicle's"
    for one in found:
        assert one.speed_mps == pytest.approx(writer.sound_speed_mps(one.depth_m), abs=1e-3)
    assert {one.source for one in found} == {"CTD"}
    deepest_m = writer.dive_depth_m(50.1, 12.0, 100)
    assert max(one.depth_m for one in found) == pytest.approx(deepest_m), "a tenth of a second past the turn"


def test_the_same_file_gives_the_same_events_every_time(tmp_path: Path) -> None:
    log = VehicleLog(writer.write(tmp_path / "Data.lsf.gz", writer.survey(50)), SETTINGS)
    assert list(log.events()) == list(log.events())


def test_what_is_no_sounding_is_counted_with_its_reason(tmp_path: Path) -> None:
    good = [*writer.survey(20)]
    end_s = writer.START_S + 20 * writer.PING_PERIOD_S
    bad = [
        writer.distance(writer.START_S + 1.01, 7.0, valid=False),
        writer.distance(writer.START_S + 1.02, 0.0),
        writer.distance(writer.START_S + 1.03, math.nan),
        writer.distance(writer.START_S + 1.045, 900.0),
        writer.distance(writer.START_S + 1.05, 8.0),
        writer.distance(writer.START_S + 1.05, 8.0),
        writer.distance(writer.START_S + 1.06, 8.0, entity=writer.FORWARD),
        writer.distance(writer.START_S + 1.07, 8.0, src=writer.OTHER_ID),
        writer.state(writer.START_S + 1.0, 4000.0, src=writer.OTHER_ID),
        writer.distance(end_s + 60.0, 8.0),
    ]
    log = VehicleLog(writer.write(tmp_path / "Data.lsf", good + bad), SETTINGS)
    events = list(log.events())
    assert sum(isinstance(event, Sounding) for event in events) == 21, "20 of the line and one of the extra ones"
    assert log.refused == {
        "marked invalid by the sensor": 1,
        "zero or negative range": 1,
        "not a number": 1,
        "beyond 200 m": 1,
        "repeated": 1,
        "no state of the vehicle around its time": 1,
    }
    assert sum(isinstance(event, SoundingRefused) for event in events) == sum(log.refused.values())
    assert {event.vehicle for event in events if isinstance(event, StateReport)} == {writer.NAME}


def test_the_beams_of_a_dvl_and_its_filtered_range_are_different_soundings(tmp_path: Path) -> None:
    names = imcpy.EntityList()
    names.op = imcpy.EntityList.OperationEnum.REPORT
    names.list = "DVL Beam 0=70;DVL Beam 1=71;DVL Beam 2=72;DVL Beam 3=73;DVL Filtered=74"
    at_s = writer.START_S + 1.05
    packets = [writer.packet(names, writer.START_S), *list(writer.survey(10))[1:]]
    packets += [writer.distance(at_s, 10.0, entity=70 + beam) for beam in range(5)]
    found = soundings_of(VehicleLog(writer.write(tmp_path / "Data.lsf", packets), SETTINGS))
    assert len({(sounding.time_s, sounding.beam) for sounding in found}) == 5


def test_pings_of_a_multibeam_come_out_where_the_vehicle_was(tmp_path: Path) -> None:
    packets = [*writer.survey(20)]
    times = [writer.START_S + 1.03 + 0.2 * k for k in range(5)]
    end_s = writer.START_S + 20 * writer.PING_PERIOD_S
    pings = [writer.ping(at_s, 8.0) for at_s in (*times, times[0], end_s + 60.0)]
    log = VehicleLog(writer.write(tmp_path / "Data.lsf", packets + pings), SETTINGS)
    events = list(log.events())
    found = [event for event in events if isinstance(event, SwathPing)]
    assert [ping.time_s for ping in found] == times
    for ping in found:
        north_m = writer.SPEED_MPS * (ping.time_s - writer.START_S)
        lat = math.degrees(WGS84.displace(writer.LAT_RAD, writer.LON_RAD, north_m, 5.0)[0])
        assert ping.lat_deg == pytest.approx(lat, abs=1e-8)
        np.testing.assert_allclose(ping.ranges_m * np.cos(ping.angles_rad), 8.0, atol=0.01)
    assert log.pings_refused == {"repeated": 1, "no state of the vehicle around its time": 1}
    assert sum(isinstance(event, PingRefused) for event in events) == 2
    assert log.refused == {}, "of Distances"


@pytest.mark.parametrize("name", ["Data.lsf", "Data.lsf.gz"])
def test_a_log_that_ends_in_the_middle_is_used_up_to_there(tmp_path: Path, name: str) -> None:
    path = writer.write(tmp_path / name, writer.survey(100))
    path.write_bytes(path.read_bytes()[:-30])
    log = VehicleLog(path, SETTINGS)
    assert 60 <= len(soundings_of(log)) <= 100
    assert log.file.cut_off


def test_garbage_between_packets_is_skipped(tmp_path: Path) -> None:
    packets = [*writer.survey(30)]
    packets.insert(20, b"\x00garbage\xfe" * 7)
    packets.insert(10, bytes(1000))
    log = VehicleLog(writer.write(tmp_path / "Data.lsf", packets), SETTINGS)
    assert len(soundings_of(log)) == 30
    assert log.file.skipped_bytes == 9 * 7 + 1000


def test_damaged_bytes_never_end_the_reading(tmp_path: Path) -> None:
    whole = b"".join(writer.survey(60))
    chance = np.random.default_rng(5)
    for _ in range(20):
        damaged = bytearray(whole)
        for place in chance.integers(400, len(damaged), 40):
            damaged[place] = chance.integers(256)
        path = tmp_path / "Data.lsf"
        path.write_bytes(damaged)
        found = soundings_of(VehicleLog(path, SETTINGS))
        for sounding in found:
            assert 10.0 <= sounding.bottom_depth_m <= 14.0, "a damaged packet was believed"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "holds no IMC packet"),
        (b"not a log at all, but long enough to be looked at", "holds no IMC packet"),
        (gzip.compress(b"nor this one, which is compressed", mtime=0), "holds no IMC packet"),
        (gzip.compress(b"cut", mtime=0)[:8], "holds no IMC packet"),
        (writer.announce(1e9), "holds no EstimatedState"),
        (writer.state(1e9, 0.0), "does not tell its vehicle's name"),
    ],
)
def test_other_files_are_refused_in_words(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "Data.lsf"
    path.write_bytes(content)
    with pytest.raises(LogError, match=words) as refused:
        VehicleLog(path, SETTINGS)
    assert refused.value.remedy


def test_a_nameless_log_can_be_given_a_name(tmp_path: Path) -> None:
    packets = [packet for packet in writer.survey(5) if b"sys" not in packet and writer.NAME.encode() not in packet]
    log = VehicleLog(writer.write(tmp_path / "Data.lsf", packets), SETTINGS, vehicle="a")
    assert {sounding.vehicle for sounding in soundings_of(log)} == {"a"}
    assert len(soundings_of(log)) == 5


def test_a_real_log_of_dune_is_read_as_a_whole(captures: Path) -> None:
    log = VehicleLog(captures / "lauv-xplore-1.lsf.gz", SETTINGS)
    events = list(log.events())
    found = [event for event in events if isinstance(event, Sounding)]
    assert (log.vehicle, log.imc_id) == ("lauv-xplore-1", 0x1E)
    assert log.file.packets == 252_761
    assert log.faults == {}
    # Every second Distance of the log is the forward-looking echo sounder's.
    assert len(found) == 1916 / 2
    assert sum(isinstance(event, StateReport) for event in events) == 3834
    depths = [sounding.bottom_depth_m for sounding in found]
    assert 20.0 < statistics.fmean(depths) < 30.0
    assert max(abs(a - b) for a, b in pairwise(depths)) < 1.5


class Searched(bytes):
    """Bytes that count how many of them are looked through for something."""

    looked_at = 0

    def find(
        self,
        sub: object,
        start: SupportsIndex | None = None,
        end: SupportsIndex | None = None,
    ) -> int:
        """Find as bytes do."""
        at = super().find(sub, start, end)  # type: ignore[arg-type]
        self.looked_at += (len(self) if at < 0 else at) - int(start or 0)
        return at


@pytest.mark.parametrize("sync", sorted(logs._ORDERS))
def test_what_is_no_packet_is_looked_through_once(tmp_path: Path, sync: bytes) -> None:
    """Where one byte order occurs often and the other never, that one was looked for to the end each time."""
    data = Searched(sync * 5000)
    file = PacketFile(writer.write(tmp_path / "Data.lsf", []))
    place = 0
    while place < len(data) - 1:
        place = file._skip(data, place)
    assert file.skipped_bytes == file.wasted_bytes == len(data) - 1
    assert data.looked_at <= 2 * len(data)


@pytest.mark.parametrize("name", ["Data.lsf", "Data.lsf.gz"])
def test_a_file_of_sizes_that_are_not_true_is_not_looked_through_for_hours(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logs, "SPARE_BYTES", 1 << 20)
    good = b"".join(writer.survey(20))
    # Each beginning claims 65535 bytes, of which the checksum is not that.
    begin = good[:4] + b"\xff\xff"
    path = writer.write(tmp_path / name, [good, begin * 40_000])
    file = PacketFile(path)
    with pytest.raises(LogError, match=f"{name} holds hardly any whole IMC packet") as refused:
        list(file)
    assert refused.value.remedy
    assert file.wasted_bytes <= (1 << 20) + 8 * len(good) + (1 << 17)
    # A log that is damaged somewhere is read.
    packets = list(writer.survey(20))
    assert list(PacketFile(writer.write(tmp_path / name, [*packets, begin * 5, *packets]))) == packets * 2


def test_a_file_that_unpacks_to_far_more_than_a_log_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "SPARE_BYTES", 1 << 20)
    path = tmp_path / "Data.lsf.gz"
    path.write_bytes(gzip.compress(b"".join(writer.survey(20)) + next(iter(writer.survey(1))) * 200_000))
    for read in (lambda: list(PacketFile(path)), PacketFile(path).unpacked_sha256):
        with pytest.raises(LogError, match="unpacks to more than 100 times its size"):
            read()


def test_a_packed_log_is_known_by_what_is_in_it(tmp_path: Path) -> None:
    plain = writer.write(tmp_path / "Data.lsf", writer.survey(20))
    digest = hashlib.sha256(plain.read_bytes()).hexdigest()
    assert PacketFile(plain).unpacked_sha256() == ""
    packed = tmp_path / "Data.lsf.gz"
    for level in (1, 9):
        packed.write_bytes(gzip.compress(plain.read_bytes(), level))
        assert PacketFile(packed).unpacked_sha256() == digest
