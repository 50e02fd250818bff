"""Nothing that breaks a limit is sent to a vehicle."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapely.geometry import LineString, Point, Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Proposal, Situation
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.safety import room, tide_and_bottom, travel_depth, waypoint_check
from app.missions.task.constraints import make_constraints
from tests.support.missions.decisions import Wishes, belief_of, decide_for, place
from tests.support.missions.specs import lon_lat, make_spec, rectangle

AREA = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 60.0], [0.0, 60.0]])
KEEP_OUT = np.array([[20.0, 20.0], [30.0, 20.0], [30.0, 30.0], [20.0, 30.0]])
LIMITS = Constraints(
    AREA,
    (KEEP_OUT,),
    max_step_m=12.0,
    max_depth_m=20.0,
    min_altitude_m=1.0,
    com_range_m=50.0,
    min_separation_m=4.0,
    min_vertical_separation_m=1.0,
)


def slope() -> Bottom:
    """Three to nine metres deep from west to east."""
    east, north = np.meshgrid(np.arange(1.0, 60.0, 2.0), np.arange(1.0, 60.0, 2.0))
    return Bottom.from_landmarks(np.column_stack([east.ravel(), north.ravel()]), 3.0 + east.ravel() / 10.0)


BOTTOM = slope()
NAMES = ("a", "b", "c")


def origins() -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([[10.0, 10.0, 1.0], [40.0, 10.0, 1.0], [10.0, 45.0, 1.0]])


metres = st.floats(-80, 140) | st.just(math.nan) | st.just(math.inf)
moves = st.lists(st.tuples(metres, metres, st.floats(-3, 30) | st.just(math.nan)), min_size=3, max_size=3)


@settings(deadline=None, max_examples=100)
@given(moves)
def test_whatever_is_proposed_what_comes_out_breaks_no_limit(rows: list[tuple[float, float, float]]) -> None:
    origin = origins()
    proposed = np.array(rows)
    checked = waypoint_check.check_step(NAMES, origin, proposed, LIMITS, BOTTOM)
    assert np.isfinite(checked.positions).all()
    final = checked.positions.copy()
    for name in checked.refusals:
        final[NAMES.index(name)] = origin[NAMES.index(name)]
    broken = {v.vehicle for v in LIMITS.violations(NAMES, origin, final, BOTTOM)}
    assert broken <= set(checked.refusals)
    for i, name in enumerate(NAMES):
        if name in checked.refusals or name in checked.corrections:
            assert (checked.refusals | checked.corrections)[name]
        else:
            np.testing.assert_array_equal(checked.positions[i], proposed[i])
        if name in checked.corrections:
            np.testing.assert_array_equal(checked.positions[i], origin[i])


@settings(deadline=None, max_examples=100)
@given(moves)
def test_checked_waypoints_keep_the_limits_by_plain_geometry(rows: list[tuple[float, float, float]]) -> None:
    origin = origins()
    checked = waypoint_check.check_step(NAMES, origin, np.array(rows), LIMITS, BOTTOM)
    area, zone = Polygon(AREA), Polygon(KEEP_OUT)
    sent = [i for i, name in enumerate(NAMES) if name not in checked.refusals]
    for i in sent:
        leg = LineString([origin[i, :2], checked.positions[i, :2]])
        assert area.buffer(1e-5).covers(leg)
        assert not zone.buffer(-1e-5).intersects(leg)
        assert np.linalg.norm(checked.positions[i] - origin[i]) <= LIMITS.max_step_m + 1e-5
        assert -1e-5 <= checked.positions[i, 2] <= LIMITS.max_depth_m + 1e-5
    for i in sent:
        for k in sent:
            here, there = checked.positions[i], checked.positions[k]
            if k > i and abs(here[2] - there[2]) < LIMITS.min_vertical_separation_m:
                assert np.linalg.norm(here[:2] - there[:2]) >= LIMITS.min_separation_m - 1e-5


def test_a_proposal_that_is_no_place_makes_the_vehicle_hold() -> None:
    proposed = origins()
    proposed[1] = math.nan
    checked = waypoint_check.check_step(NAMES, origins(), proposed, LIMITS, BOTTOM)
    np.testing.assert_array_equal(checked.positions[1], origins()[1])
    assert "which is no place; the vehicle holds" in checked.corrections["b"]
    assert checked.refusals == {}


def test_holding_one_vehicle_makes_another_hold_that_would_have_passed_it() -> None:
    origin = np.array([[10.0, 10.0, 1.0], [18.0, 10.0, 1.0]])
    proposed = np.array([[30.0, 10.0, 1.0], [12.0, 10.0, 1.0]])  # too far; and to where the first stays
    checked = waypoint_check.check_step(("a", "b"), origin, proposed, LIMITS, BOTTOM)
    np.testing.assert_array_equal(checked.positions, origin)
    assert set(checked.corrections) == {"a", "b"}


def test_a_vehicle_that_cannot_even_hold_gets_no_waypoint() -> None:
    aground = np.array([[10.0, 10.0, 3.5]])  # half a metre above a bottom of four metres
    checked = waypoint_check.check_step(("a",), aground, aground + np.array([0.0, 5.0, 0.2]), LIMITS, BOTTOM)
    assert "clearance" in checked.refusals["a"]
    assert checked.corrections == {}


@settings(deadline=None)
@given(
    st.tuples(st.floats(1, 58), st.floats(1, 58)),
    st.tuples(st.floats(1, 58), st.floats(1, 58)),
    st.floats(0, 15),
    st.floats(0, 5),
)
def test_depth_of_travel_is_as_wanted_or_leaves_the_clearance(
    start: tuple[float, float], end: tuple[float, float], wanted_m: float, clearance_m: float
) -> None:
    depth = travel_depth.travel_depth_m(np.array(start), np.array(end), wanted_m, BOTTOM, clearance_m)
    assert 0.0 <= depth <= wanted_m
    along = np.linspace(0, 1, travel_depth.LEG_SAMPLES)[:, None] * (np.array(end) - start) + start
    shallowest = np.nanmin(BOTTOM.at(along))
    assert depth == pytest.approx(min(wanted_m, max(0.0, shallowest - clearance_m)))


@settings(deadline=None)
@given(
    st.tuples(st.floats(-20, 78), st.floats(1, 58)),
    st.tuples(st.floats(-20, 78), st.floats(1, 58)),
    st.floats(0.5, 15),
    st.floats(0, 5),
)
def test_a_height_above_the_bottom_is_kept_or_more(
    start: tuple[float, float], end: tuple[float, float], altitude_m: float, clearance_m: float
) -> None:
    limits = replace(LIMITS, min_altitude_m=clearance_m, max_depth_m=7.0)
    depth = travel_depth.depth_above_bottom_m(np.array(start), np.array(end), altitude_m, 2.0, BOTTOM, limits)

    def deepest_m(samples: int) -> float:
        below = BOTTOM.at(np.linspace(0, 1, samples)[:, None] * (np.array(end) - start) + start)
        wanted_m = 7.0 if np.isfinite(below).all() else 2.0
        known = below[np.isfinite(below)]
        return min(wanted_m, max(float(known.min()) - max(altitude_m, clearance_m), 0.0) if len(known) else math.inf)

    assert depth <= deepest_m(travel_depth.LEG_SAMPLES) + 1e-9
    assert depth >= deepest_m(3001) - 1e-9


@given(st.tuples(st.floats(20, 40), st.floats(20, 40)), st.floats(0, 2 * math.pi), st.floats(1, 8), st.floats(0.5, 4))
def test_a_vehicle_that_keeps_a_height_can_turn_anywhere_after_its_leg(
    end: tuple[float, float], course_rad: float, radius_m: float, altitude_m: float
) -> None:
    start = np.array(end) - 10.0 * np.array([math.sin(course_rad), math.cos(course_rad)])
    limits = replace(LIMITS, max_depth_m=7.0)
    depth = travel_depth.depth_above_bottom_m(start, np.array(end), altitude_m, 2.0, BOTTOM, limits, radius_m)
    for side in (1.0, -1.0):
        turned = np.linspace(0.0, math.pi, 30)
        ahead, aside = radius_m * np.sin(turned), side * radius_m * (1.0 - np.cos(turned))
        arc = np.column_stack(
            [
                end[0] + ahead * math.sin(course_rad) + aside * math.cos(course_rad),
                end[1] + ahead * math.cos(course_rad) - aside * math.sin(course_rad),
            ]
        )
        room = BOTTOM.at(arc) - max(altitude_m, limits.min_altitude_m)
        # It rises while it turns; bottom cells are 2 m wide, and 0.2 m apart in depth.
        low = room + travel_depth.CLIMB * radius_m * turned + 0.25 < depth
        assert not low[room > 0.0].any()


def test_over_an_unknown_bottom_the_wanted_depth_counts() -> None:
    assert travel_depth.travel_depth_m(np.zeros(2), np.ones(2), 4.0, Bottom.unknown(), 2.0) == 4.0


def test_a_vehicle_goes_as_deep_as_its_height_above_the_bottom_asks_where_the_bottom_is_known() -> None:
    # 9 m deep, give or take 0.5 m: 8 m are sure.
    low = replace(place("low", 10.0, 10.0), altitude_m=3.0)
    lowest = replace(place("lowest", 30.0, 30.0), altitude_m=0.2)
    decision, *_ = decide_for([low, lowest], [[20.0, 10.0, 2.0], [40.0, 30.0, 2.0]])
    assert {leg.vehicle: leg.target_m[2] for leg in decision.legs} == {
        "low": pytest.approx(5.0),
        "lowest": pytest.approx(7.0),  # limits.min_altitude_m
    }
    unknown = belief_of(depth_m=math.nan)
    decision, *_ = decide_for([low], [[20.0, 10.0, 2.0]], unknown)
    assert [leg.target_m[2] for leg in decision.legs] == [2.0]


# Decisions


def test_waypoints_are_as_proposed_at_each_vehicles_depth() -> None:
    decision, planner, _ = decide_for(
        [place("a", 10, 10), place("b", 40, 40, 3.0)], [[15.0, 12.0, 99.0], [42.0, 45.0, 99.0]]
    )
    np.testing.assert_allclose([leg.target_m for leg in decision.legs], [[15, 12, 2.0], [42, 45, 3.0]])
    assert [leg.refusal for leg in decision.legs] == ["", ""]
    assert (decision.objective, decision.terms, decision.memory, decision.notes) == (0.5, {"gain": 1.0}, b"memory", [])
    (situation,) = planner.asked
    assert (situation.step, situation.vehicles) == (1, ("a", "b"))


def test_the_bottom_is_taken_to_be_shallower_than_estimated() -> None:
    decision, _, _ = decide_for([place("a", 10, 10, 5.0)], [[12.0, 12.0, 5.0]], belief_of(6.0, 0.75))
    assert decision.legs[0].target_m[2] == pytest.approx(6.0 - 2 * 0.75 - 1.0)


@pytest.mark.parametrize(("water_level_m", "room_m"), [(-0.8, 5.2), (0.0, 6.0), (3.0, 6.0)])
def test_water_below_the_datum_leaves_less_room_and_water_above_it_is_not_relied_on(
    water_level_m: float, room_m: float
) -> None:
    decision, _, _ = decide_for([place("a", 10, 10, 5.0)], [[12.0, 12.0, 5.0]], belief_of(6.0, 0.75), water_level_m)
    assert decision.legs[0].target_m[2] == pytest.approx(room_m - 2 * 0.75 - 1.0)
    assert decision.bottom.at(np.array([12.0, 12.0])) == pytest.approx(room_m - 2 * 0.75)


@settings(deadline=None, max_examples=50)
@given(arrays(np.float64, (15, 15), elements=st.floats(1.5, 12.0)), st.floats(0.0, 2.0 * math.pi), st.booleans())
def test_no_wall_keeps_a_vehicle_where_its_last_leg_ended(depth_m: FloatArray, course: float, low: bool) -> None:
    """It comes so high that it can rise over whatever is ahead, and its next leg is flown, whichever that is."""
    known = belief_of()
    known = replace(known, depth_m=depth_m.ravel(), sd_m=np.full(depth_m.size, 0.05))
    altitude_m = 2.0 if low else math.nan
    flier = replace(place("a", 30.0, 30.0, 5.0), altitude_m=altitude_m, turn_radius_m=5.2)
    wish = [30.0 + 9.0 * math.sin(course), 30.0 + 9.0 * math.cos(course), 5.0]
    decision, *_ = decide_for([flier], [wish], known)
    assert decision.notes == []
    np.testing.assert_allclose(decision.legs[0].target_m[:2], wish[:2])
    floor = decision.bottom
    along = np.linspace(0.0, 1.0, 9)[:, None] * (np.array(wish[:2]) - 30.0) + 30.0
    room_m = floor.at(along).min() - make_spec().limits.min_altitude_m
    assert decision.legs[0].target_m[2] <= max(room_m, 0.0) + 1e-9


def with_shoal(east_m: float, north_m: float, radius_m: float, depth_m: float = 0.6) -> Belief:
    """A floor of nine metres with a shoal on it."""
    known = belief_of()
    away = np.hypot(*(known.xy_m - [east_m, north_m]).T)
    return replace(known, depth_m=np.where(away < radius_m, depth_m, 9.0), sd_m=np.full(len(away), 0.05))


@pytest.mark.parametrize("moving", [True, False], ids=["gets a leg", "gets none now"])
def test_who_is_over_ground_too_shoal_leaves_it_at_the_surface_and_keeps_nobody_else_from_its_leg(moving: bool) -> None:
    """Every leg off it began over the same ground, which none may lead over: it stayed, and others with it."""
    places = [replace(place("a", 30, 30), moving=moving), place("b", 8, 50)]
    wishes = [[34.0, 30.0, 2.0], [16.0, 50.0, 2.0]]
    decision, planner, spec = decide_for(places, wishes, with_shoal(30, 30, 11.0))
    legs = {leg.vehicle: leg for leg in decision.legs}
    np.testing.assert_allclose(legs["b"].target_m[:2], [16.0, 50.0])
    [asked] = planner.asked
    assert asked.vehicles == ("a", "b"), "it keeps its share of the plan"
    assert asked.moves.tolist() == [False, True]
    if not moving:
        assert "a" not in legs
        return
    assert legs["a"].refusal == ""
    assert legs["a"].target_m[2] == 0.0
    end = legs["a"].target_m[:2]
    assert np.hypot(*(end - 30.0)) > 11.0
    assert Polygon(spec.local_area()).covers(Point(end))
    assert decision.notes == [
        "a: the bottom is 0.6 m below the surface there, and 1 m are needed; it leaves for deeper ground at the surface"
    ]


def test_the_way_off_a_shoal_is_over_ground_that_is_no_shoaler_and_off_zones() -> None:
    known = with_shoal(30, 30, 11.0)
    dry = (known.xy_m[:, 0] > 30.0) & (known.depth_m < 1.0)
    bank = rectangle(24, 42, 60, 46)
    decision, *_, spec = decide_for(
        [place("a", 30, 38)],
        [[30.0, 38.0, 0.0]],
        replace(known, depth_m=np.where(dry, 0.1, known.depth_m)),
        keep_out=[bank],
    )
    [leg] = decision.legs
    way = LineString([(30.0, 38.0), tuple(leg.target_m[:2])])
    assert way.distance(Polygon(spec.to_local(spec.keep_out[0]))) > 1.0
    middle = np.array(way.interpolate(0.5, normalized=True).coords[0])
    assert middle[0] < 30.0


def test_who_is_afloat_is_not_sent_over_ground_that_is_drier_than_where_it_is() -> None:
    known = with_shoal(30, 30, 13.0, -0.2)
    here = np.hypot(*(known.xy_m - 30.0).T) < 4.0
    ring = replace(known, depth_m=np.where(here, 0.3, known.depth_m))
    decision, *_ = decide_for([place("a", 30, 30)], [[0.0] * 3], ring)
    [leg] = decision.legs
    assert "every way off leads over dry ground or is barred" in leg.refusal
    # Where the map has it all dry there is water all the same.
    flat, *_ = decide_for([place("a", 30, 30)], [[30.0, 30.0, 0.0]], with_shoal(30, 30, 13.0, -0.2))
    [leg] = flat.legs
    assert leg.refusal == ""


@pytest.mark.parametrize("at", [(27.0, 32.0), (26.0, 33.0), (28.0, 34.0), (24.0, 33.0), (27.0, 36.0)])
def test_the_way_off_a_shoal_does_not_lead_across_a_notch_of_the_area(at: tuple[float, float]) -> None:
    """It was given, refused as it was to begin, and given again at once."""
    area = [(0, 0), (60, 0), (60, 60), (31, 60), (31, 31), (29, 31), (29, 60), (0, 60)]
    decision, *_, spec = decide_for(
        [place("a", *at)],
        [[*at, 0.0]],
        with_shoal(22, 40, 14.0),
        area={"type": "Polygon", "coordinates": [[list(lon_lat(*corner)) for corner in [*area, area[0]]]]},
    )
    [leg] = decision.legs
    assert leg.refusal == ""
    assert Polygon(spec.local_area()).buffer(1e-3).covers(LineString([at, tuple(leg.target_m[:2])]))


def test_the_way_off_a_shoal_keeps_off_other_vehicles_and_leads_wherever_there_is_water() -> None:
    west = with_shoal(30, 30, 13.0)
    dry = (west.xy_m[:, 0] < 30.0) & (west.depth_m < 1.0)
    known = replace(west, depth_m=np.where(dry, -0.5, west.depth_m))
    others = [place("b", 40.0, 31.0)]
    decision, *_ = decide_for([place("a", 33, 30), *others], [[0.0, 0.0, 0.0], [40.0, 31.0, 2.0]], known)
    leg = next(leg for leg in decision.legs if leg.vehicle == "a")
    assert leg.refusal == ""
    way = LineString([(33.0, 30.0), tuple(leg.target_m[:2])])
    assert way.distance(Point(40.0, 31.0)) >= 5.0 - 1e-6


def test_who_finds_no_way_off_a_shoal_keeps_its_lines() -> None:
    known = with_shoal(30, 30, 13.0, -0.2)
    here = np.hypot(*(known.xy_m - 30.0).T) < 4.0
    ring_m = replace(known, depth_m=np.where(here, 0.3, known.depth_m))
    decision, planner, _ = decide_for([place("a", 30, 30), place("b", 8, 50)], [[0.0] * 3, [16.0, 50.0, 2.0]], ring_m)
    [asked] = planner.asked
    assert asked.vehicles == ("a", "b")
    assert {leg.vehicle: bool(leg.refusal) for leg in decision.legs} == {"a": True, "b": False}


def test_planners_are_told_of_the_bottom_below_the_surface_as_it_is_now() -> None:
    """They planned over ground that low water had made too shoal, and vehicles held there."""
    for level_m, depth_m in ((-3.0, 6.0), (2.0, 9.0)):
        _, planner, _ = decide_for([place("a", 10, 10)], [[16.0, 10.0, 2.0]], water_level_m=level_m)
        np.testing.assert_allclose(planner.asked[0].belief.depth_m, depth_m)


def test_a_proposal_of_nan_holds_and_is_told() -> None:
    decision, _, _ = decide_for([place("a", 10, 10)], [[math.nan, 12.0, 2.0]])
    np.testing.assert_allclose(decision.legs[0].target_m, [10, 10, 2.0])
    assert "the vehicle holds" in decision.notes[0]


def test_a_leg_into_a_keep_out_zone_is_not_flown() -> None:
    decision, _, _ = decide_for([place("a", 15, 25)], [[24.0, 25.0, 2.0]], keep_out=[rectangle(20, 20, 30, 30)])
    np.testing.assert_allclose(decision.legs[0].target_m[:2], [15, 25])
    assert "keep-out" in decision.notes[0]


def test_a_vehicle_just_outside_is_planned_for_from_the_border() -> None:
    decision, planner, _ = decide_for([place("a", -5, 30)], [[6.0, 30.0, 2.0]])
    np.testing.assert_allclose(planner.asked[0].positions[0, :2], [0, 30], atol=0.05)
    np.testing.assert_allclose(decision.legs[0].target_m[:2], [6, 30])


def test_a_vehicle_far_outside_comes_at_the_surface_and_is_not_planned_for() -> None:
    decision, planner, _ = decide_for([place("a", -100, 30), place("b", 30, 30)], [[33.0, 30.0, 2.0]])
    by_name = {leg.vehicle: leg for leg in decision.legs}
    np.testing.assert_allclose(by_name["a"].target_m, [1.0, 30.0, 0.0], atol=0.05)
    assert planner.asked[0].vehicles == ("b",)
    assert "a is 100 m outside the area" in decision.notes[0]


def test_without_anyone_to_plan_for_the_planner_is_not_asked() -> None:
    decision, planner, _ = decide_for([place("a", -100, 30)], [])
    assert planner.asked == []
    assert (decision.objective, decision.memory) == (None, b"memory")


def test_the_way_in_goes_round_keep_out_zones() -> None:
    quay = rectangle(-5, 10, 8, 60)  # along the western border, open in the south
    decision, _, spec = decide_for([place("a", -40, 35)], [], keep_out=[quay], limits={"keep_out_margin_m": 1.0})
    (leg,) = decision.legs
    assert leg.refusal == ""
    zone, area = Polygon(spec.to_local(spec.keep_out[0])), Polygon(spec.local_area())
    way = LineString([(-40.0, 35.0), tuple(leg.target_m[:2])])
    assert area.covers(Point(leg.target_m[:2]))
    assert way.distance(zone) > 0


@pytest.mark.parametrize("north_m", [26.0, 30.0, 33.0])
@pytest.mark.parametrize("off_m", [0.0, 3.4])
def test_a_vehicle_behind_a_zone_that_bars_every_straight_way_in_comes_round_it(north_m: float, off_m: float) -> None:
    """It stayed behind it. ``off_m``: so far from where it is sent it arrives, on the side of the zone."""
    wall = rectangle(-30, 12, -20, 48)
    at, zone, legs = np.array([-40.0, north_m]), None, []
    for _ in range(8):
        decision, _, spec = decide_for(
            [place("a", *at)], [], keep_out=[wall], limits={"keep_out_margin_m": 2.0, "max_step_m": 12.0}
        )
        (leg,) = decision.legs
        assert leg.refusal == ""
        assert leg.unplanned
        assert leg.target_m[2] == 0.0
        zone, area = Polygon(spec.to_local(spec.keep_out[0])), Polygon(spec.local_area())
        legs.append(LineString([at, leg.target_m[:2]]))
        assert np.linalg.norm(leg.target_m[:2] - at) > 17.0, "it drifts to what is closer"
        way = leg.target_m[:2] - np.array(zone.centroid.coords[0])
        at = leg.target_m[:2] - off_m * way / np.linalg.norm(way)
        if area.contains(Point(leg.target_m[:2])):
            break
    assert area.contains(Point(legs[-1].coords[-1]))
    assert min(leg.distance(zone) for leg in legs) > 1.99
    assert (
        "sent round a keep-out zone"
        in decide_for(
            [place("a", -40, north_m)], [], keep_out=[wall], limits={"keep_out_margin_m": 2.0, "max_step_m": 12.0}
        )[0].notes[0]
    )


@pytest.mark.parametrize("east_m", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("zone_north_m", [30, 24, 18])
def test_a_vehicle_outside_comes_in_beside_the_margin_of_a_zone_at_the_border(east_m: float, zone_north_m: int) -> None:
    """It was planned for from the border there, got no leg, as that may not end in a margin, and stayed outside."""
    rocks = rectangle(6, zone_north_m - 6, 16, zone_north_m + 6)
    limits = {"keep_out_margin_m": 8.0, "max_step_m": 10.0}
    at = np.array([east_m, 30.0])
    for _ in range(4):
        comes = place("a", *at)
        wish = at + np.array([8.0, 0.0])
        decision, _, spec = decide_for([comes], [[*wish, 2.0]], keep_out=[rocks], limits=limits)
        (leg,) = decision.legs
        assert not leg.refusal, decision.notes
        end, zone = leg.target_m[:2], Polygon(spec.to_local(spec.keep_out[0]))
        assert zone.distance(LineString([at, end])) >= 0.85 * min(zone.distance(Point(at)), 8.0)
        at = end
        if Polygon(spec.local_area()).covers(Point(end)) and zone.distance(Point(end)) > 7.99:
            return
    pytest.fail("it did not come in")


def test_a_vehicle_beyond_a_zone_close_to_the_border_is_not_planned_for_from_there() -> None:
    """It was within ten metres of the border, and its leg would have led through the zone."""
    quay = rectangle(-6, 20, -4, 40)
    decision, planner, spec = decide_for([place("a", -9, 30)], [], keep_out=[quay], limits={"keep_out_margin_m": 1.0})
    assert planner.asked == []
    (leg,) = decision.legs
    assert leg.unplanned
    zone = Polygon(spec.to_local(spec.keep_out[0]))
    assert LineString([(-9.0, 30.0), tuple(leg.target_m[:2])]).distance(zone) > 0.9


def test_a_vehicle_without_a_way_in_stays_where_it_is() -> None:
    decision, _, _ = decide_for([place("a", -40, 35)], [], keep_out=[rectangle(-5, -500, 8, 500)])
    (leg,) = decision.legs
    assert "keep-out" in leg.refusal


def test_vehicles_that_come_in_together_are_sent_apart() -> None:
    decision, _, spec = decide_for([place(n, -40, 30 + i) for i, n in enumerate("abc")], [])
    goals = [leg.target_m[:2] for leg in decision.legs]
    for i, goal in enumerate(goals):
        for other in goals[:i]:
            assert np.linalg.norm(goal - other) >= spec.limits.min_separation_m


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.floats(-60, 120), st.floats(-60, 120)), min_size=1, max_size=3),
    st.lists(st.tuples(metres, metres, metres), min_size=3, max_size=3),
    st.floats(1.5, 12.0),
)
def test_no_decision_breaks_a_limit_wherever_the_vehicles_are(
    there: list[tuple[float, float]], wishes: list[tuple[float, float, float]], depth_m: float
) -> None:
    places = [place("abc"[i], *en, 1.0 + i) for i, en in enumerate(there)]
    spec = make_spec(60.0, keep_out=[rectangle(20, 20, 30, 30)], limits={"max_step_m": 12.0, "max_depth_m": 20.0})
    constraints = make_constraints(spec)
    area, zone = Polygon(constraints.area), Polygon(constraints.keep_out[0])

    class Team(Wishes):
        def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
            return Proposal(np.array(wishes[: len(situation.vehicles)]), 0.0)

    decision = decide(1, spec, constraints, Team([]), places, Knowledge(belief_of(depth_m), np.zeros((0, 2))))
    assert sorted(leg.vehicle for leg in decision.legs) == [p.vehicle for p in places]
    for leg in decision.legs:
        if leg.refusal:
            continue
        start = next(p.en_m for p in places if p.vehicle == leg.vehicle)
        assert np.isfinite(leg.target_m).all()
        assert area.buffer(1e-3).covers(Point(leg.target_m[:2]))
        if not zone.buffer(1e-3).contains(Point(start)):
            assert not zone.buffer(-1e-3).intersects(LineString([start, leg.target_m[:2]]))
        assert 0.0 <= leg.target_m[2] <= max(0.0, depth_m - 2 * 0.5 - 1.0) + 1e-6


def test_legs_keep_a_margin_from_keep_out_zones_which_a_vehicle_inside_it_may_only_leave() -> None:
    spec = make_spec(60.0, keep_out=[rectangle(20, 20, 40, 40)], limits={"keep_out_margin_m": 5.0})
    constraints = make_constraints(spec)
    clear, near, within = 14.0, 17.0, 21.0

    def allowed(start: tuple[float, float], end: tuple[float, float]) -> bool:
        origin = np.array([[*start, 2.0]])
        return bool(constraints.feasible(origin, np.array([[[*end, 2.0]]]))[0])

    assert allowed((clear, 28.0), (clear, 33.0))
    assert not allowed((clear, 28.0), (near, 28.0))
    assert not allowed((near, 28.0), (near + 1.0, 28.0))
    assert not allowed((near, 28.0), (within, 28.0))
    assert allowed((near, 28.0), (clear, 28.0))
    assert allowed((near, 28.0), (near - 0.5, 28.0))
    # Out of the margin, but across the zone's corner.
    assert not allowed((19.0, 36.0), (22.0, 44.0))


def test_without_a_margin_legs_may_pass_along_a_zone() -> None:
    spec = make_spec(60.0, keep_out=[rectangle(20, 20, 40, 40)], limits={"keep_out_margin_m": 0.0})
    constraints = make_constraints(spec)
    assert len(constraints.keep_out) == 1
    assert constraints.feasible(np.array([[19.5, 28.0, 2.0]]), np.array([[[19.5, 33.0, 2.0]]]))[0]


def test_a_circle_lies_inside_clear_of_keep_outs_and_apart_from_others() -> None:
    start, target, radius = np.array([45.0, 5.0]), np.array([50.0, 12.0]), 8.0
    centre = room.circling_room(LIMITS, start, target, radius, [np.array([[40.0, 30.0], [30.0, 40.0]])])
    assert centre is not None
    circle = Point(centre).buffer(radius - 0.1)
    assert Polygon(AREA).contains(circle)
    assert not Polygon(KEEP_OUT).intersects(circle)
    assert LineString([[40.0, 30.0], [30.0, 40.0]]).distance(circle) >= LIMITS.min_separation_m
    assert Point(target).distance(Point(centre)) <= 2.5 * radius


@pytest.mark.parametrize(
    ("start", "target", "radius", "taken"),
    [
        ((10.0, 24.0), (16.0, 25.0), 40.0, []),
        ((16.0, 12.0), (25.0, 16.0), 12.0, [[[40.0, 5.0], [40.0, 55.0]], [[5.0, 40.0], [55.0, 40.0]]]),
        ((50.0, 12.0), (50.0, 20.0), 8.0, [[[50.0, 20.0]], [[44.0, 8.0], [44.0, 50.0]], [[52.0, 2.0], [52.0, 50.0]]]),
    ],
    ids=["area", "keep-out and others", "others"],
)
def test_where_there_is_no_room_for_a_circle_none_is_given(
    start: tuple[float, float], target: tuple[float, float], radius: float, taken: list[list[list[float]]]
) -> None:
    ways = [np.array(way) for way in taken]
    assert room.circling_room(LIMITS, np.array(start), np.array(target), radius, ways) is None


@pytest.mark.parametrize(
    ("water_level_m", "below_m"), [(0.0, 10.0), (-1.5, 8.5), (2.0, 10.0)], ids=["datum", "low water", "high water"]
)
def test_depths_below_the_surface_are_on_the_safe_side(water_level_m: float, below_m: float) -> None:
    assert tide_and_bottom.below_surface_m(np.array([10.0]), water_level_m) == pytest.approx(below_m)
