"""Missions that search: real services, simulated boats among obstacles, scans through the service's door."""

import json
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from shapely.geometry import Point, shape

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import LinkCapabilities
from app.missions.fleet.links.rest import RestFleetLink
from app.missions.fleet.links.sim import AGROUND
from app.missions.operations.history import events_after, steps_after
from app.missions.operations.maps.mission_maps import export
from app.missions.operations.polling import waypoint
from app.missions.operations.scans import report_of_posted, scan, search_grid
from app.missions.preflight.survey import preflight
from app.missions.search.course import hold_before_hazards
from app.missions.search.examples import example
from app.missions.search.scan_schema import Scan
from app.missions.search.site import simulated_world
from app.missions.search.state import Search
from app.missions.service import MissionService
from app.missions.spec.mission import MissionKind, MissionSpec
from app.missions.states import MissionState
from app.missions.views.measurements.soundings import Verdict
from app.missions.views.mission import CheckStatus
from simulator.obstacles.car_parks import car_park, harbour_basin
from tests.support.missions.harbour import Harbour, Rover, act, until_state, view_of
from tests.support.missions.searches import search_json, search_spec
from tests.support.missions.specs import lon_lat, rectangle
from tests.support.waiting import until


def all_round(east: float, north: float, time_s: float, **changes: Any) -> Scan:
    """A look round that meets nothing."""
    lon, lat = lon_lat(east, north)
    values: dict[str, Any] = {"vehicle": "boat", "time_s": time_s, "lat_deg": lat, "lon_deg": lon}
    nothing = [None] * 180
    return Scan.model_validate(values | {"bearing_step_deg": 2.0, "reach_m": 10.0, "ranges_m": nothing} | changes)


@pytest.mark.slow
async def test_a_boat_goes_round_what_nobody_knew_of_sees_the_goal_and_is_back_in_time(
    harbour: Harbour, service: MissionService
) -> None:
    spec = search_spec()
    mission = await service.create(spec)
    checks = preflight(await service.get(mission.id))
    assert checks.ready
    await act(service, mission.id, "start", actor="Ana")
    done = await until_state(service, mission.id, MissionState.FINISHED)
    found = done.progress.search
    assert found is not None
    assert done.reason == "everybody is back at the entry"
    assert found.goal_pct > 90
    assert found.explored_pct > 75
    assert (found.back, found.left_s > 0) == (["boat"], True)
    assert found.found_cells >= 15
    # The truth is that of the description: nobody touched anything, no leg came too near.
    assert not any(AGROUND in line.message for line in await events_after(await service.get(mission.id)))
    pontoon = shape(rectangle(0, 14, 15, 16))
    for step in await steps_after(await service.get(mission.id)):
        for sent in step.waypoints:
            assert pontoon.distance(Point(sent.lon_deg, sent.lat_deg)) > 0
            assert 0 <= sent.east_m <= 27 - 1.5

    # A restart makes the grid of what was stored, and always the same.
    service = await harbour.reopen()
    before = search_grid(await service.get(mission.id))
    assert before is not None
    assert before.version >= found.version
    figures = (await view_of(service, mission.id)).progress.search
    product = await export(
        await service.get(mission.id), service.maps, service.settings.provider, service.compute, "obstacles.geojson"
    )
    geo = json.loads(product.content.whole())
    seen = [f for f in geo["features"] if f["properties"]["found"]]
    assert all(shape(f["geometry"]).intersects(pontoon.buffer(2e-5)) for f in seen)
    assert figures is not None
    assert sum(f["properties"]["area_m2"] for f in seen) == figures.found_cells
    # It is as long as its time window, whatever number of steps it may take.
    assert done.progress.minutes_left == pytest.approx(found.left_s / 60, abs=0.01)
    assert done.progress.km_left_per_vehicle is None
    # No time runs any more: who looks a day later does not read that it was a day late.
    assert figures.left_s == pytest.approx(found.left_s)
    service = await harbour.reopen()
    assert search_grid(await service.get(mission.id)) == before
    assert search_grid(await service.get(mission.id), after=before.version) is None


