"""The plan of a mission as it would begin."""

import asyncio
import threading
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from shapely.geometry import LineString, Polygon

from app.exploration.swath.flown_ahead import seen_from
from app.missions.errors import InvalidRequestError
from app.missions.fleet.interface import Position, VehicleReport
from app.missions.forecast import preview
from app.missions.forecast.plan import TeamPlan, _flying, _level, plan
from app.missions.forecast.request import starts_of
from app.missions.maps.builder import make_grid
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.team import Member, Team
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import lon_lat, make_spec, rectangle
from tests.support.waiting import until

AMPLE_S = 600.0


def members_of(spec: MissionSpec) -> list[Member]:
    team = Team()
    return [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]


def planned(spec: MissionSpec, **how: Any) -> TeamPlan:
    members = members_of(spec)
    starts, _ = starts_of(spec, members)
    return plan(spec, members, starts, **({"budget_s": AMPLE_S} | how))


def beams(side_m: float = 200.0, **changes: Any) -> MissionSpec:
    vehicles = [{"name": name, "kind": "sim", "sensor": "multibeam"} for name in "ab"]
    return make_spec(
        side_m, **{"vehicles": vehicles, "planner": {"name": "swath"}, "budget": {"minutes": 90}} | changes
    )


@pytest.mark.parametrize("planner", ["lawnmower", "cao", "swath", "random"])
def test_ways_stay_in_the_area_off_its_zones_and_within_what_vehicles_may_fly(planner: str) -> None:
    spec = beams(
        90.0,
        planner={"name": planner},
        keep_out=[rectangle(30, 30, 45, 50)],
        budget={"km_per_vehicle": 0.4},
        limits={"max_step_m": 8.0, "border_margin_m": 3.0},
    )
    found = planned(spec)
    assert found.whole
    inner = Polygon(spec.local_inner_area()).buffer(0.01)
    zone = Polygon(spec.to_local(spec.keep_out[0])).buffer(-0.01)
    for way in found.ways:
        assert len(way.corners_m) > 3
        # Where vehicles begin may be in the margin.
        line = LineString(way.corners_m[1:])
        assert inner.covers(line)
        assert not line.intersects(zone)
        assert way.distance_m <= 400.0 + 1e-6
        assert way.least_s <= way.seconds <= way.most_s
    assert [way.name for way in found.ways] == ["a", "b"]


def test_the_lines_of_swath_sonars_see_the_whole_area_over_a_level_bottom() -> None:
    spec = beams()
    found = planned(spec, floor_depth_m=15.0)
    grid, mask = make_grid(spec.local_area(), 5.0)
    coverage = _level(grid, 15.0, mask)
    for member, way in zip(members_of(spec), found.ways, strict=True):
        flying = _flying(spec, member)
        assert flying is not None
        for a, b in pairwise(way.corners_m):
            coverage = replace(coverage, done=coverage.done | seen_from(a, b, coverage, flying))
    assert coverage.done[mask].mean() > 0.97
    assert found.depth_m == 15.0
    shallow = planned(spec, floor_depth_m=6.0)
    assert sum(way.distance_m for way in shallow.ways) > 1.5 * sum(way.distance_m for way in found.ways)


@pytest.mark.parametrize(("km", "within"), [(0.3, False), (3.0, True)])
async def test_lines_at_a_distance_are_told_with_what_all_of_them_take_whatever_the_budget(
    service: MissionService, km: float, within: bool
) -> None:
    options = {"line_spacing_m": 20.0, "line_heading_deg": 90.0}
    spec = make_spec(
        120.0,
        vehicles=[{"name": name, "kind": "sim"} for name in "ab"],
        planner={"name": "lawnmower", "options": options},
        budget={"km_per_vehicle": km},
    )
    view = await service.previews.of(spec)
    whole = view.whole_survey
    assert whole is not None
    assert whole.within_budget == within
    assert 6 * 118.0 < whole.distance_m < 6 * 120.0 + 2 * 120.0 + 2 * 170.0
    assert (view.distance_m == pytest.approx(whole.distance_m)) == within
    courses = [np.diff(np.array(vehicle.way), axis=0) for vehicle in view.vehicles]
    longest = [legs[np.argmax(np.abs(legs[:, 0]))] for legs in courses]
    assert all(abs(north) < 1e-3 * abs(east) for east, north in longest), "they lie from west to east"


