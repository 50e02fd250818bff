"""Searches in which obstacles hold everybody at the entry: no end, but an alarm; it goes on when they are gone."""

from typing import Any

import pytest

from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.operations.scans import scan
from app.missions.search.course import IDLE_STEPS
from app.missions.search.scan_schema import Scan
from app.missions.service import MissionService
from app.missions.states import MissionState
from tests.support.missions.harbour import CLOCK_S, Rover, act, until_state, view_of
from tests.support.missions.searches import search_spec
from tests.support.waiting import until

ENTRY = (14.0, 5.0)
RING = [2.2 if k % 6 == 0 else None for k in range(180)]
"""Echoes all round, nearer than a vehicle could pass between."""


def look(rover: Rover, number: int, ranges_m: list[float | None]) -> Scan:
    place = rover.item()
    values = {"vehicle": rover.name, "time_s": CLOCK_S + number, "lat_deg": place.lat_deg, "lon_deg": place.lon_deg}
    return Scan.model_validate(values | {"bearing_step_deg": 2.0, "reach_m": 10.0, "ranges_m": ranges_m})


async def at_the_entry(service: MissionService, **search: Any) -> tuple[LiveMission, Rover]:
    boat = {"name": "boat", "kind": "rest", "depth_m": 0}
    free: dict[str, Any] = {"obstacles": [], "simulated_obstacles": []}
    live = await service.get((await service.create(search_spec(vehicles=[boat], search=free | search))).id)
    rover = Rover(service, live.id, "boat", *ENTRY)
    await rover.post()
    await act(service, live.id, "start")
    return live, rover


async def is_stuck(live: LiveMission) -> bool:
    return any(event.kind == "stuck" for event in await events_after(live))


@pytest.mark.usefixtures("simulated_time")
async def test_who_is_held_at_the_entry_is_told_of_and_goes_when_the_way_is_free(service: MissionService) -> None:
    live, rover = await at_the_entry(service)
    scans = 0

    async def looked(ranges_m: list[float | None]) -> None:
        nonlocal scans
        scans += 1
        assert (await scan(live, [look(rover, scans, ranges_m)])).accepted == 1
        await rover.poll(0.0)

    async def told() -> bool:
        await looked(RING)
        return await is_stuck(live)

    await until(told, "the operator is told that nobody gets away from the entry")
    stood = live.header.step
    for _ in range(5 * IDLE_STEPS):
        await looked(RING)
    assert live.header.state is MissionState.RUNNING
    # It waits for scans, and no step is used up meanwhile.
    assert live.header.step <= stood + 1
    assert live.search is not None

    async def goes() -> bool:
        await looked([None] * 180)
        return live.search is not None and live.search.figures.explored_part > 0.6

    await until(goes, "it searches once nothing is there any more")
    assert any("a vehicle goes on" in event.message for event in await events_after(live))
    await act(service, live.id, "abort")


@pytest.mark.usefixtures("simulated_time")
async def test_a_search_that_never_got_away_from_the_entry_says_so_when_its_time_is_up(
    service: MissionService,
) -> None:
    live, rover = await at_the_entry(service, scanner={"reach_m": 1.0, "resolution_deg": 2.0}, window_s=300.0)
    near = look(rover, 1, [None] * 180).model_copy(update={"reach_m": 1.0})
    assert (await scan(live, [near])).accepted == 1

    async def stood() -> bool:
        await rover.poll(0.0)
        return await is_stuck(live)

    await until(stood, "the operator is told")
    assert (await view_of(service, live.id)).state is MissionState.RUNNING
    async with rover:
        done = await until_state(service, live.id, MissionState.FINISHED)
    assert done.reason.startswith("everybody is back at the entry, where obstacles held them: 100 % of the goal area")
    found = done.progress.search
    assert found is not None
    assert found.left_s < 0.1 * 300.0
