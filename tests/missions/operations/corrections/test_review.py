"""Soundings that are kept out of the map, and an operator's word on them."""

from collections.abc import AsyncIterator
from typing import Any

import numpy as np
import pytest

from app.missions.errors import ConflictError, SoundingNotFoundError
from app.missions.operations.corrections.recorrection import set_tide
from app.missions.operations.corrections.review import rule, rule_many, sounding_points, soundings_page
from app.missions.operations.history import events_after
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.operations.measurements import measure
from app.missions.running.mission_views import watched
from app.missions.service import MissionService
from app.missions.soundings.measurement import Measurement
from app.missions.views.measurements.soundings import Ruling, SoundingState
from tests.support.missions.harbour import CLOCK_S, Harbour, act, view_of
from tests.support.missions.measured import NOT_USED, measured
from tests.support.missions.specs import lon_lat, make_spec
from tests.support.waiting import until


async def depth_at(service: MissionService, mission: str, item: Measurement) -> float:
    snapshot = await newest_map(await service.get(mission), service.maps)
    east, north = snapshot.facts.frame.to_local(item.lat_deg, item.lon_deg)
    grid = snapshot.built.map.grid
    return float(snapshot.built.map.depth_m[int(north / grid.cell_m), int(east / grid.cell_m)])


async def test_what_is_not_in_the_map_is_listed_with_the_reason_page_by_page(service: MissionService) -> None:
    mission = (await service.create(make_spec())).id
    items = measured()
    await measure(await service.get(mission), items)
    await newest_map(await service.get(mission), service.maps)
    page = await soundings_page(await service.get(mission), NOT_USED)
    states = {item.state: item for item in page.items}
    assert page.total == 2
    assert set(states) == {SoundingState.DOUBTED, SoundingState.REJECTED}
    assert states[SoundingState.DOUBTED].raw_depth_m == pytest.approx(4.5)
    assert "standard deviations from the" in states[SoundingState.DOUBTED].reason
    assert "outside the area" in states[SoundingState.REJECTED].reason
    used = [item async for item in _all_pages(service, mission, SoundingState.USED)]
    assert used == sorted(used)
    assert len(used) == 79
    assert (await soundings_page(await service.get(mission), NOT_USED, vehicle="b")).total == 0


async def _all_pages(service: MissionService, mission: str, state: SoundingState) -> AsyncIterator[Any]:
    after: int | None = 0
    while after is not None:
        page = await soundings_page(await service.get(mission), [state], after=after, limit=30)
        for item in page.items:
            yield item.id
        after = page.next_after


async def test_a_restored_sounding_bends_the_map_at_once_and_after_a_restart(harbour: Harbour) -> None:
    service = harbour.service
    mission = (await service.create(make_spec())).id
    items = measured()
    await measure(await service.get(mission), items)
    assert await depth_at(service, mission, items[40]) == pytest.approx(8.15, abs=0.3)
    doubted = (await soundings_page(await service.get(mission), [SoundingState.DOUBTED])).items[0]
    before = await view_of(service, mission)

    restored = await rule(
        await service.get(mission), doubted.id, Ruling.RESTORED, note="a mast, seen by divers", actor="Ana"
    )
    assert restored.state is SoundingState.RESTORED
    assert (restored.range_m, restored.raw_depth_m) == (doubted.range_m, doubted.raw_depth_m)
    assert await depth_at(service, mission, items[40]) < 7.0
    line = (await events_after(await service.get(mission)))[-1]
    assert (line.kind, line.data["actor"], line.data["sounding"]) == ("sounding", "Ana", doubted.id)
    assert "a mast, seen by divers" in line.message
    assert "standard deviations" in line.data["before"]

    service = await harbour.reopen()
    assert await depth_at(service, mission, items[40]) < 7.0
    withdrawn = await rule(await service.get(mission), doubted.id, Ruling.REJECTED, actor="Rui")
    assert withdrawn.state is SoundingState.WITHDRAWN
    assert await depth_at(service, mission, items[40]) == pytest.approx(8.15, abs=0.3)
    progress = (await view_of(service, mission)).progress
    assert (progress.soundings, progress.rejected) == (before.progress.soundings - 1, before.progress.rejected + 1)
    events = len(await events_after(await service.get(mission)))
    await rule(await service.get(mission), doubted.id, Ruling.REJECTED, actor="Rui")
    assert len(await events_after(await service.get(mission))) == events


