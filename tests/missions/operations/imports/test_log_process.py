"""The process that reads logs is locked in, and nothing that it says is taken for more than a log."""

import pickle
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.missions.errors import ImportUnavailableError, InvalidRequestError
from app.missions.operations.imports import log_process
from app.missions.operations.imports.log_batches import LogBatches, LogFacts, Near, OpenedLog, UnreadLog, WantedLog
from app.missions.operations.imports.log_process import reading
from imc_bridge.logs import OpenLog
from imc_bridge.settings import BridgeSettings
from tests.support.imc import log_writer as writer
from tests.support.missions.specs import LAT, LON

NEAR = Near(LAT, LON, [(0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0)], 20.0)


CALLED: list[str] = []


def call(word: str) -> None:
    CALLED.append(word)


class Exploit:
    def __reduce__(self) -> tuple[Any, ...]:
        return call, ("taken over",)


@pytest.mark.parametrize("said", [Exploit(), Counter("a"), "text", None, [OpenedLog("a", 1)], np.array([{}], object)])
def test_only_what_a_log_is_made_of_is_made_of_what_the_process_says(said: Any) -> None:
    with pytest.raises(InvalidRequestError, match="broke off"):
        log_process._item(pickle.dumps(said))
    assert CALLED == []
    with pytest.raises(InvalidRequestError, match="broke off"):
        log_process._item(b"no pickle")


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
            assert process.opened == OpenedLog(writer.NAME, path.stat().st_size)
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
