"""Lines that vehicles leave in the middle, which are flown on from there; missions that are left early."""

import asyncio

import numpy as np
import pytest
from shapely import LineString
from sqlalchemy import select

from app.missions.running import homecoming
from app.missions.service import MissionService
from app.missions.states import MissionState
from app.storage.database import Database
from app.storage.models import WaypointRow
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until

pytestmark = pytest.mark.usefixtures("simulated_time")


@pytest.mark.slow
@pytest.mark.parametrize("how", ["held", "taken out", "taken out in a pause for another"])
async def test_who_leaves_its_line_and_comes_back_flies_all_of_it(
    harbour_closed: Harbour, database: Database, how: str
) -> None:
    service = await harbour_closed.open(time_scale=5.0)
    limits = {"max_step_m": 8.0, "min_separation_m": 0.0}
    spec = sim_spec("a", side_m=40.0, budget={"km_per_vehicle": 0.2}, planner={"name": "lawnmower"}, limits=limits)
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: live.team.named("a").flown.on_plan_m > 60.0, "it surveys")
    if "pause" in how:
        await act(service, mission, "pause")
    if how == "held":
        await homecoming.hold(live, "a", "Ana")
        # It circles for a while, elsewhere.
        await asyncio.sleep(30.0 / service.settings.time_scale)
        await service.send_on(live, "a", "Ana")
    elif "another" in how:
        another = live.team.named("a").spec.model_copy(update={"name": "b"})
        await service.team_changes.take_out(live, "a", "Ana")
        await service.team_changes.join(live, another, "Ana")
    else:
        await service.team_changes.take_out(live, "a", "Ana")
        await service.team_changes.rejoin(live, "a", "Ana")
    if "pause" in how:
        await act(service, mission, "resume")
    await until_state(service, mission, MissionState.FINISHED)
    async with database.reading() as session:
        rows = (await session.scalars(select(WaypointRow).order_by(WaypointRow.step))).all()
    ends = np.array([[row.east_m, row.north_m] for row in rows])
    missed = np.flatnonzero([row.status == "missed" for row in rows])
    assert {row.status for row in rows} == {"reached", "missed"}
    assert 1 < len(missed) == np.ptp(missed) + 1
    again = ends[missed[-1] + 1 :]
    assert LineString(again).buffer(1.0).covers(LineString(ends[missed]))
    if "another" in how:
        assert not LineString(again).buffer(1.0).covers(LineString(ends[:3])), "the first one had flown that"
    else:
        # Legs that it did not begin take nothing of its way.
        assert live.team.named("a").committed.spared == len(missed) - 1


@pytest.mark.parametrize(("budget", "left"), [({"minutes": 90}, "90 min"), ({"km_per_vehicle": 2.0}, "2.0 km")])
async def test_a_mission_whose_vehicles_all_came_home_early_says_how_much_of_it_is_left(
    service: MissionService, budget: dict[str, float], left: str
) -> None:
    spec = sim_spec("a", budget=budget, planner={"name": "lawnmower"}, recovery={"point": lon_lat(15.0, 15.0)})
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    await act(service, mission, "start")
    await until(lambda: live.team.named("a").legs, "it surveys")
    await homecoming.call_home(live, "a", "Ana")
    ended = await until_state(service, mission, MissionState.FINISHED)
    assert ended.reason.startswith(f"nobody surveys any more, {left} before it")