async def test_a_sounding_that_the_gate_refused_counts_when_restored_and_stays_through_corrections(
    service: MissionService,
) -> None:
    from app.missions.views.measurements.corrections import TideCorrection

    mission = (await service.create(make_spec())).id
    await measure(await service.get(mission), measured(wrong=None))
    refused = (await soundings_page(await service.get(mission), [SoundingState.REJECTED])).items[0]
    restored = await rule(await service.get(mission), refused.id, Ruling.RESTORED, actor="Ana")
    assert restored.depth_m == pytest.approx(11.0)
    corrected = await set_tide(
        await service.get(mission), TideCorrection(level_m=1.0, source="gauge"), actor="operator"
    )
    assert (corrected.accepted, corrected.rejected) == (81, 0)
    again = (await soundings_page(await service.get(mission), [SoundingState.RESTORED])).items[0]
    assert (again.depth_m, again.raw_depth_m) == (pytest.approx(10.0), pytest.approx(11.0))


async def test_what_has_no_depth_cannot_be_restored(service: MissionService) -> None:
    mission = (await service.create(make_spec())).id
    lon, lat = lon_lat(5, 5)
    bad = Measurement(vehicle="a", time_s=CLOCK_S, lat_deg=lat, lon_deg=lon, depth_m=2, range_m=-3)
    await measure(await service.get(mission), [bad])
    refused = (await soundings_page(await service.get(mission), NOT_USED)).items[0]
    assert (refused.depth_m, refused.range_m) == (None, -3)
    with pytest.raises(ConflictError, match="range_m: -3 is not positive"):
        await rule(await service.get(mission), refused.id, Ruling.RESTORED, actor="operator")
    with pytest.raises(SoundingNotFoundError):
        await rule(await service.get(mission), refused.id + 1, Ruling.RESTORED, actor="operator")
    other = (await service.create(make_spec())).id
    with pytest.raises(SoundingNotFoundError):
        await rule(await service.get(other), refused.id, Ruling.REJECTED, actor="operator")


async def test_a_mission_that_is_taken_up_has_its_map_without_being_asked_for_it(harbour: Harbour) -> None:
    service = harbour.service
    mission = (await service.create(make_spec())).id
    await measure(await service.get(mission), measured())
    await act(service, mission, "start", actor="Ana")
    await act(service, mission, "finish", actor="Ana")

    async def mapped() -> bool:
        return bool((await view_of(service, mission)).progress.coverage_pct)

    await until(mapped, "the last map was made by itself")
    shown = (await view_of(service, mission)).progress

    service = await harbour.reopen()
    await service.missions()
    await until(mapped, "the map was made by itself")
    progress = (await view_of(service, mission)).progress
    assert progress.coverage_pct == pytest.approx(shown.coverage_pct, abs=2)
    async with watched(await service.get(mission)) as messages:
        snapshot = await anext(messages)
    assert snapshot.map_version > 0


async def test_missions_that_left_memory_are_listed_as_they_were(harbour: Harbour) -> None:
    service = harbour.service
    ids = []
    for number in range(11):
        mission = (await service.create(make_spec(name=f"Quay {number}"))).id
        await act(service, mission, "abort", actor="Ana")
        ids.append(mission)
    first = await service.missions()
    assert [m.id for m in first] == ids[::-1]
    assert {m.state for m in first} == {"aborted"}
    assert len(list(service._registry)) <= 9
    assert await service.missions() == first


