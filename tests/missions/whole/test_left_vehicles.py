"""Nobody disappears: vehicles that left, and those of missions that ended, stay where they were last."""

from collections.abc import AsyncIterator

import pytest

from app.missions.errors import ConflictError, MissionNotFoundError, VehicleNotFoundError
from app.missions.flown import Phase
from app.missions.operations.history import events_after
from app.missions.operations.imports.uploads import Uploads
from app.missions.preflight.survey import preflight
from app.missions.running.homecoming import call_home
from app.missions.running.mission_views import watched
from app.missions.service import MissionService
from app.missions.states import MissionState
from app.missions.views.measurements.imports import ImportOptions
from app.missions.views.mission import CheckStatus, VehicleView
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, until_step, view_of
from tests.support.missions.specs import lon_lat, make_spec
from tests.support.waiting import until


def by_name(views: list[VehicleView], name: str) -> VehicleView:
    return next(view for view in views if view.name == name)


async def whole(content: bytes) -> AsyncIterator[bytes]:
    yield content


@pytest.mark.slow
async def test_an_aborted_vehicle_stays_with_its_last_place_and_age_and_can_come_back(harbour: Harbour) -> None:
    service = harbour.service
    vehicles = [{"name": "a", "kind": "rest", "depth_m": 3.0}, {"name": "b", "kind": "rest"}]
    mission = (await service.create(make_spec(steps=200, vehicles=vehicles))).id
    async with Rover(service, mission, "b", 20, 20):
        rover = Rover(service, mission, "a", 5, 5)
        await rover.post()
        await act(service, mission, "start", actor="Ana")
        await until(lambda: rover.poll(), "it was sent somewhere")
        await service.team_changes.stop_one(await service.get(mission), "a", actor="Ana")
        left = by_name((await view_of(service, mission)).vehicles, "a")
        assert (left.active, left.mission_id) == (False, None)
        assert left.left_at is not None
        assert left.lat_deg == pytest.approx(rover._lat)
        assert left.age_s is not None

        service = await harbour.reopen()
        again = by_name((await view_of(service, mission)).vehicles, "a")
        assert (again.active, again.lat_deg, again.left_at) == (False, left.lat_deg, left.left_at)

        await service.team_changes.rejoin(await service.get(mission), "a", actor="Ana")
        assert by_name((await view_of(service, mission)).vehicles, "a").active
        live = await service.get(mission)
        assert live.team.members["a"].spec.depth_m == 3.0
        with pytest.raises(VehicleNotFoundError, match="has not left"):
            await service.team_changes.rejoin(await service.get(mission), "a", actor="Ana")
        await act(service, mission, "abort", actor="Ana")


async def test_simulated_vehicles_are_put_away_with_their_mission_and_stay_in_sight(service: MissionService) -> None:
    mission = (await service.create(sim_spec("a", steps=100))).id
    await act(service, mission, "start", actor="Ana")
    await until_step(service, mission, 1)
    await act(service, mission, "abort", actor="Ana")
    assert await service.vehicles() == []
    [view] = (await view_of(service, mission)).vehicles
    assert (view.active, view.reason) == (True, "")
    assert view.lat_deg is not None
    assert view.age_s is not None


async def test_a_search_is_flown_after_a_survey_with_vehicles_of_the_same_names(service: MissionService) -> None:
    from tests.support.missions.searches import search_spec

    search = search_spec()
    names = [vehicle.name for vehicle in search.vehicles]
    survey = (await service.create(sim_spec(*names, steps=100))).id
    await act(service, survey, "start", actor="Ana")
    await until_step(service, survey, 1)
    await act(service, survey, "finish", actor="Ana")
    found = (await service.create(search)).id
    assert (await act(service, found, "start", actor="Ana")).mission.state is MissionState.RUNNING
    await act(service, found, "abort", actor="Ana")


async def test_what_was_imported_is_on_the_map_and_in_the_checklist_before_the_start(service: MissionService) -> None:
    mission = (await service.create(make_spec())).id
    rows = "\n".join(f"{x},{y},{6 + 0.1 * x:.2f}" for x in range(1, 30, 2) for y in range(1, 30, 2))
    live = await service.get(mission)
    points = []
    for line in rows.splitlines():
        x, y, depth = (float(value) for value in line.split(","))
        lat, lon = live.frame.to_geographic(x, y)
        points.append(f"{float(lon):.8f},{float(lat):.8f},{depth}")
    content = ("lon,lat,depth\n" + "\n".join(points)).encode()
    async with watched(await service.get(mission)) as messages:
        first = await anext(messages)
        assert first.type == "snapshot"
        async with Uploads().receive(whole(content), len(content)) as upload:
            await service.imports.add(
                await service.get(mission), upload, ImportOptions(filename="old.csv", sd_m=0.1), actor="operator"
            )
        async for message in messages:
            if message.type == "map":
                break
    check = next(c for c in (preflight(await service.get(mission))).checks if c.id == "bottom")
    assert check.status is not CheckStatus.NOTE, check.message
    assert "m deep" in check.message


