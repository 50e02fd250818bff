"""Surveys with swath sonars flown ahead."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from app.estimation.swath import SwathSonar
from app.missions.flight.steering import steered
from app.missions.forecast.floor import Floor
from app.missions.forecast.request import _view, _whole, starts_of
from app.missions.forecast.simulate import Forecast, fly_over
from app.missions.forecast.swarm import FlightOutcome, SoFar, circle_m
from app.missions.forecast.swath_flight import swath_of, sweeps
from app.missions.forecast.whole_survey import batteries
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team
from simulator.floors.terrain import Terrain
from simulator.world import SimulatedVehicle
from tests.support.missions.specs import lon_lat, make_spec, rectangle

NONE = np.zeros((0, 4))
AMPLE_S = 600.0


def beams(side_m: float = 60.0, names: str = "ab", **changes: object) -> MissionSpec:
    vehicles = [{"name": name, "kind": "sim", "sensor": "multibeam"} for name in names]
    given_ = {"vehicles": vehicles, "planner": {"name": "swath"}, "budget": {"minutes": 60}, "limits": {}}
    return make_spec(side_m, **(given_ | changes))


def level(depth_m: float, side_m: float) -> Floor:
    cells = int(side_m / 5.0) + 2
    return Floor(Terrain(np.full((cells, cells), depth_m), 5.0, name="level"), "level", "level", 0.0)


def flown(spec: MissionSpec, floor: Floor, prior: np.ndarray = NONE, budget_s: float = AMPLE_S) -> FlightOutcome:
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    return fly_over(floor, spec, members, starts_of(spec, members)[0], SoFar(prior=prior), budget_s)


@pytest.mark.slow
async def test_a_forecast_flies_a_survey_with_swath_sonars_and_tells_what_all_of_it_takes(
    service: MissionService,
) -> None:
    view = await service.forecaster.of_description(beams(40.0), floor_depth_m=12.0)
    assert view.floors > 3
    assert view.coverage_pct_range.low > 97.0
    whole = view.whole_survey
    assert whole is not None
    assert whole.within_budget
    assert whole.distance_m == pytest.approx(sum(v.distance_m for v in view.vehicles), rel=0.3)
    assert 40.0 < whole.distance_m_range.low <= whole.distance_m <= whole.distance_m_range.high < 1500.0
    assert 0.0 < view.duration_s_range.low <= view.duration_s <= view.duration_s_range.high < 3600.0
    assert view.steps_simulated == view.steps
    assert any("Turning circles" in words for words in view.assumptions)
    by_one_beam = await service.forecaster.of_description(make_spec(steps=2))
    assert by_one_beam.whole_survey is None


@pytest.mark.slow
def test_deeper_water_takes_fewer_metres_and_a_short_budget_leaves_ground_unseen() -> None:
    shoal, deep = (flown(beams(), level(depth_m, 60.0)) for depth_m in (7.0, 16.0))
    assert shoal.coverage_pct > 97.0
    assert deep.coverage_pct > 97.0
    assert sum(shoal.distances_m.values()) > 1.2 * sum(deep.distances_m.values())
    spec = beams(budget={"km_per_vehicle": 0.06})
    short = flown(spec, level(7.0, 60.0))
    assert short.whole is not None
    assert short.coverage_pct < 70.0
    assert short.whole.coverage_pct > 97.0
    assert not short.whole.within_budget
    for name, way_m in short.distances_m.items():
        # Legs count, not the circles between them.
        assert way_m < 60.0 + 3.0 * 2.0 * math.pi * 4.0 * spec.speed_mps
        assert short.whole.distances_m[name] >= way_m


@pytest.mark.slow
def test_vehicles_that_begin_beside_each_other_use_up_no_way_while_one_lets_the_other_pass() -> None:
    spec = beams(100.0, "abc", cell_m=1.0, limits={"max_step_m": 25.0}, budget={"minutes": 8})
    found = flown(spec, level(5.0, 100.0))
    assert found.coverage_pct > 95.0
    assert min(found.distances_m.values()) > 400.0


def test_what_was_imported_is_the_floor_that_lines_are_laid_for() -> None:
    spec = beams()
    east, north = np.meshgrid(np.arange(1.0, 60.0, 2.0), np.arange(1.0, 60.0, 2.0))
    prior = np.column_stack([east.ravel(), north.ravel(), np.full(east.size, 9.0), np.full(east.size, 0.1)])
    known = flown(spec, level(9.0, 60.0), prior)
    assert known.coverage_pct > 97.0


def test_what_was_missed_in_a_few_cells_is_still_to_be_flown_however_wide_swaths_are() -> None:
    spec = beams(names="a", cell_m=1.0, coverage={"crosslines_pct": 0})
    east, north = (axis.ravel() for axis in np.meshgrid(np.arange(0.5, 60.0), np.arange(0.5, 60.0)))
    seen = np.hypot(east - 30.0, north - 30.0) > 3.0
    sounded = np.column_stack([east, north, np.full_like(east, 50.0), np.full_like(east, 0.1)])
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts = starts_of(spec, members)[0]
    flights = [
        fly_over(level(50.0, 60.0), spec, members, starts, SoFar(soundings=rows), AMPLE_S)
        for rows in (sounded, sounded[seen])
    ]
    assert flights[0].duration_s < 1.0
    assert flights[1].duration_s > 20.0


def test_a_zone_is_gone_round_and_nobody_waits_beside_it_for_ever() -> None:
    spec = beams(100.0, keep_out=[rectangle(40, 35, 60, 55)], budget={"minutes": 120})
    found = flown(spec, level(12.0, 100.0))
    assert found.whole is not None
    assert found.whole.drawn_out == 1.0
    zone = Polygon(spec.to_local(spec.keep_out[0])).buffer(spec.limits.keep_out_margin_m - 0.1)
    for way_m in found.whole.ways_m.values():
        assert not LineString(way_m).intersects(zone)
        # No vehicle stands still.
        assert (np.hypot(*np.diff(way_m, axis=0).T) < 0.01).mean() < 0.05
    # All but the zone itself is seen, a part of it too.
    assert found.coverage_pct > 94.0


def test_time_that_is_up_draws_the_rest_out_and_says_so() -> None:
    spec = beams()
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    floor = level(12.0, 60.0)
    found = Forecast([flown(spec, floor, budget_s=0.0)], [floor])
    assert found.flights[0].whole is not None
    view = _view(spec, found, "", spec.steps, _whole(spec, members, found))
    assert any("drawn out" in words for words in view.assumptions)


def test_batteries_are_counted_by_what_vehicles_can_bring_home() -> None:
    vehicles = [{"name": "a", "kind": "sim", "sensor": "multibeam", "endurance_min": 6.0}]
    spec = beams(vehicles=vehicles, recovery={"point": list(lon_lat(-10.0, 30.0))})
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    floor = level(7.0, 60.0)
    found = Forecast([flown(spec, floor)], [floor])
    whole = _whole(spec, members, found)
    assert whole is not None
    [vehicle] = whole.vehicles
    assert vehicle.batteries is not None
    assert vehicle.batteries > 1
    assert vehicle.duration_s > vehicle.distance_m / spec.speed_mps


@given(
    seconds=st.floats(1.0, 5000.0),
    full_s=st.floats(200.0, 2000.0),
    home_s=st.floats(0.0, 50.0),
    comes_home=st.booleans(),
)
def test_a_battery_lasts_for_the_way_out_its_part_of_the_way_and_the_way_back(
    seconds: float, full_s: float, home_s: float, comes_home: bool
) -> None:
    found = batteries(seconds, lambda _: home_s, full_s, reserved=comes_home)
    reserve_s = with_reserve_s(home_s) if comes_home else 0.0
    first_s, later_s = full_s - reserve_s, full_s - reserve_s - home_s
    if first_s >= seconds:
        assert found is not None
        assert (found.count, found.extra_s) == (1, 0.0)
    elif later_s < 1.0 or first_s < 1.0:
        assert found is None or later_s > 0.5
    else:
        assert found is not None
        assert found.count == pytest.approx(1 + math.ceil((seconds - first_s) / later_s), abs=1)
        assert found.extra_s == pytest.approx((found.count - 1) * 2.0 * home_s)


@given(
    heading=st.floats(-7.0, 7.0), east=st.floats(-50.0, 50.0), north=st.floats(-50.0, 50.0), radius=st.floats(0.5, 12.0)
)
def test_a_vehicle_turns_in_its_circle_and_comes_where_it_is_sent(
    heading: float, east: float, north: float, radius: float
) -> None:
    end = 3.0 + east, -2.0 + north
    poses, ways_m = steered((3.0, -2.0, heading), end, radius, 1.0)
    way_m = ways_m[-1]
    assert math.hypot(poses[-1, 0] - end[0], poses[-1, 1] - end[1]) <= max(8.0, 2.0 * radius)
    pieces_m = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert way_m == pytest.approx(pieces_m.sum())
    assert (np.abs(np.diff(poses[:, 2])) <= pieces_m / radius + 1e-6).all()
    assert math.hypot(east, north) - 9.0 <= way_m <= math.hypot(east, north) + 4.0 * math.pi * radius + 1.0


def test_beams_meet_the_floor_as_far_aside_as_the_sonar_reaches() -> None:
    sonar = SwathSonar(math.radians(120.0), 256, 5.0, 100.0)
    poses = np.array([[100.0, 100.0, 0.0, 2.0]])
    flat = Terrain(np.full((60, 60), 12.0), 5.0)
    east, north, depth, slant, down = swath_of(sonar, poses, flat, 1.0)
    np.testing.assert_allclose(depth, 12.0)
    np.testing.assert_allclose(north, 100.0)
    assert east.min() == pytest.approx(100.0 - 10.0 * math.tan(math.radians(60.0)))
    assert east.max() == pytest.approx(100.0 + 10.0 * math.tan(math.radians(60.0)))
    assert slant.max() == pytest.approx(20.0)
    np.testing.assert_allclose(down, 10.0)
    short = SwathSonar(math.radians(120.0), 256, 5.0, 15.0)
    assert np.abs(swath_of(short, poses, flat, 1.0)[0] - 100.0).max() <= math.sqrt(15.0**2 - 10.0**2) + 1e-6


def test_only_surveys_with_swath_sonars_sweep() -> None:
    assert sweeps(beams())
    assert not sweeps(beams(planner={"name": "lawnmower"}))
    assert not sweeps(make_spec(planner={"name": "swath"}))


@pytest.mark.parametrize(("course_deg", "aside_m"), [(0.0, 6.0), (0.0, 12.0), (90.0, 6.0), (150.0, 6.0), (180.0, 10.0)])
def test_ways_are_as_long_as_a_simulated_vehicle_flies_them(course_deg: float, aside_m: float) -> None:
    """Up a line, aside, and on in another course."""
    floor = Terrain(np.full((42, 42), 20.0), 5.0, name="level")
    course = math.radians(90.0 + course_deg)
    far_m = np.array([100.0 + aside_m, 100.0]) + 40.0 * np.array([math.sin(course), math.cos(course)])
    ends = [(100.0, 100.0), (100.0 + aside_m, 100.0), (float(far_m[0]), float(far_m[1]))]
    craft = SimulatedVehicle("a", floor, (100.0, 60.0, 2.0), np.random.default_rng(0))
    spec = beams(names="a")
    pose, way_m, flown_m, here = (100.0, 60.0, 0.0), 0.0, 0.0, craft.position
    for end in ends:
        craft.go_to(*end, 2.0, 1.3, arrival_radius_m=2.0, pass_within_m=8.0)
        while not craft.arrived:
            craft.advance(0.1)
            before, here = here, craft.position
            flown_m += math.hypot(here.east_m - before.east_m, here.north_m - before.north_m)
        poses, ways_m = steered(pose, end, circle_m(spec, spec.vehicles[0]), 2.0)
        pose, way_m = (float(poses[-1, 0]), float(poses[-1, 1]), float(poses[-1, 2])), way_m + ways_m[-1]
    assert way_m == pytest.approx(flown_m, rel=0.06)
