"""A mission is opened by its stored map; its soundings are read when something is to be made of them."""

from dataclasses import replace

import numpy as np
import pytest

from app.missions.live import sounding_store
from app.missions.maps.builder import MapBuilder
from app.missions.maps.codec import LAYERS, OPTIONAL, pack, unpack
from app.missions.maps.queue import MapQueue, Replacement
from app.missions.operations.corrections.review import rule, soundings_page
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.operations.measurements import measure
from app.missions.service import MissionService
from app.missions.views.measurements.soundings import Ruling, SoundingState
from app.storage.database import Database
from app.storage.models import StoredMapRow
from tests.support.missions.harbour import Harbour, act, view_of
from tests.support.missions.maps import AREA, built_of, soundings
from tests.support.missions.measured import measured
from tests.support.missions.specs import make_spec


async def stored(database: Database, mission: str) -> StoredMapRow | None:
    async with database.reading() as session:
        return await session.get(StoredMapRow, mission)


def arrivals(service: MissionService, mission: str) -> MapQueue:
    return service._registry._live[mission].builder.arrivals


async def mapped(service: MissionService, count: int = 80) -> str:
    """A mission that was mapped: soundings on a slope, one of them wrong."""
    mission = (await service.create(make_spec())).id
    await measure(await service.get(mission), measured(count))
    await newest_map(await service.get(mission), service.maps)
    return mission


def test_a_map_comes_back_as_it_was_and_no_other() -> None:
    built = built_of(soundings(60)).newest
    assert built is not None
    sd = built.map.sd_m
    full = replace(built.map, prior=built.map.sounded, precision=sd**-2, shared_sd_m=sd, horizontal_sd_m=2.0 * sd)
    for bathymetry in (built.map, full):
        content = pack(bathymetry, [(np.arange(4.0), "a fish")])
        again, doubted = unpack(content, built.digest, 60, thorough=True)
        for name in (*LAYERS, *OPTIONAL):
            was, now = getattr(bathymetry, name), getattr(again.map, name)
            assert (was is None and now is None) or np.array_equal(was, now, equal_nan=was.dtype.kind == "f")
        assert (again.map.grid, again.map.model) == (bathymetry.grid, bathymetry.model)
        assert (again.digest, again.soundings, again.thorough) == (built.digest, 60, True)
        assert [(row.tolist(), reason) for row, reason in doubted] == [([0.0, 1.0, 2.0, 3.0], "a fish")]
        with pytest.raises(ValueError, match="digest differs"):
            unpack(content, "0" * 64, 60, thorough=True)
        with pytest.raises(ValueError, match="no stored map"):
            unpack(content[:100], built.digest, 60, thorough=True)


def test_while_soundings_are_read_the_map_stays_and_those_that_come_meanwhile_count_once() -> None:
    first, later = soundings(60), soundings(5, seed=1)
    whole = built_of(first, later).newest
    shown = built_of(first).newest
    assert whole is not None
    assert shown is not None
    builder = MapBuilder(AREA, 1.0, 0.25)
    builder.show(shown, [])
    assert not builder.stale
    assert builder.build() is builder.build(thorough=True) is shown
    builder.add(first[-5:])  # committed before reading begins: it will be among what is read
    given_up = builder.arrivals.expect()
    coming = builder.arrivals.expect()
    builder.add(later)
    everything = Replacement(first, np.zeros((0, 4)), np.zeros(60, dtype=bool))
    builder.arrivals.arrived(given_up, everything)
    assert builder.build() is shown
    builder.arrivals.arrived(coming, everything)
    assert builder.stale
    made = builder.build()
    assert made is not None
    assert (made.soundings, made.digest, made.version) == (65, whole.digest, 2)
    assert builder.is_current


def test_released_soundings_leave_the_map_and_its_doubts() -> None:
    builder = built_of(soundings(60), np.array([[15.0, 15.0, 2.0, 0.05]]))
    builder.add(soundings(1, seed=3))
    builder.release()
    assert not builder.arrivals.at_rest  # one was on its way
    built = builder.build(thorough=True)
    doubts = [(row.tolist(), reason) for row, reason in builder.doubted()]
    assert doubts
    builder.release()
    assert builder.arrivals.at_rest
    assert builder.build() is builder.newest is built
    assert [(row.tolist(), reason) for row, reason in builder.doubted()] == doubts


