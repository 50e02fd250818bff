"""Searches in which vehicles are held, called home or give way: nobody is led where nobody has looked."""

import numpy as np
import pytest
from shapely.geometry import LineString, Point, box

from app.arrays import FloatArray
from app.exploration.site_search.ground import SiteGround
from app.missions.fleet.interface import ScanReport, WaypointStatus
from app.missions.fleet.links.sim import AGROUND
from app.missions.flight.search_hooks import SearchHooks
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.operations.scans import report_of_posted
from app.missions.preflight.survey import preflight
from app.missions.running.homecoming import call_home, hold
from app.missions.search.scan_schema import Scan
from app.missions.search.state import Search
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.states import MissionState
from app.missions.team import Withdrawal
from app.missions.views.mission import CheckStatus
from tests.support.missions.harbour import act, until_state, view_of
from tests.support.missions.placed import PlacedVehicles
from tests.support.missions.searches import search_spec
from tests.support.missions.specs import lon_lat, rectangle
from tests.support.waiting import until

PONTOON = box(0, 14, 15, 16)
HOME = {"recovery": {"point": lon_lat(14.0, 5.0)}}


async def flying(service: MissionService, step: int, **changes: object) -> LiveMission:
    """Start a search; returns it when it has come to a step."""
    live = await service.get((await service.create(search_spec(**changes))).id)
    await act(service, live.id, "start", actor="Ana")

    async def there() -> bool:
        return (await view_of(service, live.id)).progress.step >= step

    await until(there, f"it is at step {step}")
    return live


def place_m(live: LiveMission, name: str) -> FloatArray:
    return live.team.members[name].place_m(live.frame)


async def said(live: LiveMission) -> list[str]:
    return [line.message for line in await events_after(live)]


@pytest.mark.slow
async def test_who_is_held_stays_where_it_is_and_searches_on(service: MissionService) -> None:
    live = await flying(service, 4)
    boat = live.team.members["boat"]
    await hold(live, "boat", "Ana")
    await until(lambda: boat.waits_m is not None, "it is told where to wait")
    assert boat.waits_m is not None
    assert boat.target_m is not None
    assert boat.leg.start_m is not None
    assert LineString([boat.leg.start_m, boat.target_m]).distance(Point(boat.waits_m)) < 1.5
    assert (await view_of(service, live.id)).state is MissionState.RUNNING
    await service.send_on(live, "boat", "Ana")
    done = await until_state(service, live.id, MissionState.FINISHED)
    assert done.reason == "everybody is back at the entry"
    assert not any(AGROUND in words for words in await said(live))


@pytest.mark.slow
async def test_who_is_called_home_goes_round_what_was_found_on_the_way(service: MissionService) -> None:
    live = await flying(service, 1, **HOME)
    boat = live.team.members["boat"]

    await until(lambda: bool(boat.place_m(live.frame)[1] > 17.0), "it is behind the pontoon")
    await call_home(live, "boat", "Ana")
    await until(lambda: boat.ordered and boat.legs > 0 and boat.withdrawal is not None, "it is led home")
    assert boat.target_m is not None
    corners = np.array([boat.place_m(live.frame), boat.target_m, *(leg.target_m for leg in boat.ahead)])
    assert LineString(corners).distance(PONTOON) > 0.5
    done = await until_state(service, live.id, MissionState.FINISHED)
    assert np.hypot(*(boat.place_m(live.frame) - (14.0, 5.0))) < 5.0, done.reason
    words = await said(live)
    assert any("is home" in line for line in words)
    assert not any(AGROUND in line for line in words)


async def test_nobody_goes_to_a_recovery_point_that_nobody_has_looked_at(service: MissionService) -> None:
    live = await flying(service, 1, recovery={"point": lon_lat(3.0, 27.0)})
    await call_home(live, "boat", "Ana")

    async def told() -> bool:
        return any("nobody has looked at" in line for line in await said(live))

    await until(told, "it says that there is no way")
    await until_state(service, live.id, MissionState.FINISHED)
    assert place_m(live, "boat")[1] < 14.0
    assert not any(AGROUND in line for line in await said(live))


