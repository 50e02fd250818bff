"""Which lines the vehicles of a lawnmower survey fly, and what one flies that has flown its own."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon

from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.lines.ground import Ground
from app.exploration.lines.lattice import flown_length, route_length
from app.exploration.lines.lawnmower import (
    LEAST_LEG_M,
    LawnmowerPlanner,
    lawnmower_routes,
    route_across,
    shared_lines,
)
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner

WIDTH, HEIGHT = 120.0, 300.0
AREA = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]])
TEAM = np.array([[20.0, 290.0], [60.0, 150.0], [100.0, 150.0]])


def test_lines_across_keep_to_their_vehicles_strip_and_to_what_it_can_fly() -> None:
    route = route_across(Constraints(AREA), TEAM, 0, 0, 400.0)
    assert route is not None
    assert route_length(TEAM[0], route) <= 400.0
    assert route[:, 0].min() >= 0.0
    assert route[:, 0].max() <= WIDTH / 3 + 1.0, "the third of the area that the westernmost has"
    legs = np.diff(route, axis=0)
    assert (np.abs(legs[:, 0]) > 20.0).sum() >= 3, "several lines lie across"


@pytest.mark.slow
@given(radius_m=st.floats(0.5, 12.0), budget_m=st.floats(1200.0, 6000.0))
@settings(max_examples=30, deadline=None)
def test_no_more_lines_are_begun_than_a_vehicle_has_way_for_with_its_turns(radius_m: float, budget_m: float) -> None:
    routes = lawnmower_routes(Constraints(AREA), TEAM, np.full(3, budget_m), radius_m)
    straight = lawnmower_routes(Constraints(AREA), TEAM, np.full(3, budget_m))
    for start, route, without in zip(TEAM, routes, straight, strict=True):
        assert flown_length(start, route, radius_m) <= budget_m
        assert 2 <= len(route) <= len(without)


@pytest.mark.slow
@given(radius_m=st.floats(0.5, 12.0), budget_m=st.floats(1200.0, 6000.0))
@settings(max_examples=8, deadline=None)
def test_nobody_is_dealt_more_than_it_has_way_for_with_its_turns(radius_m: float, budget_m: float) -> None:
    routes = shared_lines(Constraints(AREA), TEAM, np.full(3, budget_m), np.full(3, radius_m))
    flown_m = [flown_length(start, route, radius_m) for start, route in zip(TEAM, routes, strict=True)]
    assert max(flown_m) <= budget_m
    assert min(flown_m) > 0.0


@pytest.mark.parametrize("budgets_m", [(1100.0, 1100.0, 1100.0), (2500.0, 1000.0, 1000.0), (600.0, 600.0, 3000.0)])
@pytest.mark.parametrize("radius_m", [0.0, 5.0])
def test_lines_take_most_of_what_every_vehicle_can_fly(budgets_m: tuple[float, float, float], radius_m: float) -> None:
    routes = shared_lines(Constraints(AREA), TEAM, np.array(budgets_m), np.full(3, radius_m))
    flown_m = np.array([flown_length(start, route, radius_m) for start, route in zip(TEAM, routes, strict=True)])
    assert (flown_m <= np.array(budgets_m)).all()
    assert flown_m.sum() >= 0.92 * np.sum(budgets_m)
    assert (flown_m >= 0.75 * np.array(budgets_m)).all()


def test_lines_leave_no_ground_much_farther_from_them_than_half_their_distance() -> None:
    budget_m = 1500.0
    routes = shared_lines(Constraints(AREA), TEAM, np.full(3, budget_m), np.zeros(3))
    away_m = Ground.of(Constraints(AREA)).away_m([np.vstack([at, way]) for at, way in zip(TEAM, routes, strict=True)])
    spacing_m = WIDTH * HEIGHT / (3 * budget_m)
    assert away_m.max() < 0.85 * spacing_m, "the farthest are between the ends of lines, at the border"
    assert np.quantile(away_m, 0.95) < 0.6 * spacing_m


@pytest.mark.parametrize("turns_take_way", [True, False])
def test_turns_are_counted_where_they_take_way(turns_take_way: bool) -> None:
    planner, left_m, radius_m = create_planner("lawnmower", PlannerOptions(turn_radius_m=8.0)), 1300.0, 8.0
    place = (2.0, 2.0)
    proposal = planner.propose(
        replace(situation(left_m, place), turns_take_way=turns_take_way), np.random.default_rng(0)
    )
    [ahead] = planner.ways_ahead_m().values()
    route = np.vstack([proposal.positions[:, :2], ahead])
    assert route_length(np.array(place), route) <= left_m
    counted_m = flown_length(np.array(place), route, radius_m if turns_take_way else 0.0)
    assert 0.9 * left_m < counted_m <= left_m + 1.0
    assert (flown_length(np.array(place), route, radius_m) <= left_m + 1.0) == turns_take_way


def test_each_vehicle_pays_for_turns_by_its_own_circles() -> None:
    """All paid for the widest of the team's: a slow one beside a fast one had way left when its lines were flown."""
    radii_m, budgets_m = np.array([10.0, 4.0, 4.0]), np.array([2500.0, 1000.0, 1000.0])
    routes = shared_lines(Constraints(AREA), TEAM, budgets_m, radii_m)
    by_own = [flown_length(at, way, r) for at, way, r in zip(TEAM, routes, radii_m, strict=True)]
    by_widest = [flown_length(at, way, 10.0) for at, way in zip(TEAM, routes, strict=True)]
    assert (np.array(by_own) <= budgets_m).all()
    assert max(by_widest[1:]) > 1000.0


