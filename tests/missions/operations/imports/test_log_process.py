"""The process that reads logs is locked in, and nothing that it says is taken for more than a log."""

import dataclasses
import hashlib
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.mapping.water.measured_casts import SoundSpeedSamples, measured_casts
from app.missions.errors import ImportUnavailableError, InvalidRequestError
from app.missions.fleet.interface import BeamGeometry, Position, SoundingReport, VehicleReport
from app.missions.operations.imports import log_process
from app.missions.operations.imports.log_batches import (
    BATCH,
    LogBatch,
    LogBatches,
    LogFacts,
    Near,
    OpenedLog,
    RefusedLog,
    UnreadLog,
    WantedLog,
)
from app.missions.operations.imports.log_items import MAX_SAID_BYTES, item_bytes
from app.missions.operations.imports.log_process import reading
from imc_bridge.logs import OpenLog
from imc_bridge.settings import BridgeSettings
from tests.support.imc import log_writer as writer
from tests.support.missions.specs import LAT, LON

NEAR = Near(LAT, LON, [(0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0)], 20.0)


def sounding(**changes: Any) -> SoundingReport:
    report = SoundingReport("a", 1.0, Position(LAT, LON, 9.0), 2.0, 7.0, "Altimeter")
    return dataclasses.replace(report, **changes)


def said(report: SoundingReport, times: int = 1) -> bytes:
    return item_bytes(LogBatch([report] * times, 5))


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"no item",
        b"B{}",
        pickle.dumps(LogBatch([sounding()], 5)),
        # By it a pickle changed a class of the service for good.
        b"\x80\x04capp.missions.operations.imports.log_batches\nLogBatch\n(N}\x8c\x07reportsK\x07stb.",
        said(sounding(), BATCH + 1),
        said(sounding(range_m="7.0")),
        said(sounding(vehicle=None)),
        said(sounding()).replace(b'"read_bytes": 5', b'"read_bytes": -5'),
        item_bytes(RefusedLog("log", "x" * MAX_SAID_BYTES, "")),
    ],
)
def test_only_what_a_log_is_made_of_is_made_of_what_the_process_says(said: bytes) -> None:
    with pytest.raises(InvalidRequestError, match="broke off"):
        log_process._item(said)
    assert not hasattr(LogBatch, "reports")


def test_every_kind_of_item_is_understood_as_it_was_meant() -> None:
    state = VehicleReport("a", 1.0, Position(LAT, LON, 9.0), current_mps=(0.1, math.inf))
    bent = sounding(beam_geometry=BeamGeometry(LAT, LON, 1.0), depth_sd_m=0.1, source="É\n")
    for item in (
        OpenedLog("a", 1, "0" * 64),
        LogBatch([sounding(), state, bent], 5),
        LogFacts(1, 2, 3, True, {"a": 1}, {}, ["note"]),
        RefusedLog("log", "why", "what to do"),
        UnreadLog({"landlock": "why"}),
    ):
        assert log_process._item(item_bytes(item)) == item
    (found,) = log_process._item(said(sounding(range_m=math.nan))).reports
    assert isinstance(found, SoundingReport)
    assert math.isnan(found.range_m)


def test_the_casts_of_a_log_of_a_day_are_understood() -> None:
    time_s = 1e9 + np.arange(0.0, 86_400.0)
    depth_m = 60.0 * (1.0 - np.abs(2.0 * (time_s % 1800.0) / 1800.0 - 1.0))
    place = np.full(len(time_s), LAT), np.full(len(time_s), LON)
    casts = measured_casts(SoundSpeedSamples(time_s, depth_m, 1512.34 - 0.123 * depth_m, *place))
    assert (len(casts), len(casts[0].profile)) == (24, 100)
    facts = LogFacts(1, 2, 3, True, {"a": 1}, {}, ["note"], casts)
    assert log_process._item(item_bytes(facts)) == facts


async def test_a_process_that_tells_of_another_vehicle_is_not_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = writer.write(tmp_path / "Data.lsf", writer.survey(3))
    with path.open("rb") as file:
        async with reading(file, WantedLog("Data.lsf", None, BridgeSettings(), NEAR)) as process:
            monkeypatch.setattr(log_process, "_item", lambda _content: LogBatch([sounding(vehicle="other")], 5))
            with pytest.raises(InvalidRequestError, match="broke off"):
                await process.next()


def test_a_process_that_nothing_locks_in_reads_only_where_that_is_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = {"landlock": "Function not implemented", "seccomp": "Function not implemented"}
    for held, unconfined, stays_free in (
        (missing, False, missing),
        (missing, True, {}),
        (missing | {"seccomp": ""}, False, {}),
    ):
        monkeypatch.setattr(log_process, "confine", lambda *_, held=held: held)
        wanted = WantedLog("Data.lsf", None, BridgeSettings(), NEAR, unconfined)
        assert log_process._confined([], wanted) == stays_free


async def test_batches_of_the_process_are_those_that_are_read_here(tmp_path: Path) -> None:
    packets = [*writer.survey(20), *(writer.ping(writer.START_S + 1.03 + 0.1 * k, 8.0) for k in range(5))]
    path = writer.write(tmp_path / "Data.lsf.gz", packets)
    here = LogBatches(path, None, BridgeSettings(), NEAR)
    expected = list(here)
    with path.open("rb") as file:
        async with reading(file, WantedLog("Data.lsf.gz", None, BridgeSettings(), NEAR)) as process:
            unpacked = hashlib.sha256(b"".join(packets)).hexdigest()
            assert process.opened == OpenedLog(writer.NAME, path.stat().st_size, unpacked)
            batches = []
            while (batch := await process.next()) is not None:
                batches.append(batch)
            assert process.facts() == here.facts()
            assert isinstance(process.facts(), LogFacts)
    assert len(batches) == len(expected) == 2
    assert batches[0] == expected[0]
    for one, other in zip(batches[1].reports, expected[1].reports, strict=True):
        # Arrays of pings: equal one by one.
        assert pickle.dumps(one) == pickle.dumps(other)
        np.testing.assert_array_equal(getattr(one, "ranges_m"), getattr(other, "ranges_m"))  # noqa: B009
    assert batches[1].read_bytes == expected[1].read_bytes


async def test_of_a_system_without_locks_it_is_said_what_is_missing(tmp_path: Path, monkeypatch: Any) -> None:
    path = writer.write(tmp_path / "Data.lsf", writer.survey(3))
    said = UnreadLog({"landlock": "switched off", "seccomp": "switched off"})
    monkeypatch.setattr(log_process, "_item", lambda _content: said)
    wanted = WantedLog("Data.lsf", None, BridgeSettings(), NEAR)
    with path.open("rb") as file, pytest.raises(ImportUnavailableError, match="neither Landlock nor seccomp"):
        async with reading(file, wanted):
            pass


def test_a_file_that_is_open_is_read_from_its_beginning_each_time(tmp_path: Path) -> None:
    (tmp_path / "1").write_bytes(b"abcdef")
    with (tmp_path / "1").open("rb") as file:
        log = OpenLog(file.fileno(), "folder/Data.lsf")
        assert (str(log), log.name, log.stat().st_size) == ("Data.lsf", "Data.lsf", 6)
        for _ in range(2):
            with log.open("rb") as opened:
                assert opened.read(3) == b"abc"