@pytest.mark.slow
async def test_nobody_runs_into_who_is_held(service: MissionService) -> None:
    boats = [{"name": name, "kind": "sim", "depth_m": 0} for name in "ab"]
    limits = {"max_step_m": 3.0, "min_depth_m": 0.0, "min_altitude_m": 0.1, "min_separation_m": 4.0}
    live = await flying(service, 8, vehicles=boats, limits=limits, search={"simulated_obstacles": []})
    await hold(live, "a", "Ana")
    held = live.team.members["a"]
    await until(lambda: held.waits_m is not None, "it waits")

    async def never(*_: object) -> bool:
        return False

    task = SearchHooks(live, 1.0, never).task(live.header.step)
    assert task is not None
    np.testing.assert_allclose(task.standing_m, [place_m(live, "a")], atol=1.0)
    apart_m = []
    assert live.search is not None
    entry_m = live.search.site.entry_m

    def back() -> bool:
        apart_m.append(float(np.hypot(*(place_m(live, "a") - place_m(live, "b")))))
        return live.search is not None and live.search.figures.explored_part > 0.6 and is_at_entry("b")

    def is_at_entry(name: str) -> bool:
        return bool(np.hypot(*(place_m(live, name) - entry_m)) <= 9.0)

    await until(back, "the other has searched, and is back")
    assert min(apart_m) > 2.5
    # Nobody is left at sea: the search is over when both are back, however long that is.
    assert held.report is not None
    later_s = held.report.time_s + 120.0
    await until(lambda: held.report is not None and held.report.time_s > later_s, "two minutes have passed")
    assert live.header.state is MissionState.RUNNING
    await service.send_on(live, "a", "Ana")
    done = await until_state(service, live.id, MissionState.FINISHED)
    assert done.reason == "everybody is back at the entry"
    assert all(np.hypot(*(place_m(live, name) - entry_m)) <= 18.0 for name in "ab")


async def test_the_checklist_says_when_there_is_no_room_at_the_recovery_point(service: MissionService) -> None:
    for point, free in ((lon_lat(14.0, 5.0), True), (lon_lat(28.0, 5.0), False)):
        live = await service.get((await service.create(search_spec(recovery={"point": point}))).id)
        line = next(check for check in preflight(live).checks if check.id == "recovery.boat")
        assert line.status is CheckStatus.NOTE
        assert ("within 1.5 m of what is known to stand there" in line.message) is not free


async def test_a_search_whose_time_is_longer_than_the_energy_lasts_is_warned_of(service: MissionService) -> None:
    boat = {"name": "boat", "kind": "sim", "depth_m": 0, "endurance_min": 30}
    for window_s, status in ((600.0, CheckStatus.OK), (4000.0, CheckStatus.WARNING)):
        spec = search_spec(vehicles=[boat], search={"window_s": window_s})
        live = await service.get((await service.create(spec)).id)
        assert next(check for check in preflight(live).checks if check.id == "recovery.boat").status is status


@pytest.mark.slow
async def test_who_is_called_home_in_a_search_comes_to_its_entry(service: MissionService) -> None:
    live = await flying(service, 6)
    boat = live.team.members["boat"]
    await until(lambda: bool(boat.place_m(live.frame)[1] > 17.0), "it is behind the pontoon")
    await call_home(live, "boat", "Ana")
    await until_state(service, live.id, MissionState.FINISHED)
    assert np.hypot(*(boat.place_m(live.frame) - (14.0, 5.0))) < 12.0
    words = await said(live)
    assert any("is home" in line for line in words)
    assert not any(AGROUND in line for line in words)


