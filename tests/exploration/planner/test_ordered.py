"""Ordered ways: flown within every limit, to their end, remembered exactly, and the planner goes on after them."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from app.estimation import SingleBeam
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.open_ground import OpenGround
from app.exploration.core.problem import Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planner.ordered import OrderedPlanner
from app.exploration.planners import create_planner
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

HOLLOW = np.array([[0, 0], [100, 0], [100, 100], [60, 100], [60, 30], [40, 30], [40, 100], [0, 100]], dtype=float)
ZONE = np.array([[70.0, 40.0], [85.0, 40.0], [85.0, 60.0], [70.0, 60.0]])
OPTIONS = PlannerOptions(search=20, candidates=20)


def planner_of(name: str) -> OrderedPlanner:
    return OrderedPlanner(create_planner(name, OPTIONS, SingleBeam()))


def fly(planner: OrderedPlanner, situation: Situation, legs: int) -> list[np.ndarray]:
    """Let planned legs be flown as they are; the places (n_vehicles, 3) one after the other."""
    places = [np.array(situation.positions)]
    for step in range(1, legs + 1):
        here = replace(situation, step=step, positions=places[-1])
        found = planner.propose(here, np.random.default_rng([7, step]))
        assert not here.constraints.violations(here.vehicles, places[-1], found.positions)
        places.append(np.array(found.positions))
    return places


@pytest.mark.slow
@given(goal=st.tuples(st.floats(1.0, 99.0), st.floats(1.0, 99.0)), after=st.integers(0, 12))
@settings(max_examples=8)
def test_a_vehicle_gets_where_it_is_ordered_round_zones_and_inside_the_area(
    goal: tuple[float, float], after: int
) -> None:
    constraints = Constraints(HOLLOW, (ZONE,), max_step_m=12.0, max_depth_m=20.0, min_separation_m=2.0)
    space = FreeSpace(constraints, 0.0)
    corner = space.nearest(np.array(goal))
    situation = make_situation(constraints=constraints, belief=make_belief(known=False))
    planner = planner_of("lawnmower")
    here = fly(planner, situation, after)[-1]
    planner.lead("a", 1, corner[None], np.zeros((0, 2)), here[0, :2])
    places = fly(planner, replace(situation, positions=here), 35)
    away = [float(np.hypot(*(place[0, :2] - corner))) for place in places]
    assert min(away) <= 0.5, "it came there"
    assert not len(planner.ways["a"].corners_m)
    for a, b in pairwise(places):
        for i in (0, 1):
            leg = LineString([a[i, :2], b[i, :2] + 1e-9])
            assert Polygon(HOLLOW).buffer(1e-4).covers(leg)
            assert not Polygon(ZONE).buffer(-1e-4).intersects(leg)


def test_a_place_nobody_may_be_at_ends_the_order_and_not_the_survey() -> None:
    constraints = Constraints(SQUARE, max_step_m=10.0, max_depth_m=20.0, min_separation_m=5.0)
    planner, situation = planner_of("lawnmower"), make_situation(constraints=constraints)
    here = fly(planner, situation, 8)[-1]
    # The other one waits there, off the lines of the first, and does not move.
    planner.lead("a", 4, here[1:, :2], np.zeros((0, 2)), here[0, :2])
    alone = replace(situation, positions=here, moving=np.array([True, False]))
    places = fly(planner, alone, 12)
    assert planner.refused["a"][0] == 4
    assert "another vehicle" in planner.refused["a"][1]
    assert "a" not in planner.ways
    assert np.hypot(*(places[-1][0] - places[-3][0])[:2]) > 5.0, "it goes on with its lines"


def test_a_place_outside_ends_the_order_where_nobody_can_come_nearer() -> None:
    constraints = Constraints(SQUARE, max_step_m=10.0, max_depth_m=20.0)
    planner, situation = planner_of("lawnmower"), make_situation(constraints=constraints, steps=200, vehicles=("a",))
    here = fly(planner, situation, 2)[-1]
    planner.lead("a", 4, np.array([[50.0, -4.0]]), np.zeros((0, 2)), here[0, :2])
    places = fly(planner, replace(situation, positions=here), 30)
    assert planner.refused["a"] == (4, "nobody may go nearer to where it was ordered")
    assert np.hypot(*(places[-1][0] - places[-3][0])[:2]) > 5.0, "it goes on with its lines"


def test_a_leg_that_was_flown_has_passed_its_corner_however_near_its_vehicle_came() -> None:
    planner, situation = planner_of("lawnmower"), make_situation(steps=200, vehicles=("a",))
    here = fly(planner, situation, 2)[-1]
    corner, then = here[0, :2] + np.array([6.0, 0.0]), here[0, :2] + np.array([6.0, 20.0])
    planner.lead("a", 1, np.array([corner, then]), np.zeros((0, 2)), here[0, :2])
    short = here.copy()
    short[0, :2] = corner - np.array([2.5, 0.0])
    planner.reach("a", then)
    assert len(planner.ways["a"].corners_m) == 2, "it was not there yet"
    planner.reach("a", corner)
    legs = fly(planner, replace(situation, positions=short), 3)
    assert np.allclose(legs[1][0, :2] - short[0, :2], 10.0 * (then - short[0, :2]) / np.hypot(*(then - short[0, :2])))
    assert np.allclose(planner.ways["a"].passed_m, [corner, then])


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
def test_a_memory_taken_up_goes_on_as_if_nothing_had_happened(name: str) -> None:
    whole, situation = planner_of(name), make_situation()
    here = fly(whole, situation, 4)[-1]
    whole.lead("a", 9, np.array([[80.0, 80.0], [20.0, 80.0]]), np.zeros((0, 2)), here[0, :2])
    there = fly(whole, replace(situation, positions=here), 5)[-1]
    again = planner_of(name)
    again.restore(whole.snapshot())
    assert again.snapshot() == whole.snapshot()
    assert again.taken == {"a": 9}
    on = replace(situation, positions=there)
    assert np.array_equal(np.array(fly(whole, on, 25)), np.array(fly(again, on, 25)))
    # One who never ordered anything finds the planner's own memory.
    plain = planner_of(name)
    fly(plain, situation, 2)
    inner = create_planner(name, OPTIONS, SingleBeam())
    inner.restore(plain.snapshot())
    again.restore(inner.snapshot())
    assert (again.ways, again.taken) == ({}, {})
    with pytest.raises(ValueError, match="memory"):
        again.restore(b'{"kind":"ordered","version":1,"memory":{}}')


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
def test_the_survey_goes_on_where_it_was_left(name: str) -> None:
    planner, situation = planner_of(name), make_situation(steps=200, vehicles=("a",))
    places = fly(planner, situation, 6)
    # It turns back from the end of its fourth leg: the last two are not flown.
    left = places[4][0, :2]
    planner.lead("a", 1, np.array([[90.0, 50.0]]), np.array([place[0, :2] for place in places[5:]]), left)
    after = fly(planner, replace(situation, positions=places[4]), 40)
    for place in [left, *(place[0, :2] for place in places[5:])]:
        ways = [LineString([a[0, :2], b[0, :2] + 1e-9]) for a, b in pairwise(after)]
        assert min(way.distance(LineString([place, place + 1e-6])) for way in ways[12:]) < 2.0


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
def test_the_rest_of_a_line_is_left_out(name: str) -> None:
    planner, situation = planner_of(name), make_situation(steps=200, vehicles=("a",))
    places = fly(planner, situation, 3)
    here = places[-1][0, :2]
    line = places[-1][0, :2] - places[-2][0, :2]
    ahead = here + 4.0 * line  # where it would be in four legs
    assert planner.skip("a", 1, np.zeros((0, 2)), places[1][0, :2], here)
    after = fly(planner, replace(situation, positions=places[-1]), 12)
    assert min(float(np.hypot(*(place[0, :2] - ahead))) for place in after) > 2.0
    assert not planner_of("random").skip("a", 1, np.zeros((0, 2)), here, here)


def test_ordered_legs_are_not_taken_back() -> None:
    planner, situation = planner_of("cao"), make_situation(steps=200)
    here = fly(planner, situation, 4)[-1]
    planner.lead("a", 1, np.array([[80.0, 80.0]]), np.zeros((0, 2)), here[0, :2])
    there = fly(planner, replace(situation, positions=here), 2)[-1]
    assert not planner.take_back({"a": 1})
    fly(planner, replace(situation, positions=there), 12)
    assert not planner.take_back({"a": 12})
    memory: Any = planner.snapshot()
    assert planner.take_back({"a": 1, "b": 1})
    assert planner.snapshot() != memory


def test_legs_that_are_given_up_are_decided_again() -> None:
    planner, situation = planner_of("lawnmower"), make_situation(steps=200, vehicles=("a",))
    here = fly(planner, situation, 2)[-1]
    goal = here[0, :2] + np.array([25.0, 0.0])
    planner.lead("a", 1, goal[None], np.zeros((0, 2)), here[0, :2])
    legs = fly(planner, replace(situation, positions=here), 5)
    assert not len(planner.ways["a"].corners_m), "its last leg is decided"
    planner.lose("a", np.array([leg[0, :2] for leg in legs[2:4]]))
    assert planner.ways["a"].corners_m.tolist() == [goal.tolist()]
    again = fly(planner, replace(situation, positions=legs[1]), 3)
    assert np.allclose(again[-1][0, :2], goal) or np.allclose(again[-2][0, :2], goal)
    for _ in range(10):
        fly(planner, replace(situation, positions=again[0]), 4)
        planner.lose("a", goal[None])
    assert planner.refused["a"][0] == 1
    assert "a" not in planner.ways


@pytest.mark.parametrize("name", ["cao", "lawnmower"])
def test_legs_that_something_barred_are_flown_round_it(name: str) -> None:
    constraints = Constraints(SQUARE, (ZONE,), max_step_m=12.0, max_depth_m=20.0, min_separation_m=2.0)
    planner, situation = planner_of(name), make_situation(constraints=constraints, belief=make_belief(known=False))
    here = fly(planner, situation, 3)[-1]
    here[0, :2] = 60.0, 50.0
    ends_m = np.array([[95.0, 50.0], [95.0, 70.0]])
    planner.go_round("a", ends_m)
    again = planner_of(name)
    again.restore(planner.snapshot())
    assert not planner.is_ordered("a")
    for leading in (planner, again):
        places = fly(leading, replace(situation, positions=here), 14)
        nearest = [int(np.argmin([np.hypot(*(place[0, :2] - end)) for place in places])) for end in ends_m]
        assert nearest[0] < nearest[1]
        for k, end in zip(nearest, ends_m, strict=True):
            assert np.hypot(*(places[k][0, :2] - end)) <= 0.5
        assert "a" not in leading.ways, "then its planner goes on"
        assert not leading.refused


def test_ends_that_were_reached_on_a_way_round_are_seen_again_where_their_legs_were_barred() -> None:
    planner, situation = planner_of("lawnmower"), make_situation(constraints=Constraints(SQUARE, max_step_m=12.0))
    here = fly(planner, situation, 1)[-1]
    here[0, :2] = 30.0, 50.0
    ends_m = np.array([[40.0, 50.0], [80.0, 50.0]])
    planner.go_round("a", ends_m)
    places = fly(planner, replace(situation, positions=here), 3)
    np.testing.assert_allclose(planner.ways["a"].corners_m, ends_m[1:])
    planner.go_round("a", np.array([place[0, :2] for place in places[1:]]))
    np.testing.assert_allclose(planner.ways["a"].corners_m, ends_m)
    for _ in range(6):
        assert "a" in planner.ways
        planner.go_round("a", ends_m[:0])
    assert "a" not in planner.ways, "it is not tried for ever"


def test_an_order_takes_the_place_of_a_way_round() -> None:
    planner, situation = planner_of("lawnmower"), make_situation(constraints=Constraints(SQUARE, max_step_m=12.0))
    here = fly(planner, situation, 2)[-1]
    ends_m = np.array([[40.0, 50.0], [80.0, 50.0]])
    planner.go_round("a", ends_m)
    planner.lead("a", 3, np.array([[20.0, 20.0]]), np.zeros((0, 2)), None)
    assert planner.is_ordered("a")
    flown = [place[0, :2] for place in fly(planner, replace(situation, positions=here), 40)]
    for end in (np.array([20.0, 20.0]), *ends_m):
        assert min(np.hypot(*(place - end)) for place in flown) <= 6.0


def test_a_vehicle_gets_where_it_is_ordered_nearer_to_a_zone_than_plans_go() -> None:
    around = (np.array([[66.0, 36.0], [89.0, 36.0], [89.0, 64.0], [66.0, 64.0]]),)
    constraints = Constraints(SQUARE, (ZONE,), max_step_m=12.0, max_depth_m=20.0, around=around)
    planner = planner_of("lawnmower")
    situation = make_situation(constraints=constraints.for_plans, belief=make_belief(known=False))
    goal = np.array([87.0, 50.0])
    planner.lead("a", 1, goal[None], np.zeros((0, 2)), None)
    places = [np.array(situation.positions)]
    for step in range(1, 30):
        here = replace(situation, step=step, positions=places[-1])
        places.append(np.array(planner.propose(here, np.random.default_rng([7, step])).positions))
        assert not constraints.violations(("a",), places[-2][:1], places[-1][:1])
        if not len(planner.ways["a"].corners_m):
            break
    assert min(np.hypot(*(place[0, :2] - goal)) for place in places) <= 0.5


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("kept", [0, 1, 4, 6])
def test_legs_that_a_vehicle_was_not_given_are_still_to_be_flown(name: str, ordered: bool, kept: int) -> None:
    # Some legs of one vehicle were decided at once; those after the first ones were not given to it.
    planner, situation = planner_of(name), make_situation(belief=make_belief(known=False))
    here = fly(planner, situation, 6)[-1]
    goal = here[0, :2] + np.where(here[0, :2] < 50.0, 25.0, -25.0)
    if ordered:
        planner.lead("a", 1, np.array([here[0, :2] + [0.0, 5.0], goal]), np.zeros((0, 2)), here[0, :2])
    alone = replace(situation, moving=np.array([True, False]))
    decided = fly(planner, replace(alone, positions=here), 8)
    assert not planner.is_ordered("a") or not len(planner.ways["a"].corners_m), "its order is over by then"
    planner.put_back("a", np.array([place[0, :2] for place in decided[1 + kept :]]))
    # Later on plans may be renewed at other places.
    again = fly(planner, replace(alone, positions=decided[kept]), min(8 - kept, 3))
    expected = decided[kept : kept + len(again)]
    np.testing.assert_allclose([place[0, :2] for place in again], [place[0, :2] for place in expected], atol=1e-6)


@pytest.mark.parametrize("name", ["lawnmower", "cao"])
def test_a_line_that_is_left_goes_on_where_it_was_left(name: str) -> None:
    planner, situation = planner_of(name), make_situation(steps=200, vehicles=("a",))
    places = fly(planner, situation, 9)
    planner.leave("a", places[6][0, :2], np.array([place[0, :2] for place in places[7:]]))
    # Meanwhile it is led home: that says nothing of its line.
    planner.leave("a", np.array([50.0, -20.0]), np.array([[50.0, 5.0], [50.0, -20.0]]))
    restored = planner_of(name)
    restored.restore(planner.snapshot())
    restored.leave("a", np.array([50.0, -20.0]), np.array([[50.0, 5.0]]))
    elsewhere = np.array([[50.0, 1.0, places[-1][0, 2]]])
    again = fly(restored, replace(situation, positions=elsewhere), 30)
    way = LineString([place[0, :2] for place in again])
    assert max(way.distance(Point(place[0, :2])) for place in places[6:]) < 1.0
    left = LineString([place[0, :2] for place in places[6:]])
    assert way.buffer(1.0).covers(left)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lawnmower", "cao"])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=6, deadline=None)
def test_planned_ways_go_round_shoals_and_nobody_stands_before_one(name: str, seed: int) -> None:
    """Legs over them are not allowed: a vehicle stood before one for as many legs as it had left."""
    rng = np.random.default_rng(seed)
    constraints = Constraints(SQUARE, max_step_m=12.0, max_depth_m=20.0, min_altitude_m=1.0)
    belief = make_belief()
    depth_m = np.full(len(belief.xy_m), 8.0)
    for x, y, radius_m in zip(*rng.uniform(20.0, 80.0, (2, 3)), rng.uniform(5.0, 14.0, 3), strict=True):
        depth_m[np.hypot(*(belief.xy_m - [x, y]).T) < radius_m] = 0.5
    bottom = Bottom.from_landmarks(belief.xy_m, depth_m)
    start = np.array([[4.0, 4.0, 1.0]])
    situation = make_situation(
        vehicles=("a",),
        positions=start,
        belief=replace(belief, depth_m=depth_m),
        constraints=constraints,
    )
    planner, place, stood = planner_of(name), start, 0
    ground = OpenGround(bottom, constraints)
    for step in range(1, 50):
        here = replace(situation, step=step, positions=place, soundings_en_m=place[:, :2])
        memory = planner.snapshot()
        found = planner.propose(here, np.random.default_rng([seed, step]))
        again = planner_of(name)
        again.restore(memory)
        np.testing.assert_array_equal(
            again.propose(here, np.random.default_rng([seed, step])).positions, found.positions
        )
        assert not constraints.violations(here.vehicles, place, found.positions, bottom)
        if "a" in found.done:
            break
        moved_m = float(np.hypot(*(found.positions - place)[0, :2]))
        stood = stood + 1 if moved_m < 0.5 else 0
        assert stood < 3, f"it stands at {place[0]}"
        assert not ground.is_shoal(found.positions[:, :2]).any()
        place = np.array(found.positions)


def shoal_ahead() -> tuple[OrderedPlanner, Situation]:
    """A lawnmower with one vehicle, and a shoal on the line that it is on."""
    belief = make_belief()
    constraints = Constraints(SQUARE, max_step_m=12.0, max_depth_m=20.0, min_altitude_m=1.0)
    situation = make_situation(
        vehicles=("a",), positions=np.array([[4.0, 4.0, 1.0]]), belief=belief, constraints=constraints
    )
    planner = planner_of("lawnmower")
    places = fly(planner, situation, 2)
    along = places[-1][0, :2] - places[-2][0, :2]
    middle = places[-1][0, :2] + 22.0 * along / np.hypot(*along)
    depth_m = np.where(np.hypot(*(belief.xy_m - middle).T) < 7.0, 0.5, 9.0)
    return planner, replace(situation, positions=places[-1], belief=replace(belief, depth_m=depth_m))


def begun(planner: OrderedPlanner, situation: Situation) -> tuple[list[np.ndarray], np.ndarray]:
    """Fly until a way round the shoal has begun; the places, and what was planned before that."""
    places = [np.array(situation.positions)]
    for step in range(3, 12):
        rest = planner.planner.ways_ahead_m()["a"]
        here = replace(situation, step=step, positions=places[-1])
        places.append(np.array(planner.propose(here, np.random.default_rng(step)).positions))
        if "a" in planner.ways:
            return places, rest
    pytest.fail("no way leads round")


def test_who_leaves_on_a_way_round_a_shoal_leaves_the_rest_of_its_line_to_whoever_goes_on() -> None:
    planner, situation = shoal_ahead()
    places, rest = begun(planner, situation)
    way = planner.ways["a"].corners_m
    planner.leave("a", places[-2][0, :2], places[-1][:, :2])
    assert "a" not in planner.ways
    ahead = planner.planner.ways_ahead_m()["a"]
    np.testing.assert_allclose(ahead[0], places[-2][0, :2])
    np.testing.assert_allclose(ahead[-1], rest[-1])
    assert LineString(ahead).buffer(1e-6).covers(Point(way[-1])), "it is taken up behind the shoal"


def test_planned_legs_before_a_way_round_that_were_not_given_are_flown_all_the_same() -> None:
    planner, situation = shoal_ahead()
    places, _ = begun(planner, situation)
    ends = np.array([place[0, :2] for place in places[1:]])
    planner.put_back("a", ends)
    np.testing.assert_allclose(planner.ways["a"].corners_m[: len(ends)], ends)