async def test_the_map_of_an_earlier_step_is_that_of_the_soundings_until_then(service: MissionService) -> None:
    from app.missions.operations.maps.mission_maps import map_at_step

    mission = (await service.create(make_spec())).id
    await measure(await service.get(mission), measured()[:30])
    live = await service.get(mission)
    live.set_step(1, None, {})
    await measure(await service.get(mission), measured())
    whole = await newest_map(await service.get(mission), service.maps)
    early = await map_at_step(live, 0)
    assert early.built.soundings == 30
    assert early.built.map.count.sum() == 30
    assert np.nanmean(early.built.map.sd_m) > np.nanmean(whole.built.map.sd_m)


async def test_many_soundings_are_rejected_and_restored_at_once_with_one_line_in_the_log(
    service: MissionService,
) -> None:
    mission = (await service.create(make_spec())).id
    items = measured()
    await measure(await service.get(mission), items)
    live = await service.get(mission)
    await newest_map(live, service.maps)
    before = await sounding_points(live, limit=1000)
    assert before.total == len(before.id) == len(items)
    assert before.next_after is None
    names = [before.states[k] for k in before.state]
    assert names.count(SoundingState.USED) == 79
    # The odd one is seen where it was measured, and the first page ends where the next begins.
    odd = names.index(SoundingState.DOUBTED)
    assert before.depth_m[odd] == pytest.approx(4.5)
    first = await sounding_points(live, limit=10)
    rest = await sounding_points(live, after=first.next_after or 0, limit=1000)
    assert first.id + rest.id == before.id
    assert [first.vehicles[k] for k in first.vehicle] == [item.vehicle for item in items[:10]]

    figures = (await view_of(service, mission)).progress
    events = len(await events_after(live))
    wrong = [number for number, name in zip(before.id, names, strict=True) if name is SoundingState.USED][:30]
    done = await rule_many(live, [*wrong, wrong[0]], Ruling.REJECTED, note="fish", actor="Ana")
    assert (done.changed, done.unchanged, done.refused) == (wrong, 0, [])
    [line] = (await events_after(live))[events:]
    assert line.message == "30 soundings rejected by Ana: fish"
    assert (line.data["soundings"], line.data["actor"]) == (30, "Ana")
    now = (await view_of(service, mission)).progress
    assert (now.soundings, now.rejected) == (figures.soundings - 30, figures.rejected + 30)
    after = await sounding_points(live, limit=1000)
    assert {
        number for number, k in zip(after.id, after.state, strict=True) if k == STATES[SoundingState.WITHDRAWN]
    } == set(wrong)

    assert (await rule_many(live, wrong, Ruling.REJECTED, actor="Ana")).unchanged == 30
    back = await rule_many(live, wrong, Ruling.RESTORED, actor="Rui")
    assert back.changed == wrong
    again = (await view_of(service, mission)).progress
    assert (again.soundings, again.rejected) == (figures.soundings, figures.rejected)
    with pytest.raises(SoundingNotFoundError, match="no sounding 999999"):
        await rule_many(live, [wrong[0], 999_999], Ruling.REJECTED, actor="Ana")
    assert (await sounding_points(live, limit=1000)).state.count(STATES[SoundingState.RESTORED]) == 30


async def test_of_many_those_without_a_depth_are_not_restored_and_told(service: MissionService) -> None:
    mission = (await service.create(make_spec())).id
    live = await service.get(mission)
    broken = measured()[0].model_copy(update={"range_m": -1.0, "depth_m": 2.0})
    items = [*measured()[1:4], broken]
    await measure(live, items)
    points = await sounding_points(live, limit=100)
    done = await rule_many(live, points.id, Ruling.RESTORED, actor="Ana")
    assert done.changed == points.id[:-1]
    [refused] = done.refused
    assert refused.id == points.id[-1]
    assert "no depth can be had from it" in refused.reason
    assert (await sounding_points(live, limit=100)).state[-1] == STATES[SoundingState.REJECTED]


STATES = {state: k for k, state in enumerate(SoundingState)}