async def placed_boats(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> tuple[PlacedVehicles, Search]:
    """Return two boats of a search, a and b, that keep 4 m apart, and what it knows."""
    boats = [{"name": name, "kind": "sim", "depth_m": 0} for name in "ab"]
    limits = {"max_step_m": 8.0, "min_depth_m": 0.0, "min_altitude_m": 0.1, "min_separation_m": 4.0}
    live = await service.get((await service.create(search_spec(vehicles=boats, limits=limits))).id)
    assert live.search is not None
    return PlacedVehicles(live, service.hub, monkeypatch), live.search


@pytest.mark.parametrize("half_m", [2.5, 9.0], ids=["in a lane", "where there is room"])
async def test_who_gives_way_goes_only_where_somebody_has_looked(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, half_m: float
) -> None:
    scene, search = await placed_boats(service, monkeypatch)
    for east in (3.0, 8.0, 13.0, 18.0, 23.0):
        sine = np.abs(np.cos(np.radians(np.arange(0, 360, 2))))
        walls = half_m / np.maximum(sine, 1e-6)
        search.see([_look_round(east, 12.0, [float(away) if away < 9.0 else None for away in walls])])
    goes_home = scene.put("a", (3.0, 12.0, 0.0), (20.0, 12.0, 0.0))
    scene.put("b", (24.0, 12.0, 0.0), (2.0, 12.0, 0.0))
    await scene.giving_way.look()
    assert scene.ordered == []  # as long as both search on their legs are decided together, to be apart
    goes_home.withdrawal = Withdrawal(Response.RETURN, "called home")
    await scene.giving_way.look()
    aside_m = [abs(scene.where_m(order)[1] - 12.0) for order in scene.ordered]
    assert all(away_m < 1.0 for away_m in aside_m) if half_m < 3.0 else max(aside_m) > 2.0
    for order in scene.ordered:
        here_m, there_m = place_m(scene.live, order.vehicle), np.array(scene.where_m(order))
        assert np.hypot(*(there_m - here_m)) < 0.5 or search.clear(here_m, there_m)


async def test_nobody_waits_for_a_boat_that_stands_far_enough_from_its_way(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, search = await placed_boats(service, monkeypatch)
    for east in (3.0, 8.0, 13.0, 18.0):
        search.see([_all_round(east, 14.0)])
    stands = scene.put("a", (10.0, 12.0, 0.0), (10.0, 12.0, 0.0))
    stands.status, stands.withdrawal = WaypointStatus.REACHED, Withdrawal(Response.HOLD, "held")
    scene.put("b", (3.0, 16.5, 0.0), (20.0, 16.5, 0.0))
    await scene.giving_way.look()
    assert scene.ordered == []


def _look_round(east: float, north: float, ranges_m: list[float | None]) -> ScanReport:
    lon, lat = lon_lat(east, north)
    values = {"vehicle": "b", "time_s": 99.0, "lat_deg": lat, "lon_deg": lon, "bearing_step_deg": 2.0}
    return report_of_posted(Scan.model_validate(values | {"reach_m": 10.0, "ranges_m": ranges_m}))


def _all_round(east: float, north: float) -> ScanReport:
    return _look_round(east, north, [None] * 180)


@pytest.mark.parametrize("seed", range(6))
def test_every_leg_of_a_way_keeps_the_safety_distance_from_all_that_is_not_known_to_be_free(seed: int) -> None:
    spec = search_spec()
    assert spec.search is not None
    search = Search(spec, spec.search, spec.frame(), 1.0)
    rng = np.random.default_rng(seed)
    for east, north in rng.uniform(6.0, 24.0, (6, 2)):
        search.see([_all_round(east, north)])
    task = search.task(0.0)
    hazards = [box(col, row, col + 1, row + 1) for row, col in np.argwhere(SiteGround.for_legs(task).hazard)]
    found = 0
    for here_m, end_m in zip(rng.uniform(6.0, 24.0, (20, 2)), rng.uniform(6.0, 24.0, (20, 2)), strict=True):
        if min(hazard.distance(Point(here_m)) for hazard in hazards) < 1.6:
            continue
        way_m = search.way_m(here_m, end_m)
        if way_m is None:
            continue
        found += 1
        np.testing.assert_array_equal(way_m[-1], end_m)
        line = LineString([here_m, *way_m])
        assert min(hazard.distance(line) for hazard in hazards) >= spec.search.safety_m
        # Round others, too, as far as they are off the ends.
        other_m = 0.5 * (here_m + end_m)
        round_m = search.way_m(here_m, end_m, [other_m], 3.0)
        if round_m is not None:
            assert LineString([here_m, *round_m]).distance(Point(other_m)) >= 3.0
    assert found


def test_no_way_leads_to_what_nobody_has_looked_at() -> None:
    spec = search_spec(search={"obstacles": [rectangle(0, 12, 30, 13)]})
    assert spec.search is not None
    search = Search(spec, spec.search, spec.frame(), 1.0)
    here_m = np.array([14.0, 6.0])
    search.see([_all_round(*here_m)])
    for end_m in ([14.0, 27.0], [14.0, 11.5], [40.0, 6.0]):
        assert search.way_m(here_m, np.array(end_m)) is None