async def test_a_mission_in_which_nothing_was_measured_is_deleted_and_any_other_is_kept(harbour: Harbour) -> None:
    service = harbour.service
    draft = (await service.create(make_spec(vehicles=[]))).id
    await service.delete(await service.get(draft))
    with pytest.raises(MissionNotFoundError):
        await view_of(service, draft)
    flown = (await service.create(sim_spec("a", steps=100))).id
    await act(service, flown, "start", actor="Ana")
    with pytest.raises(ConflictError, match="the mission is running"):
        await service.delete(await service.get(flown))
    await until_step(service, flown, 2)
    await act(service, flown, "abort", actor="Ana")
    with pytest.raises(ConflictError, match="what was measured is kept"):
        await service.delete(await service.get(flown))
    service = await harbour.reopen()
    assert [mission.id for mission in await service.missions()] == [flown]


async def test_a_mission_whose_vehicles_have_all_left_says_so_until_one_comes(service: MissionService) -> None:
    mission = (await service.create(sim_spec("a", steps=1000))).id
    await act(service, mission, "start", actor="Ana")
    await until_step(service, mission, 2)
    live = await service.get(mission)
    await service.team_changes.stop_one(live, "a", actor="Ana")

    async def said(words: str) -> bool:
        return any(event.message == words for event in await events_after(live, 0, 1000))

    await until(lambda: said("every vehicle left; add one to go on"), "it is told")
    await service.team_changes.rejoin(live, "a", actor="Ana")
    before = live.team.members["a"].legs
    await until(lambda: live.team.members["a"].legs > before + 2, "it surveys again")
    assert await said("a vehicle can be sent again")
    await act(service, mission, "abort", actor="Ana")


async def test_a_vehicle_that_left_before_a_restart_comes_back_with_its_own_numbers(harbour: Harbour) -> None:
    service = harbour.service
    mission = (await service.create(sim_spec("a", "b", steps=1000))).id
    await act(service, mission, "start", actor="Ana")
    live = await service.get(mission)
    a, b = live.team.members["a"], live.team.members["b"]
    await until(lambda: a.legs > 3 and b.legs > 3, "both have legs")
    await service.team_changes.stop_one(live, "a", actor="Ana")
    flown = a.legs
    service = await harbour.reopen()
    live = await service.get(mission)
    await until(lambda: live.team.members["b"].engaged, "b follows")
    await service.team_changes.rejoin(live, "a", actor="Ana")
    assert live.team.members["a"].legs == flown
    assert live.team.members["a"].committed.way_m > 0.0
    await until(lambda: live.team.members["a"].legs > flown + 2, "a surveys again")
    assert live.header.state is MissionState.RUNNING
    await act(service, mission, "abort", actor="Ana")


async def test_who_went_home_left_and_came_back_surveys_after_a_restart_too(harbour: Harbour) -> None:
    service = harbour.service
    spec = sim_spec("a", "b", steps=1000, side_m=80.0, recovery={"point": lon_lat(15.0, 4.0)})
    mission = (await service.create(spec)).id
    await act(service, mission, "start")
    await until_step(service, mission, 1)
    live = await service.get(mission)
    a = live.team.named("a")
    await call_home(live, "a", "Ana")
    await until(lambda: a.is_home, "it is home")
    await service.team_changes.take_out(live, "a", "Ana")
    await service.team_changes.rejoin(live, "a", "Ana")
    await until(lambda: live.team.named("a").legs > a.legs, "it surveys again")

    live = await (await harbour.reopen()).get(mission)
    assert live.team.named("a").withdrawal is None
    await until(lambda: live.team.named("a").plannable, "it surveys still")


async def test_who_left_surveys_no_more(service: MissionService) -> None:
    mission = (await service.create(sim_spec("a", "b", steps=1000, side_m=80.0))).id
    await act(service, mission, "start")
    live = await service.get(mission)
    await until(lambda: by_name(live.vehicles.all(), "a").phase is Phase.SURVEY, "it surveys")
    await service.team_changes.take_out(live, "a", "Ana")
    assert by_name((await view_of(service, mission)).vehicles, "a").phase is Phase.STOPPED
