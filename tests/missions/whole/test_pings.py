"""A mission's pings: judged, committed before they count, kept over restarts, moved to files when it ends."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.mapping.swath.pings import Pings
from app.missions.errors import ConflictError
from app.missions.fleet.interface import Position
from app.missions.live.mission import LiveMission
from app.missions.operations.pings import pings_of
from app.missions.settings import ServiceSettings
from app.missions.spec.mission import MissionSpec
from app.storage.ping_files import PingFiles
from tests.support.missions.harbour import Harbour, act
from tests.support.missions.pings import ping
from tests.support.missions.specs import LAT, LON, spec_json
from tests.support.waiting import until

SPEC = MissionSpec.model_validate(spec_json(vehicles=[{"name": "a", "kind": "rest", "sensor": "multibeam"}]))


@pytest.fixture
async def harbour(make_settings: Callable[..., ServiceSettings], tmp_path: Path) -> AsyncIterator[Harbour]:
    harbour = Harbour(lambda **changes: make_settings(pings_url=str(tmp_path / "pings"), **changes))
    await harbour.open()
    yield harbour
    await harbour.close()


@pytest.fixture
async def live(harbour: Harbour) -> LiveMission:
    return await harbour.service.get((await harbour.service.create(SPEC)).id)


async def all_times(live: LiveMission) -> list[float]:
    return [time_s async for _, pings in live.pings.all_accepted() for time_s in pings.time_s.tolist()]


async def test_pings_count_once_they_are_committed_apart_from_soundings(live: LiveMission) -> None:
    await live.swath.complete()
    for number in range(5):
        live.receive(ping(number))
    live.receive(ping(2))
    live.receive(ping(6, position=Position(LAT + 0.01, LON, 2.0)))
    live.receive(ping(7, vehicle="stranger"))
    await live.swath.complete()
    assert (live.progress().pings, live.builder.swath.beams) == (0, 0)
    await live.journal.flush()
    progress = live.progress()
    assert (progress.pings, progress.beams, progress.rejected, progress.soundings) == (5, 40, 1, 0)
    await live.swath.complete()
    assert live.builder.swath.beams == 40
    assert await all_times(live) == [ping(number).time_s for number in range(5)]


@pytest.mark.parametrize("stored_before", [True, False])
async def test_no_ping_is_lost_or_counts_twice_where_taking_in_is_given_up(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch, stored_before: bool
) -> None:
    vehicles = [{"name": name, "kind": "rest", "sensor": "multibeam"} for name in ("a", "b")]
    spec = MissionSpec.model_validate(spec_json(vehicles=vehicles))
    live = await harbour.service.get((await harbour.service.create(spec)).id)
    grid, begun, goes_on, added = live.builder.swath, asyncio.Event(), threading.Event(), threading.Event()
    loop, add = asyncio.get_running_loop(), grid.add

    def slowly(vehicle: str, pings: Pings) -> None:
        if begun.is_set():
            add(vehicle, pings)
            return
        loop.call_soon_threadsafe(begun.set)
        goes_on.wait(30.0)
        add(vehicle, pings)
        added.set()

    monkeypatch.setattr(grid, "add", slowly)
    if not stored_before:
        await live.swath.complete()
    for number in range(10):
        live.receive(ping(number))
        live.receive(ping(number, vehicle="b"))
    await live.journal.flush()
    taking = asyncio.create_task(live.swath.complete())
    await begun.wait()
    taking.cancel()  # as when the flight ends while a map is made
    again = asyncio.create_task(live.swath.complete())
    await asyncio.wait([again], timeout=0.3)
    goes_on.set()
    await asyncio.gather(taking, asyncio.to_thread(added.wait, 30.0), return_exceptions=True)
    await again
    assert grid.beams == live.progress().beams == 160


async def test_pings_are_written_within_a_moment(live: LiveMission) -> None:
    live.receive(ping())
    await until(lambda: live.progress().pings == 1, "it is written")


async def test_a_restart_reads_them_back(harbour: Harbour, live: LiveMission, tmp_path: Path) -> None:
    for number in range(30):
        live.receive(ping(number, beams=16))
        await asyncio.sleep(0)
    live.receive(ping(40, roll_rad=float("nan")))
    await live.journal.flush()
    before = live.progress()
    await harbour.reopen()
    again = await harbour.service.get(live.id)
    assert again.progress() == before
    assert (again.progress().pings, again.progress().beams, again.progress().rejected) == (30, 480, 1)
    assert len(PingFiles(str(tmp_path / "pings")).names(live.id)) == 1, "the rest went to a file"
    (vehicle, pings), *_ = [found async for found in again.pings.all_accepted()]
    assert vehicle == "a"
    assert np.array_equal(pings.range_m[7], ping(7, beams=16).ranges_m)
    again.receive(ping(3, beams=16))
    again.receive(ping(31))
    await again.journal.flush()
    assert again.progress().pings == 31
    assert await all_times(again) == [ping(number).time_s for number in (*range(30), 31)]


async def test_at_the_end_all_pings_are_in_files(harbour: Harbour, live: LiveMission) -> None:
    for number in range(5):
        live.receive(ping(number))
    await act(harbour.service, live.id, "abort")

    async def moved() -> bool:
        parts = (await pings_of(live)).parts
        return [part.number is not None for part in parts] == [True]

    await until(moved, "there is one file")
    (part,) = (await pings_of(live)).parts
    assert (part.vehicle, part.pings, part.beams, part.rejected) == ("a", 5, 40, 0)


async def test_a_mission_with_pings_is_not_deleted(harbour: Harbour, live: LiveMission) -> None:
    live.receive(ping())
    await live.journal.flush()
    with pytest.raises(ConflictError, match="0 soundings and 1 pings"):
        await harbour.service.delete(live)


async def test_correcting_soundings_again_keeps_the_pings_counted(live: LiveMission) -> None:
    live.receive(ping())
    await live.journal.flush()
    live.recount(live.journal.counts.of_soundings(3, 1))
    progress: Any = live.progress()
    assert (progress.soundings, progress.rejected, progress.pings, progress.beams) == (3, 1, 1, 8)
