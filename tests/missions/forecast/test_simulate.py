"""What is foretold of a mission, beside what comes of it."""

import asyncio
import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import Position, VehicleReport
from app.missions.forecast import request
from app.missions.forecast.floor import Floor, floors_of
from app.missions.forecast.ranges import range_of
from app.missions.forecast.simulate import Forecast, fly, fly_over, forecast
from app.missions.forecast.swarm import FlightOutcome, SoFar, Swarm, planner_of
from app.missions.maps.builder import MapBuilder
from app.missions.operations.history import steps_after
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.task.constraints import make_constraints
from app.missions.task.way import least_way_m
from app.missions.team import CommittedLeg, Member, Team
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from tests.support.exploration.situations import make_situation
from tests.support.missions.harbour import act, sim_spec, until_state
from tests.support.missions.specs import lon_lat, make_spec
from tests.support.waiting import until

NONE = np.zeros((0, 4))


def lines(**changes: Any) -> MissionSpec:
    return sim_spec(**({"steps": 8, "planner": {"name": "lawnmower"}} | changes))


@pytest.mark.slow
async def test_a_forecast_is_near_what_comes_and_says_what_it_assumes(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    # On a slow machine, too, all steps are simulated over all floors.
    monkeypatch.setattr(request, "BUDGET_S", 600.0)
    monkeypatch.setattr(request, "PATIENCE_S", 600.0)
    spec = lines(steps=4)
    before = await service.forecaster.of_description(spec)
    assert before.steps == before.steps_simulated == before.steps_flown == 4
    assert before.floors > 3
    assert before.coverage_pct_range.low <= before.coverage_pct <= before.coverage_pct_range.high
    mission = (await service.create(spec)).id
    assert (await service.forecaster.of_mission(await service.get(mission))).duration_s == pytest.approx(
        before.duration_s, rel=0.05
    )
    await act(service, mission, "start", actor="Ana")
    await until_state(service, mission, MissionState.FINISHED)
    # Between its waypoints: on a slow machine vehicles of this speed circle for long until they get the next one.
    ways: dict[str, list[tuple[float, float, float]]] = {}
    for step in await steps_after(await service.get(mission)):
        for w in step.waypoints:
            ways.setdefault(w.vehicle, []).append((w.east_m, w.north_m, w.depth_m))
    legs = sum(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) for way in ways.values())
    foretold = sum(vehicle.distance_m for vehicle in before.vehicles)
    # The same plan is flown otherwise by vehicles that turn in circles, in so small an area above all.
    assert legs / 2 < foretold < 2 * legs
    assert {vehicle.vehicle for vehicle in before.vehicles} == {"a", "b"}
    assert 0 <= before.coverage_pct <= 100
    assert any("guess" in words for words in before.assumptions)
    with pytest.raises(ConflictError, match="nothing before it"):
        await service.forecaster.of_mission(await service.get(mission))


async def test_what_cannot_be_foretold_is_refused_and_nothing_is_stored(service: MissionService) -> None:
    with pytest.raises(InvalidRequestError, match="no vehicle"):
        await service.forecaster.of_description(make_spec(vehicles=[]))
    with pytest.raises(InvalidRequestError, match="no planner"):
        await service.forecaster.of_description(make_spec(planner={"name": "oracle"}))
    assert await service.missions() == []


