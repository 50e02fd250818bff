"""The lines of a plan that is given: flown once each, within the area and off its zones, and shared out fairly."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.problem import Belief, Situation
from app.exploration.core.routes import Turns, Vehicles
from app.exploration.lines.given_lines import GivenLine, GivenSurvey, LinePlan, given_survey
from app.exploration.lines.lattice import flown_length
from app.exploration.lines.lawnmower import LawnmowerPlanner
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner

MARGIN_M = 0.5
WIDTH, HEIGHT = 120.0, 300.0
AREA = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]])
TEAM = np.array([[20.0, 290.0], [60.0, 150.0], [100.0, 150.0]])
ZONE = np.array([[40.0, 100.0], [80.0, 100.0], [80.0, 200.0], [40.0, 200.0]])
BAR = np.array([[-10.0, 140.0], [WIDTH + 10.0, 140.0], [WIDTH + 10.0, 160.0], [-10.0, 160.0]])
"""A zone that cuts the area in two."""


def line(name: str, *corners: tuple[float, float], keep_direction: bool = False) -> GivenLine:
    return GivenLine(name, np.array(corners, dtype=float), keep_direction)


def numbered(count: int, *, keep_direction: bool = False) -> list[GivenLine]:
    at = np.linspace(10.0, WIDTH - 10.0, count)
    return [line(f"{101 + k}", (e, 20.0), (e, 280.0), keep_direction=keep_direction) for k, e in enumerate(at)]


def survey(
    lines: list[GivenLine],
    budgets_m: FloatArray,
    zones: tuple[FloatArray, ...] = (),
    *,
    starts: FloatArray = TEAM,
    radius_m: float = 0.0,
    in_order: bool = False,
) -> GivenSurvey:
    starts = starts[: len(budgets_m)]
    vehicles = Vehicles(starts, np.full(len(starts), np.nan), budgets_m)
    turns = [Turns(radius_m, 0.0)] * len(starts)
    return given_survey(Constraints(AREA, zones), MARGIN_M, LinePlan(lines), vehicles, turns, in_order=in_order)


def flyable_m(lines: list[GivenLine], zones: tuple[FloatArray, ...] = ()) -> dict[str, float]:
    region = FreeSpace(Constraints(AREA, zones), MARGIN_M).region
    found = {one.name: LineString(one.en_m).intersection(region).length for one in lines}
    return {name: length for name, length in found.items() if length > 1.0}


places = st.tuples(st.floats(-40.0, 160.0), st.floats(-40.0, 340.0))


@pytest.mark.slow
@given(
    corners=st.lists(st.lists(places, min_size=2, max_size=5), min_size=1, max_size=14),
    count=st.integers(1, 3),
    zoned=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_what_lies_in_the_area_is_flown_and_nothing_leaves_it_or_enters_a_zone(
    corners: list[list[tuple[float, float]]], count: int, zoned: bool
) -> None:
    lines, zones = [line(str(k), *one) for k, one in enumerate(corners)], (ZONE,) if zoned else ()
    starts = np.array([[20.0, 20.0], [20.0, 150.0], [100.0, 280.0]])
    found = survey(lines, np.full(count, 5000.0), zones, starts=starts)
    free = FreeSpace(Constraints(AREA, zones), MARGIN_M).region
    ways = [np.vstack([at, way]) for at, way in zip(starts, found.routes, strict=False)]
    for way in ways:
        assert free.buffer(1e-3).covers(LineString(way)) if len(way) > 1 else True
    flown = shapely.union_all([LineString(way) for way in ways if len(way) > 1]).buffer(0.3)
    for one in lines:
        pieces = [piece for piece in one.within(free) if len(piece)]
        assert all(flown.covers(LineString(piece)) for piece in pieces), one.name
    assert found.left_out == []


@given(count=st.integers(1, 20), team=st.integers(1, 3))
@settings(max_examples=20, deadline=None)
def test_no_line_is_flown_twice(count: int, team: int) -> None:
    lines = numbered(count)
    plan = LinePlan(lines)
    on_m = plan.metres_on(survey(lines, np.full(team, 1e5)).routes)
    ways_m = sum(
        float(np.hypot(*np.diff(way, axis=0).T).sum()) for way in survey(lines, np.full(team, 1e5)).routes if len(way)
    )
    assert on_m == pytest.approx(dict.fromkeys((one.name for one in lines), 260.0))
    assert ways_m < count * 260.0 + WIDTH + 2.0 * HEIGHT


@pytest.mark.parametrize("budget_m", [400.0, 3000.0, 60_000.0])
@pytest.mark.parametrize("count", [2, 7, 24])
def test_all_need_about_the_same_share_of_what_they_can_fly(count: int, budget_m: float) -> None:
    budgets_m = budget_m * np.array([2.5, 1.0, 1.0])
    found = survey(numbered(count), budgets_m, radius_m=4.0)
    flown_m = np.array([flown_length(at, way, 4.0) for at, way in zip(TEAM, found.routes, strict=True)])
    assert np.ptp(flown_m / budgets_m) * budget_m <= 1.5 * 300.0


def test_each_vehicle_flies_whole_lines_where_there_are_many() -> None:
    found = survey(numbered(12), np.full(3, 5000.0))
    ends = {(round(float(e), 3), round(float(n), 3)) for way in found.routes for e, n in way}
    assert ends == {(round(float(one.en_m[k, 0]), 3), one.en_m[k, 1]) for one in numbered(12) for k in (0, 1)}


def test_lines_that_keep_their_direction_are_flown_in_it() -> None:
    found = survey(numbered(6, keep_direction=True), np.full(2, 5000.0))
    legs = [leg for way in found.routes for leg in np.stack([way[:-1], way[1:]], axis=1)]
    along = [leg for leg in legs if abs(leg[1, 0] - leg[0, 0]) < 1e-6]
    assert sum(float(leg[1, 1] - leg[0, 1]) for leg in along) == pytest.approx(6 * 260.0)
    assert all(leg[1, 1] > leg[0, 1] for leg in along)


def test_the_order_of_the_plan_is_kept_where_that_is_asked_for() -> None:
    lines = [numbered(8)[k] for k in (3, 0, 6, 1, 7, 2, 5, 4)]
    found = survey(lines, np.full(1, 50_000.0), in_order=True)
    way, plan = found.routes[0], LinePlan(lines)
    numbers = plan.numbers_of(np.stack([way[:-1], way[1:]], axis=1))
    assert [int(k) for k in numbers if k >= 0] == list(range(8))
    free = survey(lines, np.full(1, 50_000.0))
    assert flown_length(TEAM[0], free.routes[0], 0.0) < 0.9 * flown_length(TEAM[0], way, 0.0)


def test_a_polyline_is_flown_from_vertex_to_vertex() -> None:
    channel = line("channel", (10.0, 20.0), (40.0, 90.0), (35.0, 160.0), (90.0, 280.0))
    [way] = survey([channel], np.full(1, 5000.0), starts=np.array([[12.0, 15.0]])).routes
    assert way == pytest.approx(channel.en_m)


def test_a_line_that_leaves_the_area_or_crosses_a_zone_is_flown_in_pieces_round_what_lies_between() -> None:
    crossing = line("7", (60.0, -50.0), (60.0, 350.0))
    [way] = survey([crossing], np.full(1, 5000.0), (ZONE,), starts=np.array([[60.0, 10.0]])).routes
    on_m = LinePlan([crossing]).metres_on([way])
    assert on_m["7"] == pytest.approx(2 * (100.0 - MARGIN_M - 2 * MARGIN_M), abs=0.1)
    assert not LineString(way).intersects(Polygon(ZONE))
    assert flyable_m([crossing], (ZONE,)) == pytest.approx(on_m, abs=0.1)


def test_a_line_that_crosses_itself_or_comes_back_keeps_its_order() -> None:
    loop = line("loop", (20.0, 50.0), (100.0, 150.0), (100.0, 50.0), (20.0, 150.0), (-30.0, 150.0), (20.0, 250.0))
    region = FreeSpace(Constraints(AREA), MARGIN_M).region
    first, second = loop.within(region)
    assert first[:4] == pytest.approx(loop.en_m[:4])
    assert second[-1] == pytest.approx(loop.en_m[-1])
    assert first[-1, 0] == pytest.approx(MARGIN_M)


def test_lines_where_nobody_is_are_left_out_by_name() -> None:
    lines = [line("south", (10.0, 20.0), (110.0, 20.0)), line("both", (60.0, 20.0), (60.0, 280.0))]
    lines.append(line("north", (10.0, 280.0), (110.0, 280.0)))
    found = survey(lines, np.full(1, 9000.0), (BAR,), starts=np.array([[20.0, 20.0]]))
    assert LinePlan(lines).metres_on(found.left_out) == pytest.approx({"both": 119.0, "north": 100.0}, abs=0.1)
    assert LinePlan(lines).metres_on(found.routes) == pytest.approx({"south": 100.0, "both": 119.0}, abs=0.1)


def test_a_way_beside_or_across_a_line_does_not_lie_on_it() -> None:
    plan = LinePlan([line("a", (0.0, 0.0), (0.0, 100.0)), line("b", (2.5, 0.0), (2.5, 100.0))])
    legs = [[[0, 10], [0, 60]], [[2.5, 0], [2.5, 9]], [[0, 100], [2.5, 100]], [[-50, 50], [50, 50]], [[9, 0], [9, 99]]]
    assert plan.numbers_of(np.array(legs, dtype=float)).tolist() == [0, 1, -1, -1, -1]
    drifted = np.array([[[1.0, 40.0], [0.0, 100.0]]])
    assert plan.numbers_of(drifted).tolist() == [0], "whoever left its line and comes back is not exactly on it"


def situation(
    places: FloatArray, left_m: FloatArray, present: tuple[str, ...], zones: tuple[FloatArray, ...] = ()
) -> Situation:
    belief = Belief(np.array([[60.0, 150.0]]), np.array([20.0]), np.array([1.0]), np.zeros(1, bool), np.ones(1), 10.0)
    return Situation(
        step=1,
        steps_total=10,
        vehicles=present,
        positions=np.column_stack([places, np.full(len(places), 2.0)]),
        headings_rad=np.zeros(len(places)),
        soundings_en_m=np.zeros((0, 2)),
        belief=belief,
        constraints=Constraints(AREA, zones, max_step_m=60.0, max_depth_m=10.0),
        left_m=left_m,
        crosslines=0.05,
    )


def planner_of(lines: list[GivenLine], *, keep_line_order: bool = False) -> LawnmowerPlanner:
    planner = create_planner("lawnmower", PlannerOptions(keep_line_order=keep_line_order))
    assert isinstance(planner, LawnmowerPlanner)
    planner.take_lines(lines)
    return planner


def fly(
    lines: list[GivenLine],
    starts: dict[str, tuple[float, float]],
    lost: str = "",
    lost_at: int = 0,
    zones: tuple[FloatArray, ...] = (),
) -> tuple[list[LineString], int, dict[str, float]]:
    """Let a team fly until all are done; return the legs that it flew, the rounds, and what is left."""
    planner, rng = planner_of(lines), np.random.default_rng(0)
    here = {name: np.array(start) for name, start in starts.items()}
    flown: list[LineString] = []
    for rounds in range(200):
        if rounds == lost_at and lost:
            # As missions say of whoever leaves its line.
            planner.put_back(lost, np.zeros((0, 2)), here.pop(lost))
        present = tuple(here)
        told = situation(np.array(list(here.values())), np.full(len(here), 1e4), present, zones)
        proposal = planner.propose(told, rng)
        for name, end in zip(present, proposal.positions[:, :2], strict=True):
            if np.hypot(*(end - here[name])) > 1e-3:
                flown.append(LineString([here[name], end]))
            here[name] = end
        if proposal.done == frozenset(present):
            break
        memory = planner.snapshot()
        planner = planner_of(lines)
        planner.restore(memory)
    assert proposal.done == frozenset(present), "they do not fly for ever"
    return flown, rounds, planner.lines_left()


def on_lines_m(lines: list[GivenLine], flown: list[LineString]) -> dict[str, float]:
    return LinePlan(lines).metres_on([np.array(leg.coords) for leg in flown])


SOUTH, MIDDLE, NORTH = (20.0, 20.0), (60.0, 100.0), (60.0, 280.0)


def test_a_survey_of_given_lines_ends_when_they_are_flown_though_there_is_way_left() -> None:
    flown, _, left = fly(numbered(9), {"a": MIDDLE, "b": NORTH})
    assert left == {}
    assert on_lines_m(numbered(9), flown) == pytest.approx({one.name: 260.0 for one in numbered(9)}, abs=1.0)
    assert sum(leg.length for leg in flown) < 9 * 260.0 + 2 * HEIGHT + WIDTH, "no crosslines, and none flown twice"


@pytest.mark.parametrize("keep_direction", [False, True])
def test_the_lines_of_who_is_lost_are_flown_and_shared(keep_direction: bool) -> None:
    lines = numbered(12, keep_direction=keep_direction)
    flown, rounds, left = fly(lines, {"a": SOUTH, "b": MIDDLE, "c": NORTH}, lost="b", lost_at=4)
    assert left == {}
    assert on_lines_m(lines, flown) == pytest.approx({one.name: 260.0 for one in lines}, abs=1.0)
    _, alone, _ = fly(lines, {"a": SOUTH})
    assert rounds < 0.75 * alone, "whoever is done takes a part of what is left to another"
    if keep_direction:
        legs = [np.array(leg.coords) for leg in flown]
        assert all(leg[1, 1] > leg[0, 1] for leg in legs if abs(leg[1, 0] - leg[0, 0]) < 1e-3)


def test_lines_that_only_a_vehicle_that_is_lost_could_reach_are_told_by_name() -> None:
    _, _, left = fly(numbered(6), {"a": SOUTH, "b": NORTH}, lost="b", lost_at=2, zones=(BAR,))
    assert set(left) <= {one.name for one in numbered(6)}
    assert len(left) >= 4
    assert all(length_m == pytest.approx(119.5, abs=1.0) for length_m in list(left.values())[1:-1])


def test_a_line_is_left_out_by_an_order_with_all_its_bends() -> None:
    bent = line("bent", (10.0, 20.0), (10.0, 100.0), (90.0, 100.0), (90.0, 20.0))
    lines = [bent, line("next", (90.0, 200.0), (10.0, 200.0))]
    planner = planner_of(lines, keep_line_order=True)
    told = situation(np.array([[10.0, 20.0]]), np.full(1, 5000.0), ("a",))
    proposal = planner.propose(told, np.random.default_rng(0))
    assert planner.skip_line("a", np.array([10.0, 20.0]), proposal.positions[0, :2])
    assert planner.lines_left() == pytest.approx({"next": 80.0}, abs=0.1)
    assert planner.skip_line("a", np.array([10.0, 100.0]), np.array([10.0, 100.0]))
    assert planner.lines_left() == {}
    assert not planner.skip_line("a", np.array([10.0, 100.0]), np.array([10.0, 100.0]))


def test_of_two_lines_that_lie_on_each_other_each_is_flown_and_left_out_by_itself() -> None:
    lines = [line("slow", (50.0, 20.0), (50.0, 280.0)), line("fast", (50.0, 20.0), (50.0, 280.0))]
    plan = LinePlan([*lines, line("next", (80.0, 20.0), (80.0, 280.0))])
    way = np.array([[50.0, 20.0], [50.0, 280.0], [50.0, 20.0], [80.0, 20.0], [80.0, 280.0]])
    assert plan.metres_on([way]) == pytest.approx({"slow": 260.0, "fast": 260.0, "next": 260.0})
    rest = plan.after_line(way[0], np.array([50.0, 100.0]), way[1:])
    assert rest is not None
    np.testing.assert_array_equal(rest, way[2:])


def test_a_newcomer_takes_half_of_what_is_left() -> None:
    planner = planner_of(numbered(8))
    rng = np.random.default_rng(0)
    told = situation(np.array([SOUTH]), np.full(1, 1e4), ("a",))
    here = planner.propose(told, rng).positions[0, :2]
    both = replace(situation(np.array([here, NORTH]), np.full(2, 1e4), ("a", "b")))
    planner.propose(both, rng)
    ways = planner.ways_ahead_m()
    own = [sum(LinePlan(numbered(8)).metres_on([ways[name]]).values()) for name in "ab"]
    assert min(own) > 2.5 * 260.0
