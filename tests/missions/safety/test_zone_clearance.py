"""Plans keep off zones by so much that a leg is free from wherever its vehicle begins it, and close no way by that."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, Limit
from app.exploration.core.free_space import FreeSpace
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.flight.decisions.leg import Place
from app.missions.safety.zone_clearance import room_around
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import limits_of_decisions, make_constraints
from app.missions.task.planner import make_planner
from tests.support.missions.decisions import belief_of, decide_for, place
from tests.support.missions.specs import make_spec, rectangle

SIDE_M, ROOM_M = 100.0, 3.5
AREA_M = np.array([[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]])
ZONES = (Limit.KEEP_OUT, Limit.KEEP_OUT_LEG)
places = st.tuples(st.floats(1.0, SIDE_M - 1.0), st.floats(1.0, SIDE_M - 1.0))


def box(west_m: float, south_m: float, east_m: float, north_m: float) -> FloatArray:
    return np.array([[west_m, south_m], [east_m, south_m], [east_m, north_m], [west_m, north_m]])


def limits(*zones: FloatArray) -> Constraints:
    return Constraints(AREA_M, zones, max_step_m=2 * SIDE_M, around=room_around(AREA_M, zones, ROOM_M))


def enters_zone(constraints: Constraints, start_m: FloatArray, end_m: FloatArray) -> bool:
    broken = constraints.violations(("a",), np.append(start_m, 2.0)[None], np.append(end_m, 2.0)[None])
    return any(violation.limit in ZONES for violation in broken)


@st.composite
def zones(draw: st.DrawFn) -> FloatArray:
    """Return a zone with three to six corners."""
    middle = np.array(draw(places))
    corners = draw(st.integers(3, 6))
    radii = np.array(draw(st.lists(st.floats(3.0, 20.0), min_size=corners, max_size=corners)))
    angle = 2 * np.pi * np.arange(corners) / corners
    return np.asarray(middle + radii[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


@given(st.lists(zones(), min_size=1, max_size=3), places, places, st.floats(0, 2 * np.pi), st.floats(0, 1))
def test_a_planned_leg_is_free_from_anywhere_within_the_room_of_where_it_begins(
    given_zones: list[FloatArray], begin: tuple[float, float], end: tuple[float, float], course: float, part: float
) -> None:
    constraints = limits(*given_zones)
    assume(len(constraints.around) == len(given_zones))
    # Where all of the room would close a way there is less of it.
    both = zip(given_zones, constraints.around, strict=True)
    assume(all(Polygon(zone).buffer(0.999 * ROOM_M).within(Polygon(wide)) for zone, wide in both))
    begin_m, end_m = np.array(begin), np.array(end)
    here_m = begin_m + part * ROOM_M * np.array([math.cos(course), math.sin(course)])
    outside = shapely.union_all([Polygon(zone) for zone in constraints.around])
    assume(not LineString([begin_m, end_m]).intersects(outside))
    assert not enters_zone(constraints, here_m, end_m)


@given(st.lists(zones(), min_size=1, max_size=4))
def test_room_closes_no_way_that_was_open(given_zones: list[FloatArray]) -> None:
    ground = Polygon(AREA_M).difference(shapely.union_all([Polygon(zone) for zone in given_zones]))
    left = ground.difference(shapely.union_all([Polygon(wide) for wide in room_around(AREA_M, given_zones, ROOM_M)]))
    pieces = [piece for piece in getattr(left, "geoms", [left]) if piece.area >= 1.0]
    for part in getattr(ground, "geoms", [ground]):
        if part.area >= 1.0:
            assert sum(part.intersects(piece.representative_point()) for piece in pieces) == 1


def test_a_gap_that_is_narrower_than_the_room_stays_open() -> None:
    constraints = limits(box(0.0, 45.0, 48.0, 55.0), box(50.0, 45.0, SIDE_M, 55.0))
    way = FreeSpace(constraints.for_plans, 0.0).way(np.array([49.0, 20.0]), np.array([49.0, 80.0]))
    corners = np.vstack([[49.0, 20.0], way])
    assert not any(enters_zone(constraints, a, b) for a, b in pairwise(corners))


def test_limits_without_zones_are_the_same_for_plans() -> None:
    constraints = limits()
    assert constraints.for_plans is constraints
    assert constraints.for_checks is constraints


def test_what_plans_keep_to_is_worked_out_once_and_knows_what_is_checked() -> None:
    constraints = limits(box(40.0, 40.0, 60.0, 60.0))
    assert constraints.for_plans is constraints.for_plans
    assert constraints.for_plans.for_checks is constraints


def zoned(planner: str, **changes: Any) -> MissionSpec:
    return make_spec(
        SIDE_M,
        **changes,
        keep_out=[rectangle(45, 45, 60, 60)],
        limits={"max_step_m": 12.0, "max_depth_m": 20.0, "keep_out_margin_m": 5.0},
        planner={"name": planner, "options": {"candidates": 20, "search": 100} if planner == "cao" else {}},
    )


@pytest.mark.parametrize("planner", ["cao", "lawnmower"])
def test_no_leg_of_a_survey_is_barred_from_where_a_vehicle_may_begin_it(planner: str) -> None:
    spec = zoned(planner)
    constraints, chooser = make_constraints(spec), make_planner(spec)
    rng, here_m, barred, past = np.random.default_rng(0), np.array([2.0, 2.0]), 0, 0
    heading = math.nan
    around = Polygon(constraints.keep_out[-1]).buffer(12.0)
    for number in range(1, 41):
        at = Place("a", here_m, heading, 2.0, left_m=(41 - number) * 12.0)
        decision = decide(number, spec, constraints, chooser, [at], Knowledge(belief_of(), np.zeros((0, 2))))
        if decision.done:
            break  # its lines are flown
        [leg] = decision.legs
        end_m = leg.target_m[:2]
        course = rng.uniform(0.0, 2 * np.pi, 12)
        begins_m = here_m + spec.arrival_radius_m * np.column_stack([np.cos(course), np.sin(course)])
        past += LineString([here_m, end_m]).intersects(around)
        barred += any(enters_zone(constraints, begin_m, end_m) for begin_m in begins_m)
        heading = float(np.arctan2(*(end_m - here_m))) if np.hypot(*(end_m - here_m)) > 1e-6 else heading
        here_m = end_m
    assert past > 3
    assert barred == 0


def test_a_vehicle_that_is_in_the_room_or_in_the_margin_gets_a_leg() -> None:
    limits_of = {"max_step_m": 12.0, "max_depth_m": 20.0, "keep_out_margin_m": 5.0}
    zone = rectangle(25, 25, 35, 35)
    for east_m in (18.0, 22.0):
        decision, wishes, _ = decide_for(
            [place("a", east_m, 30.0)], [[10.0, 30.0, 2.0]], keep_out=[zone], limits=limits_of
        )
        [leg] = decision.legs
        assert not leg.refusal
        np.testing.assert_allclose(leg.target_m[:2], [10.0, 30.0])
        assert len(wishes.asked[0].constraints.keep_out) == 3


@pytest.mark.parametrize("planner", ["cao", "lawnmower", "random"])
@pytest.mark.parametrize("east_m", [38.0, 41.0, 46.0], ids=["room", "margin", "zone"])
@pytest.mark.parametrize("has_flown_all", [False, True])
def test_who_waits_too_near_to_a_zone_keeps_nobody_from_its_leg(
    planner: str, east_m: float, has_flown_all: bool
) -> None:
    vehicles = [{"name": name, "kind": "sim"} for name in "ab"]
    spec = zoned(planner, vehicles=vehicles)
    chooser = make_planner(spec)
    constraints = limits_of_decisions(make_constraints(spec), chooser)
    flies, waits = np.array([5.0, 5.0]), np.array([east_m, 50.0])
    team = [
        Place("a", flies, math.nan, 2.0, left_m=400.0),
        Place("b", waits, math.nan, 4.0, left_m=1e-3 if has_flown_all else 400.0, moving=has_flown_all),
    ]
    decision = decide(1, spec, constraints, chooser, team, Knowledge(belief_of(), np.zeros((0, 2))))
    ends = {leg.vehicle: leg.target_m[:2] for leg in decision.legs if not leg.refusal}
    assert np.hypot(*(ends["a"] - flies)) > 1.0
    assert np.allclose(ends.get("b", waits), waits, atol=0.01)
    assert np.array_equal(decision.origin_m["b"], waits)


def test_what_is_proposed_within_the_room_is_flown() -> None:
    limits_of = {"max_step_m": 12.0, "max_depth_m": 20.0, "keep_out_margin_m": 5.0}
    decision, *_ = decide_for(
        [place("a", 10.0, 30.0)], [[19.0, 30.0, 2.0]], keep_out=[rectangle(25, 25, 35, 35)], limits=limits_of
    )
    np.testing.assert_allclose(decision.legs[0].target_m[:2], [19.0, 30.0])