@pytest.mark.slow
async def test_a_killed_search_goes_on_and_its_time_has_not_stood_still(
    harbour: Harbour, service: MissionService
) -> None:
    mission = await service.create(search_spec())
    await act(service, mission.id, "start", actor="Ana")

    async def under_way() -> bool:
        return (await view_of(service, mission.id)).progress.step >= 3

    await until(under_way, "it is under way")
    before = (await view_of(service, mission.id)).progress.search
    service = await harbour.reopen()
    after = (await view_of(service, mission.id)).progress.search
    assert before is not None
    assert after is not None
    assert after.began_at == before.began_at
    assert after.left_s < before.left_s
    assert after.version >= before.version

    async def further() -> bool:
        return (await view_of(service, mission.id)).progress.step >= 6

    await until(further, "it goes on")
    await act(service, mission.id, "abort", actor="Ana")


async def test_scans_are_judged_one_by_one_and_stored_once(service: MissionService) -> None:
    mission = await service.create(search_spec(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    scans = [
        all_round(14, 5, 1.0),
        all_round(14, 5, 2.0, vehicle="stranger"),
        all_round(-9, 5, 3.0),
        all_round(14, 5, 4.0, ranges_m=[1.0, -1.0]),
        all_round(14, 5, 5.0, ranges_m=[1.0] * 181),
        all_round(14, 5, 1.0),
    ]
    answer = await scan(await service.get(mission.id), scans)
    assert [item.verdict for item in answer.items] == [
        Verdict.ACCEPTED, Verdict.REJECTED, Verdict.REJECTED, Verdict.REJECTED, Verdict.REJECTED, Verdict.DUPLICATE,
    ]  # fmt: skip
    wrong = ("stranger", "outside of the site", "-1", "once round")
    for item, word in zip(answer.items[1:5], wrong, strict=True):
        assert word in item.reason
    again = await scan(await service.get(mission.id), scans[:1])
    assert (again.accepted, again.duplicate) == (0, 1)
    view = search_grid(await service.get(mission.id))
    assert view is not None
    assert view.version == 1


async def test_a_scan_that_was_refused_can_be_sent_again_as_it_should_be(harbour: Harbour) -> None:
    service = harbour.service
    mission = await service.create(search_spec(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    live = await service.get(mission.id)
    wrong, right = all_round(-9, 5, 1.0), all_round(14, 5, 1.0)
    for _ in range(2):
        [refused] = (await scan(live, [wrong])).items
        assert (refused.verdict, "outside of the site" in refused.reason) == (Verdict.REJECTED, True)
    [corrected] = (await scan(live, [right])).items
    assert corrected.verdict is Verdict.ACCEPTED
    # In one batch just so; and what was accepted stays, whatever comes after it.
    several = [all_round(-9, 5, 2.0), all_round(14, 5, 2.0), wrong]
    verdicts = [item.verdict for item in (await scan(live, several)).items]
    assert verdicts == [Verdict.REJECTED, Verdict.ACCEPTED, Verdict.DUPLICATE]
    before = search_grid(live)
    assert before is not None
    assert before.version == 2
    service = await harbour.reopen()
    assert search_grid(await service.get(mission.id)) == before


@pytest.mark.slow
async def test_a_vehicle_waits_for_scans_and_turns_back_where_something_comes_up(service: MissionService) -> None:
    mission = await service.create(
        search_spec(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}], search={"simulated_obstacles": []})
    )
    rover = Rover(service, mission.id, "boat", 14, 5)
    await rover.post()
    await act(service, mission.id, "start", actor="Ana")

    async def said(kind: str) -> bool:
        return any(event.kind == kind for event in await events_after(await service.get(mission.id)))

    await until(lambda: said("waiting"), "the search says that it waits for a scan")
    assert not await rover.poll(0.0)
    await scan(await service.get(mission.id), [all_round(14, 5, 10.0)])
    # A ring of walls 6 m away comes up while the boat is on its way: that leg ends, another one comes.
    first = await waypoint(await service.get(mission.id), "boat", after_step=0, timeout_s=30.0)
    assert first is not None
    leg = np.array([first.east_m - 14.0, first.north_m - 5.0])
    assert 1.0 < np.hypot(*leg) < 4.001
    bearing = np.degrees(np.arctan2(leg[0], leg[1])) % 360
    for k in range(6):
        wall = all_round(
            14,
            5,
            11.0 + k,
            first_bearing_deg=bearing - 20,
            bearing_step_deg=1.0,
            ranges_m=[float(np.hypot(*leg)) - 0.5] * 40,
        )
        assert (await scan(await service.get(mission.id), [wall])).accepted == 1
    await until(lambda: said("obstacle"), "the way is barred")
    second = await waypoint(await service.get(mission.id), "boat", after_step=first.step, timeout_s=30.0)
    assert second is not None
    steps = await steps_after(await service.get(mission.id))
    missed = next(step for step in steps if step.number == first.step)
    assert "something stands on its way" in missed.waypoints[0].reason
    await act(service, mission.id, "abort", actor="Ana")


def test_no_leg_leads_closer_to_a_hazard_than_asked_whatever_a_planner_says() -> None:
    spec = search_spec()
    assert spec.search is not None
    search = Search(spec, spec.search, spec.frame(), 1.0)
    search.see([report_of_posted(all_round(14, 5, 1.0))])
    origin = np.array([[14.0, 5.0, 0.0], [14.0, 8.0, 0.0], [12.0, 5.0, 0.0]])
    wishes = np.array([[14.0, 9.0, 0.0], [14.0, 16.0, 0.0], [np.nan, 5.0, 0.0]])
    held, notes = hold_before_hazards(search.task(100.0), ("free", "unseen", "lost"), origin, wishes)
    np.testing.assert_array_equal(held[:2], [wishes[0], origin[1]])
    assert [note.partition(":")[0] for note in notes] == ["unseen"]


def test_no_leg_leads_through_what_has_just_come_up_however_often_it_was_clear_there() -> None:
    spec = search_spec()
    assert spec.search is not None
    search = Search(spec, spec.search, spec.frame(), 1.0)
    search.see([report_of_posted(all_round(14, 5, float(k))) for k in range(10)])
    here, end = np.array([14.0, 5.0]), np.array([14.0, 11.0])
    assert search.clear(here, end)
    came_up = {"first_bearing_deg": -20.0, "bearing_step_deg": 1.0, "ranges_m": [4.0] * 41}
    search.see([report_of_posted(all_round(14, 5, 10.0, **came_up))])
    assert not search.clear(here, end)


async def test_what_a_search_lacks_is_told_field_by_field(service: MissionService) -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"kind": "survey"}, "kind is survey and search is given"),
        ({"search": None}, "kind is search and search is missing"),
        ({"search": {"goal": lon_lat(50, 5)}}, "search.goal lies 20.0 m outside the area"),
        ({"cell_m": 0.02}, "at most 1000000 are searched"),
        ({"search": {"safety_m": 0.5}}, "search.safety_m is 0.5 m but arrival_radius_m is 1.0 m"),
    ]
    for change, words in wrong:
        raw = search_json(**(change if change.get("search", {}) is not None else {}))
        if change.get("search", {}) is None:
            del raw["search"]
        with pytest.raises(ValidationError, match=words):
            MissionSpec.model_validate(raw)
    with pytest.raises(InvalidRequestError, match="plans no missions of kind search") as refused:
        await service.create(search_spec(planner={"name": "lawnmower"}))
    assert "rollout" in str(refused.value.remedy)
    survey = await service.create(MissionSpec.model_validate(search_json() | {"kind": "survey", "search": None}))
    with pytest.raises(ConflictError, match="kind survey"):
        await scan(await service.get(survey.id), [all_round(14, 5, 1.0)])
    mission = await service.create(search_spec())
    with pytest.raises(ConflictError, match="cannot be forecast"):
        await service.forecaster.of_mission(await service.get(mission.id))