def test_lines_along_follow_those_across() -> None:
    route = route_across(Constraints(AREA), TEAM, 2, 1, 700.0)
    assert route is not None
    assert route[:, 0].min() >= 2 * WIDTH / 3 - 1.0
    assert (np.abs(np.diff(route[:, 1])) > 200.0).any()


@pytest.mark.parametrize(("passes", "budget_m"), [(0, HEIGHT - 1.0), (2, 20.0)])
def test_who_can_hardly_fly_on_gets_no_more_lines(passes: int, budget_m: float) -> None:
    assert route_across(Constraints(AREA), TEAM, 0, passes, budget_m) is None


def situation(left_m: float, at_m: tuple[float, float]) -> Situation:
    xy = np.array([[60.0, 150.0]])
    belief = Belief(xy, np.array([20.0]), np.array([1.0]), np.zeros(1, bool), np.ones(1), 10.0)
    constraints = Constraints(AREA, max_step_m=20.0, max_depth_m=10.0)
    return Situation(
        step=1,
        steps_total=10,
        vehicles=("a",),
        positions=np.array([[*at_m, 2.0]]),
        headings_rad=np.zeros(1),
        soundings_en_m=np.zeros((0, 2)),
        belief=belief,
        constraints=constraints,
        left_m=np.array([left_m]),
    )


def test_a_vehicle_whose_battery_lasts_longer_than_was_sure_does_not_wait_where_its_lines_end() -> None:
    planner = create_planner("lawnmower")
    assert isinstance(planner, LawnmowerPlanner)
    place, rng = (2.0, 2.0), np.random.default_rng(0)
    for _ in range(60):
        east, north, _ = planner.propose(situation(400.0, place), rng).positions[0]
        moved_m = float(np.hypot(east - place[0], north - place[1]))
        assert moved_m > 0.5, "it always has somewhere to go"
        place = (float(east), float(north))
    told = planner.propose(situation(400.0, place), rng).done
    assert told == frozenset()
    memory = planner.snapshot()
    ended = create_planner("lawnmower")
    ended.restore(memory)
    for _ in range(450):
        proposal = ended.propose(situation(1.0, place), rng)
        place = (float(proposal.positions[0, 0]), float(proposal.positions[0, 1]))
        if proposal.done:
            break
    assert proposal.done == {"a"}, "who can fly no further line is done"


def test_who_has_flown_its_lines_flies_over_gaps_and_is_done_when_its_way_is_used_up() -> None:
    """It circled where its lines ended until its way was used up, later it was done: up to a line's length was lost."""
    planner, rng, place, left_m = create_planner("lawnmower"), np.random.default_rng(0), (2.0, 2.0), 1100.0
    for _ in range(100):
        proposal = planner.propose(situation(left_m, place), rng)
        east, north, _ = proposal.positions[0]
        moved_m = float(np.hypot(east - place[0], north - place[1]))
        if proposal.done:
            break
        assert moved_m > 0.5, "it always has somewhere to go"
        left_m, place = left_m - moved_m, (float(east), float(north))
    assert proposal.done == {"a"}
    assert 0.0 <= left_m < LEAST_LEG_M, "it flies over ground between its lines for as long as it can"