async def test_a_mission_opens_without_its_soundings_and_takes_them_up_with_the_next(harbour: Harbour) -> None:
    mission = await mapped(harbour.service)
    before = await newest_map(await harbour.service.get(mission), harbour.service.maps)
    doubts = await soundings_page(await harbour.service.get(mission), [SoundingState.DOUBTED])
    await harbour.reopen()
    service = harbour.service
    after = await newest_map(await service.get(mission), service.maps)
    assert (after.built.digest, after.built.soundings) == (before.built.digest, before.built.soundings)
    assert arrivals(service, mission).at_rest
    progress = (await view_of(service, mission)).progress
    assert (progress.soundings, progress.rejected) == (80, 1)
    assert [
        (item.id, item.reason)
        for item in (await soundings_page(await service.get(mission), [SoundingState.DOUBTED])).items
    ] == [(item.id, item.reason) for item in doubts.items]
    item = measured(90)[-2]
    await measure(await service.get(mission), [item])
    assert (await newest_map(await service.get(mission), service.maps)).built.soundings == 81
    assert (await view_of(service, mission)).progress.soundings == 81


async def test_a_ruling_drops_the_stored_map_at_once(harbour: Harbour, database: Database) -> None:
    mission = await mapped(harbour.service)
    await harbour.reopen()
    service = harbour.service
    (doubted,) = (await soundings_page(await service.get(mission), [SoundingState.DOUBTED])).items
    assert await stored(database, mission) is not None
    await rule(await service.get(mission), doubted.id, Ruling.REJECTED, actor="operator")
    assert await stored(database, mission) is None
    made = await newest_map(await service.get(mission), service.maps)
    progress = (await view_of(service, mission)).progress
    assert (made.built.soundings, progress.soundings, progress.rejected) == (79, 79, 2)
    await harbour.reopen()
    assert (
        await newest_map(await harbour.service.get(mission), harbour.service.maps)
    ).built.digest == made.built.digest


async def test_soundings_that_another_process_stored_are_found(harbour: Harbour, database: Database) -> None:
    mission = await mapped(harbour.service)
    await harbour.reopen()
    kept = await stored(database, mission)
    assert kept is not None
    await measure(await harbour.service.get(mission), [measured(90)[-2]])
    async with database.writing() as session:
        # As if the process had been killed before it stored the map of all 81.
        await session.merge(kept)
    live = harbour.service._registry._live[mission]
    live.stored_soundings._kept = live.builder.newest
    await harbour.reopen()
    assert (await view_of(harbour.service, mission)).progress.soundings == 81
    assert (await newest_map(await harbour.service.get(mission), harbour.service.maps)).built.soundings == 81


async def test_many_soundings_leave_memory_when_the_mission_has_ended(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sounding_store, "TOO_MANY_TO_HOLD", 50)
    mission = await mapped(harbour.service)
    await act(harbour.service, mission, "start", actor="test")
    await act(harbour.service, mission, "abort", actor="test")
    last = await newest_map(await harbour.service.get(mission), harbour.service.maps)
    await harbour.service.maps.last(mission)
    assert last.built.thorough
    assert arrivals(harbour.service, mission).at_rest
    assert (
        await newest_map(await harbour.service.get(mission), harbour.service.maps)
    ).built.digest == last.built.digest
    assert (await newest_map(await harbour.service.get(mission), harbour.service.maps)).built.soundings == 80


async def test_a_stored_map_that_is_damaged_is_made_anew(harbour: Harbour, database: Database) -> None:
    mission = await mapped(harbour.service)
    before = await newest_map(await harbour.service.get(mission), harbour.service.maps)
    await harbour.close()
    async with database.writing() as session:
        row = await session.get_one(StoredMapRow, mission)
        row.content = row.content[:-100]
    await harbour.open()
    after = await newest_map(await harbour.service.get(mission), harbour.service.maps)
    assert after.built.soundings == before.built.soundings
    np.testing.assert_allclose(after.built.map.depth_m, before.built.map.depth_m, atol=0.1)