def test_a_search_has_defaults_of_its_own() -> None:
    spec = search_spec()
    assert (spec.kind, spec.planner.name, spec.arrival_radius_m) == (MissionKind.SEARCH, "rollout", 1.0)
    assert spec.steps == 3000
    assert search_spec(steps=7, planner={"name": "cao"}).steps == 7
    assert MissionSpec.model_validate(spec.model_dump(mode="json")) == spec


def test_an_obstacle_is_in_the_way_however_thin_it_is() -> None:
    spec = search_spec(search={"obstacles": [rectangle(4.5, 10.5, 20.5, 10.51)]})
    assert spec.search is not None
    known = Search(spec, spec.search, spec.frame(), 1.0).grid.blueprint
    assert known[10, 4:21].all()
    assert known.sum() == 17


async def test_the_checklist_says_when_nobody_could_leave_or_get_there(service: MissionService) -> None:
    cases = [
        ({}, CheckStatus.OK, "to the goal area"),
        ({"obstacles": [rectangle(0, 14, 30, 16)]}, CheckStatus.WARNING, "bar every way"),
        (
            {"obstacles": [rectangle(10, 6.5, 30, 9), rectangle(10, 0, 30, 4)]},
            CheckStatus.PROBLEM,
            "closer to the entry",
        ),
        ({"window_s": 60.0}, CheckStatus.WARNING, "there and back"),
        # All that a look round shows is nearer to what nobody has looked at than legs may be.
        ({"scanner": {"reach_m": 2.5}}, CheckStatus.WARNING, "the scanner reaches 2.5 m"),
        ({"goal_radius_m": 0.1}, CheckStatus.WARNING, "holds no open cell: no cell's centre is within 0.1 m of it"),
        (
            {"goal": lon_lat(28.5, 15), "goal_radius_m": 1.0},
            CheckStatus.WARNING,
            "no open cell: known obstacles cover it",
        ),
    ]
    for change, status, words in cases:
        mission = await service.create(search_spec(search=change))
        (line,) = [c for c in (preflight(await service.get(mission.id))).checks if c.id == "search.ways"]
        assert (line.status, words in line.message) == (status, True), line