def test_a_vehicle_whose_next_stop_is_behind_a_zone_gets_round_it() -> None:
    """One that joined was given lines on the other side, and stayed where it was for as long as its battery lasted."""
    planner = create_planner("lawnmower")
    zone = np.array([[30.0, 100.0], [90.0, 100.0], [90.0, 200.0], [30.0, 200.0]])
    constraints = Constraints(AREA, (zone,), max_step_m=20.0, max_depth_m=10.0)
    rng, place, behind = np.random.default_rng(0), (60.0, 95.0), np.array([[60.0, 205.0]])
    planner.propose(replace(situation(3000.0, place), constraints=constraints), rng)
    planner.put_back("a", behind, None)
    for _ in range(15):
        [(east, north, _)] = planner.propose(replace(situation(3000.0, place), constraints=constraints), rng).positions
        place = (float(east), float(north))
        if np.hypot(*(place - behind[0])) < 1.0:
            break
    assert place == pytest.approx(behind[0], abs=1.0)


BAR = np.array([[-10.0, 120.0], [WIDTH + 10.0, 120.0], [WIDTH + 10.0, 150.0], [-10.0, 150.0]])
"""A zone that cuts the area in two."""


@pytest.mark.parametrize("east_m", [5.0, 60.0, 115.0])
def test_vehicles_on_both_sides_of_a_zone_that_cuts_the_area_fly_the_lines_of_their_side(east_m: float) -> None:
    """Each got lines on both sides, and stayed where its way led through the zone."""
    constraints, starts = Constraints(AREA, (BAR,)), np.array([[east_m, 20.0], [east_m, 110.0], [60.0, 280.0]])
    budgets_m = np.array([500.0, 600.0, 1000.0])
    routes = shared_lines(constraints, starts, budgets_m, np.full(3, 4.0))
    for start, route, budget_m in zip(starts, routes, budgets_m, strict=True):
        assert not LineString(np.vstack([start, route])).intersects(Polygon(BAR))
        assert 0.6 * budget_m <= flown_length(start, route, 4.0) <= budget_m


@pytest.mark.parametrize("place", [(60.0, 20.0), (60.0, 280.0)])
def test_a_vehicle_whose_next_stop_cannot_be_reached_flies_what_comes_after_it(place: tuple[float, float]) -> None:
    planner, rng, left_m = create_planner("lawnmower"), np.random.default_rng(0), 900.0
    constraints = Constraints(AREA, (BAR,), max_step_m=20.0, max_depth_m=10.0)
    planner.propose(replace(situation(left_m, place), constraints=constraints), rng)
    planner.put_back("a", np.array([[30.0, 300.0 - place[1]], [70.0, 300.0 - place[1]]]), None)
    for _ in range(90):
        proposal = planner.propose(replace(situation(left_m, place), constraints=constraints), rng)
        if proposal.done or left_m < LEAST_LEG_M:
            break
        [(east, north, _)] = proposal.positions
        moved_m = float(np.hypot(east - place[0], north - place[1]))
        assert moved_m > 0.5, "it always has somewhere to go"
        left_m, place = left_m - moved_m, (float(east), float(north))
    assert left_m < LEAST_LEG_M


def test_lines_stay_side_by_side_where_a_step_is_as_long_as_a_line() -> None:
    planner, rng = create_planner("lawnmower"), np.random.default_rng(0)
    told, place, headings = situation(3000.0, (2.0, 2.0)), np.array([2.0, 2.0]), []
    told = replace(told, constraints=replace(told.constraints, max_step_m=HEIGHT))
    for _ in range(12):
        end = planner.propose(replace(told, positions=np.array([[*place, 2.0]])), rng).positions[0, :2]
        east, north = end - place
        if np.hypot(east, north) > HEIGHT / 2:
            headings.append(abs(np.rad2deg(np.arctan2(east, north))) % 180.0)
        place = end
    assert len(headings) >= 4
    assert max(min(h, 180.0 - h) for h in headings) < 2.0, "they do not become a zigzag"


def test_no_corner_of_the_area_that_points_inwards_is_cut() -> None:
    """Only corners of zones were not cut: vehicles came half a metre out of the area beside them."""
    bent = np.array([[0.0, 0.0], [120.0, 0.0], [120.0, 120.0], [60.0, 120.0], [60.0, 60.0], [0.0, 60.0]])
    told = situation(4000.0, (2.0, 2.0))
    told = replace(told, constraints=Constraints(bent, max_step_m=20.0, max_depth_m=10.0))
    planner, rng, place = create_planner("lawnmower"), np.random.default_rng(0), np.array([64.0, 68.0])
    planner.propose(replace(told, positions=np.array([[*place, 2.0]])), rng)
    planner.put_back("a", np.array([[60.5, 59.5], [55.0, 52.0]]), None)
    ends = [place]
    for _ in range(3):
        ends.append(planner.propose(replace(told, positions=np.array([[*ends[-1], 2.0]])), rng).positions[0, :2])
    assert Polygon(bent).buffer(1e-6).covers(LineString(ends))