def test_a_vehicle_whose_energy_is_short_turns_back_where_it_still_comes_home() -> None:
    point = list(lon_lat(-10.0, -10.0))
    vehicles = [
        {"name": "short", "kind": "sim", "endurance_min": 9.0},
        {"name": "ample", "kind": "sim", "endurance_min": 600.0},
        {"name": "unknown", "kind": "sim"},
    ]
    spec = make_spec(
        120.0,
        vehicles=vehicles,
        planner={"name": "lawnmower"},
        budget={"km_per_vehicle": 1.0},
        recovery={"point": point},
    )
    short, ample, unknown = planned(spec).ways
    assert ample.turn_back_m is None
    assert unknown.turn_back_m is None
    assert unknown.left_s is None
    assert short.turn_back_m is not None
    assert short.left_s is not None
    assert short.needs_s > short.left_s
    assert 0.0 < short.turn_back_m < short.distance_m
    home = np.array([-10.0, -10.0])
    away_m = float(np.hypot(*(short.place_m(short.turn_back_m) - home)))
    needs_s = short.turn_back_m / spec.speed_mps + with_reserve_s(away_m / spec.speed_mps)
    # Beside that only the turns until there, and its berth instead of the point itself.
    assert 0.6 * short.left_s < needs_s <= short.left_s + with_reserve_s(30.0 / spec.speed_mps)
    assert short.way_home_m is not None
    assert float(np.hypot(*(short.way_home_m[-1] - home))) < 25.0


def test_a_plan_that_takes_long_ends_early_and_says_so() -> None:
    found = planned(sim_spec(planner={"name": "random"}, steps=1000), budget_s=0.0)
    assert not found.whole
    assert all(len(way.corners_m) <= 3 for way in found.ways)
    many = [{"name": f"v{k}", "kind": "sim"} for k in range(7)]
    assert not planned(make_spec(60.0, vehicles=many, planner={"name": "cao"})).own
    assert planned(make_spec(60.0, vehicles=many[:2], planner={"name": "cao"})).own


async def test_a_plan_is_told_in_degrees_with_what_is_assumed_and_nothing_is_stored(service: MissionService) -> None:
    spec = sim_spec(planner={"name": "lawnmower"}, steps=40, recovery={"point": list(lon_lat(0.0, 0.0))})
    view = await service.previews.of(spec)
    assert [vehicle.vehicle for vehicle in view.vehicles] == ["a", "b"]
    for vehicle in view.vehicles:
        assert vehicle.way_home is not None
        assert vehicle.way[-1] == vehicle.way_home[0]
        assert all(abs(lon + 8.705) < 0.001 and abs(lat - 41.185) < 0.001 for lon, lat in vehicle.way)
    assert view.distance_m == pytest.approx(sum(vehicle.distance_m for vehicle in view.vehicles))
    assert view.duration_s_range.low <= view.duration_s <= view.duration_s_range.high
    assert view.energy_suffices is None
    assert any("corner of the area" in words for words in view.assumptions)
    with pytest.raises(InvalidRequestError, match="no vehicle"):
        await service.previews.of(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match="no planner"):
        await service.previews.of(make_spec(planner={"name": "oracle"}))
    assert await service.missions() == []


async def test_whoever_leaves_ends_its_plan_and_one_that_waits_never_begins(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []
    ended = threading.Event()

    def endless(spec: MissionSpec, *_: object, stop: Any, **__: object) -> TeamPlan:
        begun.append(spec.name)
        while not stop():
            ended.wait(0.001)
        ended.set()
        raise RuntimeError("nobody waits")

    monkeypatch.setattr(preview, "plan", endless)
    spec = sim_spec(planner={"name": "lawnmower"})
    first = asyncio.create_task(service.previews.of(spec.model_copy(update={"name": "first"})))
    await until(lambda: bool(begun), "it is begun")
    second = asyncio.create_task(service.previews.of(spec.model_copy(update={"name": "second"})))
    await asyncio.sleep(0)
    second.cancel()
    first.cancel()
    await until(ended.is_set, "it ends")
    await asyncio.gather(first, second, return_exceptions=True)
    assert begun == ["first"]


def test_a_plan_of_a_mission_that_follows_comes_from_where_its_vehicles_are_then() -> None:
    asked = {"planner": {"name": "lawnmower"}, "budget": {"km_per_vehicle": 0.2}}
    vehicle = {"name": "a", "kind": "imc", "start": list(lon_lat(-50.0, 10.0))}
    spec = make_spec(60.0, vehicles=[vehicle], after="earlier", **asked)
    [member] = members_of(spec)
    # Now it is somewhere else.
    lon, lat = lon_lat(30.0, 30.0)
    report = VehicleReport("a", 0.0, Position(lat, lon, 0.0), None, None, None, None)
    starts_m, _ = starts_of(spec, [replace(member, report=report)])
    assert starts_m == pytest.approx(np.array([[-50.0, 10.0]]), abs=0.1)
    [way] = plan(spec, [member], starts_m, budget_s=AMPLE_S).ways
    assert way.corners_m[0] == pytest.approx([-50.0, 10.0], abs=0.1)
    # The way in takes nothing of what is flown in the area.
    [inside] = plan(spec, [member], np.array([[0.0, 10.0]]), budget_s=AMPLE_S).ways
    assert way.distance_m == pytest.approx(inside.distance_m + 50.0, abs=1.0)
    assert way.distance_m > 200.0
    alone = make_spec(60.0, vehicles=[vehicle], **asked)
    here_m, _ = starts_of(alone, [replace(member, report=report)])
    assert here_m == pytest.approx(np.array([[30.0, 30.0]]), abs=0.1)