async def test_a_mission_treats_vehicles_by_what_their_link_says_they_can_do(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    capabilities = LinkCapabilities(ready_before_start=True, scans=True, circles_m=1e3)
    monkeypatch.setattr(RestFleetLink, "capabilities", capabilities)
    mission = await service.create(search_spec(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    checks = {check.id: check for check in (preflight(await service.get(mission.id))).checks}
    assert checks["link.boat"].status is CheckStatus.PROBLEM
    assert "within 1000 m" in checks["circles.boat"].message
    assert "scans.boat" not in checks
    [refused] = (await scan(await service.get(mission.id), [all_round(14, 5, 1.0)])).items
    assert "scans by itself" in refused.reason
    with pytest.raises(ConflictError, match="not every vehicle is ready: boat is unknown"):
        await act(service, mission.id, "start", actor="Ana")


def test_the_examples_are_missions() -> None:
    for site in ("harbour", "car-park-1", "car-park-2", "car-park-3"):
        spec = MissionSpec.model_validate(example(site, vehicles=2))
        assert spec.search is not None
        cells = Search(spec, spec.search, spec.frame(), 1.0).grid.blueprint
        world = simulated_world(spec, spec.search)
        truth = harbour_basin(0) if site == "harbour" else car_park(int(site[-1]), 0)
        np.testing.assert_array_equal(cells, truth.known)
        np.testing.assert_array_equal(world.solid, truth.solid)


@pytest.mark.slow
@pytest.mark.parametrize("site", ["car-park-1", "car-park-2", "car-park-3"])
async def test_every_boat_of_an_example_begins_where_it_has_room_and_takes_part(
    service: MissionService, site: str
) -> None:
    spec = MissionSpec.model_validate(example(site, seed=5, vehicles=3))
    assert spec.search is not None
    live = await service.get((await service.create(spec)).id)
    await act(service, live.id, "start", actor="Ana")
    await until(lambda: all(member.report is not None for member in live.team), "all are heard")
    starts = {member.name: member.place_m(live.frame) for member in live.team}
    world = simulated_world(spec, spec.search)
    assert (world.clearance_m(np.array(list(starts.values()))) >= spec.search.safety_m).all()

    def moved() -> bool:
        return all(np.hypot(*(m.place_m(live.frame) - starts[m.name])) > 5.0 for m in live.team)

    await until(moved, "every boat searches")
    await act(service, live.id, "abort", actor="Ana")


async def test_who_is_not_at_the_entry_and_sees_no_way_to_it_is_an_alarm(service: MissionService) -> None:
    boat = {"name": "boat", "kind": "sim", "depth_m": 0, "start": lon_lat(14, 25)}
    walls = [rectangle(0, 8, 30, 10)]
    mission = await service.create(search_spec(vehicles=[boat], search={"obstacles": walls, "simulated_obstacles": []}))
    warned = {check.id: check.status for check in (preflight(await service.get(mission.id))).checks}
    assert warned["search.ways"] is CheckStatus.WARNING
    await act(service, mission.id, "start", actor="Ana")

    async def said() -> bool:
        return any(event.kind == "stuck" for event in await events_after(await service.get(mission.id)))

    await until(said, "the operator is told")
    await act(service, mission.id, "abort", actor="Ana")