async def test_one_who_leaves_ends_the_simulation(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, ended = threading.Event(), threading.Event()

    def endless(*_: object, stop: object, **__: object) -> Forecast:
        begun.set()
        while not stop():  # type: ignore[operator]
            pass
        ended.set()
        raise RuntimeError("nobody waits")

    monkeypatch.setattr(request, "forecast", endless)
    asked = asyncio.create_task(service.forecaster.of_description(lines()))
    await until(begun.is_set, "it is begun")
    asked.cancel()
    await until(ended.is_set, "it ends")
    with pytest.raises(asyncio.CancelledError):
        await asked


def test_time_that_is_up_leaves_a_forecast_that_says_so() -> None:
    spec = lines()
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = request.starts_of(spec, members)
    found = forecast(spec, members, starts, SoFar(), budget_s=0.0)
    assert found.steps_flown == 1
    view = request._view(spec, found, "", 8)
    # Drawn out: as if every step were as long as the first.
    assert view.duration_s == pytest.approx(8 * 8.0 / spec.speed_mps, rel=0.2)
    assert any("1 of 8 steps" in words for words in view.assumptions)
    assert view.steps_flown == view.steps_simulated == 1
    # After one step there is nothing to be sure of, and it is not drawn out to the end.
    assert view.coverage_pct_range.high < 20.0


@pytest.mark.parametrize(("planner", "km"), [("cao", 0.2), ("lawnmower", 0.31)])
def test_a_slow_vehicle_beside_a_quick_one_has_nothing_left_in_a_forecast(planner: str, km: float) -> None:
    """What it flew after the quick one's last leg was drawn out, as if there had been no time to fly it."""
    vehicles = [{"name": name, "kind": "sim", "speed_mps": mps} for name, mps in (("quick", 2.0), ("slow", 1.0))]
    spec = sim_spec(side_m=60.0, vehicles=vehicles, planner={"name": planner}, budget={"km_per_vehicle": km})
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = request.starts_of(spec, members)
    [floor] = [one for one, _ in zip(floors_of(spec, NONE, 4.0, None), range(1), strict=False)]
    builder = MapBuilder(spec.local_area(), spec.cell_m, spec.accuracy_m)
    builder.build()
    *_, last = fly(spec, members, starts, builder, floor.terrain)
    assert last.left_m <= 2 * least_way_m(spec)
    assert last.distance_m[1] > 150.0


def test_without_patience_one_floor_is_flown_and_that_is_said() -> None:
    spec = lines()
    team = Team()
    members = [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]
    starts, _ = request.starts_of(spec, members)
    found = forecast(spec, members, starts, SoFar(), budget_s=0.0, patience_s=0.0)
    assert (len(found.flights), len(found.floors)) == (1, 1)
    view = request._view(spec, found, "", 8)
    assert view.floors == 1
    assert any("one floor only" in words for words in view.assumptions)


def test_ranges_span_what_came_over_the_floors() -> None:
    spec = lines()
    floors = list(floors_of(spec, NONE, 4.0, None))
    flights = [
        FlightOutcome(
            100.0 + 10.0 * k, {"a": 50.0 + k, "b": 40.0}, 10.0 * k, 100.0 - 10.0 * k, 0.1 * k if k else None, 8
        )
        for k in range(len(floors))
    ]
    view = request._view(spec, Forecast(flights, floors), "", 8)
    assert view.coverage_pct == 50.0
    # Of eleven figures the lowest is exceeded by all but one in twelve others: a little more than it is 10 %.
    assert (view.coverage_pct_range.low, view.coverage_pct_range.high) == (
        pytest.approx(2.0, abs=0.2),
        pytest.approx(98.0, abs=0.2),
    )
    assert view.duration_s_range.low < view.duration_s < view.duration_s_range.high
    assert view.mean_sd_m_range is not None
    assert 0.08 < view.mean_sd_m_range.low < view.mean_sd_m_range.high < 1.25
    ways = {vehicle.vehicle: vehicle.distance_m_range for vehicle in view.vehicles}
    # What flights ahead do not know of: a few percent of any way.
    assert 37.5 < ways["b"].low < 40.0 < ways["b"].high < 42.5
    assert ways["a"].low < ways["a"].high
    assert view.floors == len(floors)
    assert not any("Only" in words for words in view.assumptions)


def floors_under(spec: MissionSpec, prior: np.ndarray, depth_m: float | None = None) -> list[Floor]:
    return list(floors_of(spec, prior, 4.0, depth_m))


def test_floors_are_guesses_of_different_roughness_that_agree_where_soundings_were_imported() -> None:
    spec = make_spec(40.0)
    guessed = floors_under(spec, NONE)
    assert {floor.known for floor in guessed} == {0.0}
    assert all("guess" in floor.words for floor in guessed)
    depths = [float(np.median(floor.terrain.z_m)) for floor in guessed]
    # How deep it is is not known either, but that vehicles have room there.
    assert np.median(depths) == pytest.approx(10.0, rel=0.3)
    assert min(depths) > 4.0
    assert max(depths) > 1.5 * min(depths)
    steps = [float(np.abs(np.diff(floor.terrain.z_m, axis=0)).mean()) for floor in guessed]
    assert max(steps) > 5 * min(steps)
    assert np.median(floors_under(spec, NONE, 55.0)[0].terrain.z_m) == pytest.approx(55.0, rel=0.2)
    east, north = np.meshgrid(np.arange(1.0, 20.0, 2.0), np.arange(1.0, 40.0, 2.0))
    prior = np.column_stack([east.ravel(), north.ravel(), 20.0 + 0.1 * east.ravel(), np.full(east.size, 0.1)])
    half = floors_under(spec, prior)
    for floor in half:
        assert 0.1 < floor.known < 0.6
        assert floor.terrain.depth_at_point(9.0, 21.0) == pytest.approx(20.9, abs=0.5)
        assert "as soundings have it" in floor.words
    apart = np.ptp([floor.terrain.z_m for floor in half], axis=0)
    west, east_end = apart[:20, :9].mean(), apart[:20, 17:20].mean()
    assert east_end > 3 * west
    for one, again in zip(guessed, floors_under(spec, NONE), strict=True):
        np.testing.assert_array_equal(one.terrain.z_m, again.terrain.z_m)


def test_between_lines_some_floors_are_as_rough_as_the_sounded_one_and_some_are_not() -> None:
    spec = make_spec(100.0, cell_m=1.0)
    relief = generate("rugged", 2, width_m=102.0, height_m=102.0, cell_m=1.0).z_m
    real = Terrain(20.0 + 2.0 * (relief - relief.mean()) / relief.std(), 1.0)
    north, east = (axis.ravel() for axis in np.meshgrid(np.arange(0.5, 100.0), np.arange(4.5, 100.0, 16.0)))
    at = real.depth_at(east, north)
    floors = floors_under(spec, np.column_stack([east, north, at, np.full_like(at, 0.05)]))

    def roughness_m(floor: Terrain) -> float:
        """Midway between the lines."""
        north, east = np.meshgrid(np.arange(0.5, 99.0), np.arange(12.5, 90.0, 16.0))
        return float(np.sqrt(np.mean(np.diff(floor.depth_at(east, north), axis=1) ** 2)))

    rougher = sum(roughness_m(floor.terrain) > roughness_m(real) for floor in floors)
    assert 3 <= rougher <= len(floors) - 3


def team_of(spec: MissionSpec) -> list[Member]:
    team = Team()
    return [team.join(vehicle, slot) for slot, vehicle in enumerate(spec.vehicles)]


def level(depth_m: float) -> Floor:
    return Floor(Terrain(np.full((30, 30), depth_m), 2.0, name="level"), "level", "level", 0.0)


@pytest.mark.slow
def test_a_forecast_on_the_way_goes_on_from_what_was_sounded() -> None:
    spec = lines()
    members = team_of(spec)
    starts, _ = request.starts_of(spec, members)
    width, height = spec.local_area().max(axis=0)
    east, north = np.meshgrid(np.arange(0.5, width, 1.0), np.arange(0.5, height, 1.0))
    sounded = np.column_stack([east.ravel(), north.ravel(), np.full(east.size, 10.0), np.full(east.size, 0.05)])
    anew = fly_over(level(10.0), spec, members, starts, SoFar(8), 60.0)
    on_the_way = fly_over(level(10.0), spec, members, starts, SoFar(8, soundings=sounded), 60.0)
    assert on_the_way.coverage_pct == 100.0
    assert anew.coverage_pct < 100.0
    floors = list(floors_of(spec, sounded, 4.0, None))
    assert max(float(np.abs(floor.terrain.z_m[5:10, 5:10] - 10.0).max()) for floor in floors) < 0.5


def test_vehicles_that_do_not_tell_where_they_head_are_foretold() -> None:
    spec = lines()
    report = VehicleReport("a", 0.0, Position(41.185, -8.705, 0.0))
    members = [replace(member, report=report) for member in team_of(spec)]
    starts, _ = request.starts_of(spec, members)
    assert fly_over(level(10.0), spec, members, starts, SoFar(), 60.0).duration_s > 0.0


def test_legs_that_vehicles_have_already_are_flown_first_and_cost_no_budget() -> None:
    spec = lines()
    members = team_of(spec)
    frame = spec.frame()
    lat, lon = frame.to_geographic(20.0, 2.0)
    members[0].ahead.append(CommittedLeg(1, Position(float(lat), float(lon), 2.0), np.array([20.0, 2.0])))
    swarm = Swarm(spec, members, np.array([[2.0, 2.0], [7.0, 2.0]]))
    left_m = swarm.left_m.copy()
    [end] = swarm.legs_ahead(0)
    poses = swarm.fly(0, end, ahead=True)
    assert poses[-1, 0] == pytest.approx(20.0 - spec.arrival_radius_m, abs=1.0)
    assert swarm.distance_m[0] == pytest.approx(18.0 - spec.arrival_radius_m, abs=1.0)
    np.testing.assert_array_equal(swarm.left_m, left_m)
    assert swarm.legs_ahead(1) == []


def test_who_stays_where_it_is_uses_up_way_and_hardly_time_and_is_decided_for_alone() -> None:
    spec = sim_spec(budget={"minutes": 10})
    swarm = Swarm(spec, team_of(spec), np.array([[2.0, 2.0], [7.0, 2.0]]))
    left_m = float(swarm.left_m[0])
    assert swarm.due(apart=True).tolist() == [True, True]
    for i in range(2):
        swarm.fly(i, swarm.here[i].copy())
    assert swarm.left_m[0] == left_m - spec.limits.max_step_m
    assert swarm.clock_s[0] <= 2.0
    assert swarm.due(apart=True).tolist() == [True, False]


def test_who_is_done_circles_until_the_last_one_is() -> None:
    spec = sim_spec(budget={"minutes": 10})
    swarm = Swarm(spec, team_of(spec), np.array([[2.0, 2.0], [7.0, 2.0]]))
    swarm.fly(0, np.array([2.0, 30.0, 2.0]))
    assert swarm.flown(1).distance_m[1] == pytest.approx(float(swarm.distance_m[0]))


def test_who_goes_home_when_its_way_is_flown_does_not_circle() -> None:
    spec = sim_spec(budget={"minutes": 10}, recovery={"point": lon_lat(15.0, 4.0)})
    swarm = Swarm(spec, team_of(spec), np.array([[2.0, 2.0], [7.0, 2.0]]))
    swarm.fly(0, np.array([2.0, 30.0, 2.0]))
    circled_m = swarm.flown(1).distance_m[1]
    assert circled_m == pytest.approx(float(swarm.distance_m[0])), "who has way left waits for its next leg"
    swarm.end(1)
    assert swarm.flown(1).distance_m[1] == 0.0


def test_one_in_ten_figures_like_those_of_eleven_floors_lies_below_their_range_and_one_above() -> None:
    rng = np.random.default_rng(4)
    ranges = [range_of(rng.normal(size=11).tolist()) for _ in range(4000)]
    came = rng.normal(size=4000)
    assert np.mean([r.low > x for r, x in zip(ranges, came, strict=True)]) == pytest.approx(0.1, abs=0.02)
    assert np.mean([r.high < x for r, x in zip(ranges, came, strict=True)]) == pytest.approx(0.1, abs=0.02)


def test_a_forecast_goes_on_with_the_plan_of_a_mission_that_had_an_order() -> None:
    """Memory with an order in it was none to it, and it laid the whole survey anew."""
    spec = make_spec(60.0, planner={"name": "lawnmower"})
    planner = planner_of(spec, SoFar())
    at = np.array([[2.0, 2.0, 1.0], [12.0, 2.0, 1.0]])
    situation = make_situation(positions=at, constraints=make_constraints(spec))
    planner.propose(situation, np.random.default_rng(0))
    rest = planner.planner.ways_ahead_m()
    planner.lead("a", 1, np.array([[30.0, 30.0]]), np.zeros((0, 2)), None)
    again = planner_of(spec, SoFar(2, memory=planner.snapshot()))
    assert "a" in again.ways
    for name, way in rest.items():
        np.testing.assert_array_equal(again.planner.ways_ahead_m()[name], way)
