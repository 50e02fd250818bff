"""Lines at the distance and on the course that are asked for, and who of the team flies them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.core.routes import Turns, Vehicles
from app.exploration.lines.lattice import axes_of, direction_of_lines_rad, flown_length
from app.exploration.lines.spaced_lines import check_line_count, spaced_lines, with_crosslines
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner

MARGIN_M = 0.5
WIDTH, HEIGHT = 120.0, 300.0
AREA = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]])
TEAM = np.array([[20.0, 290.0], [60.0, 150.0], [100.0, 150.0]])


def lines_for(
    constraints: Constraints, spacing_m: float, budgets_m: FloatArray, heading_deg: float = 0.0, radius_m: float = 0.0
) -> list[FloatArray]:
    starts = TEAM[: len(budgets_m)]
    vehicles = Vehicles(starts, np.full(len(starts), np.nan), budgets_m)
    direction_rad = direction_of_lines_rad(constraints.area, heading_deg)
    lines = spaced_lines(
        constraints, MARGIN_M, direction_rad, spacing_m, vehicles, [Turns(radius_m, 0.0)] * len(starts)
    )
    assert lines.left_out_m == 0.0
    return lines.routes


def across_m(routes: list[FloatArray], heading_deg: float) -> tuple[FloatArray, FloatArray]:
    """Return where each leg that lies along the lines is across them, and how long it is."""
    axes = axes_of(np.radians(90.0 - heading_deg))
    legs = [np.stack([route[:-1], route[1:]], axis=1) @ axes.T for route in routes if len(route) > 1]
    along = np.concatenate([leg[np.abs(np.diff(leg[..., 0], axis=1)[:, 0]) < 1e-6] for leg in legs])
    return along[:, 0, 0], np.abs(np.diff(along[..., 1], axis=1)[:, 0])


@given(spacing_m=st.floats(3.0, 110.0), heading_deg=st.floats(0.0, 359.0), count=st.integers(1, 3))
@settings(max_examples=25, deadline=None)
def test_lines_lie_on_the_course_and_at_the_distance_asked_for_and_none_is_left_out_or_flown_twice(
    spacing_m: float, heading_deg: float, count: int
) -> None:
    routes = lines_for(Constraints(AREA), spacing_m, np.full(count, 2000.0), heading_deg)
    u, length_m = across_m(routes, heading_deg)
    [places, which] = np.unique(np.round(u, 6), return_inverse=True)
    # Beside a border lines may be closer: on it nothing can be flown.
    assert np.diff(places) == pytest.approx(np.full(len(places) - 1, spacing_m), rel=2 * MARGIN_M / spacing_m)
    assert (np.diff(places) <= spacing_m + 1e-4).all()
    borders = AREA @ axes_of(np.radians(90.0 - heading_deg))[0]
    # A line through the very corner of an area that lies askew has no length.
    assert places[0] - borders.min() <= 0.55 * spacing_m + spacing_m * (heading_deg % 90.0 != 0.0)
    inner = Polygon(AREA).buffer(-MARGIN_M, join_style="mitre")
    for k, place in enumerate(places):
        ends = np.array([[place, -500.0], [place, 500.0]]) @ axes_of(np.radians(90.0 - heading_deg))
        whole_m = inner.intersection(LineString(ends)).length
        assert length_m[which == k].sum() == pytest.approx(whole_m, abs=1e-3)


@pytest.mark.parametrize("budget_m", [400.0, 3000.0, 60_000.0])
@pytest.mark.parametrize("spacing_m", [5.0, 17.0, 40.0])
def test_all_need_about_the_same_share_of_what_they_can_fly(spacing_m: float, budget_m: float) -> None:
    budgets_m = budget_m * np.array([2.5, 1.0, 1.0])
    routes = lines_for(Constraints(AREA), spacing_m, budgets_m, radius_m=4.0)
    flown_m = np.array([flown_length(at, way, 4.0) for at, way in zip(TEAM, routes, strict=True)])
    line_m = HEIGHT + spacing_m
    assert np.ptp(flown_m / budgets_m) * budget_m <= 1.5 * line_m


def test_lines_keep_off_zones() -> None:
    zone = np.array([[40.0, 100.0], [80.0, 100.0], [80.0, 200.0], [40.0, 200.0]])
    routes = lines_for(Constraints(AREA, (zone,)), 15.0, np.full(2, 5000.0))
    for route in routes:
        assert not LineString(route).intersects(Polygon(zone))
    u, length_m = across_m(routes, 0.0)
    assert length_m[(u > 40.0) & (u < 80.0)].sum() == pytest.approx(2 * 199.0, abs=5.0)


@pytest.mark.parametrize(("length_m", "count"), [(10.0, 1), (250.0, 2), (600.0, 5)])
def test_crosslines_lie_across_all_others_and_go_to_who_is_done_first(length_m: float, count: int) -> None:
    budgets_m = np.array([6000.0, 3000.0, 3000.0])
    routes = lines_for(Constraints(AREA), 30.0, budgets_m)
    vehicles = Vehicles(TEAM, np.full(3, np.nan), budgets_m)
    longer = with_crosslines(Constraints(AREA), MARGIN_M, np.pi / 2, length_m, vehicles, routes)
    for before, after in zip(routes, longer, strict=True):
        assert np.array_equal(after[: len(before)], before)
    v, across = across_m([after[len(before) :] for before, after in zip(routes, longer, strict=True)], 90.0)
    assert len(v) == count
    assert across == pytest.approx(np.full(count, WIDTH - 2 * MARGIN_M), abs=0.01)
    assert np.ptp(np.diff(np.sort(v))) < 1e-6 if count > 1 else True, "evenly"
    needs = [flown_length(at, way, 0.0) / left for at, way, left in zip(TEAM, longer, budgets_m, strict=True)]
    assert max(needs) - min(needs) < (HEIGHT + 2 * WIDTH) / 3000.0


BAR = np.array([[-10.0, 140.0], [WIDTH + 10.0, 140.0], [WIDTH + 10.0, 160.0], [-10.0, 160.0]])
"""A zone that cuts the area in two."""
PART_M = 140.0 - 2 * MARGIN_M


def test_crosslines_are_flown_on_each_side_of_a_zone_that_cuts_the_area() -> None:
    constraints, vehicles = Constraints(AREA, (BAR,)), Vehicles(TEAM, np.full(3, np.nan), np.full(3, 5000.0))
    starts = np.array([[20.0, 20.0], [60.0, 100.0], [60.0, 280.0]])
    vehicles = vehicles._replace(en_m=starts)
    none = [np.zeros((0, 2))] * 3
    ways = with_crosslines(constraints, MARGIN_M, np.pi / 2, 50.0, vehicles, none)
    flown = [LineString(np.vstack([at, way])) for at, way in zip(starts, ways, strict=True) if len(way)]
    assert len(flown) == 2
    assert not any(line.intersects(Polygon(BAR)) for line in flown)


def test_lines_in_a_part_where_nobody_is_are_counted_as_left_out() -> None:
    vehicles = Vehicles(np.array([[20.0, 20.0]]), np.full(1, np.nan), np.full(1, 9000.0))
    lines = spaced_lines(Constraints(AREA, (BAR,)), MARGIN_M, np.pi / 2, 20.0, vehicles, [Turns(0.0, 0.0)])
    assert lines.left_out_m == pytest.approx(6 * PART_M, rel=0.02)
    _, length_m = across_m(lines.routes, 0.0)
    assert length_m.sum() == pytest.approx(6 * PART_M, rel=0.01)


def test_a_vehicle_that_can_fly_nothing_does_not_bring_the_others_lines_closer() -> None:
    starts = np.array([[20.0, 20.0], [60.0, 280.0]])
    vehicles = Vehicles(starts, np.full(2, np.nan), np.array([0.0, 30_000.0]))
    lines = spaced_lines(Constraints(AREA, (BAR,)), MARGIN_M, np.pi / 2, 60.0, vehicles, [Turns(0.0, 0.0)] * 2)
    _, length_m = across_m(lines.routes, 0.0)
    assert length_m.sum() == pytest.approx(2 * PART_M, rel=0.01)
    assert lines.left_out_m == pytest.approx(2 * PART_M, rel=0.02)


def test_more_lines_than_a_survey_can_have_are_refused_with_the_least_distance() -> None:
    area = AREA * 20.0
    with pytest.raises(ValueError, match=r"0\.5 m makes 4800 lines .* 2400 m wide.* give at least 1\.2 m"):
        check_line_count(area, np.pi / 2, 0.5)
    check_line_count(area, np.pi / 2, 1.2)


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
    )


def fly(
    options: PlannerOptions,
    starts: dict[str, tuple[float, float]],
    lost: str = "",
    lost_at: int = 0,
    zones: tuple[FloatArray, ...] = (),
) -> tuple[float, int, float]:
    """Let a team fly until all are done; return the length of the lines flown, the rounds, and what is left."""
    planner, rng = create_planner("lawnmower", options), np.random.default_rng(0)
    here = {name: np.array(start) for name, start in starts.items()}
    flown: list[LineString] = []
    for rounds in range(200):
        if rounds == lost_at:
            here.pop(lost, None)
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
        planner = create_planner("lawnmower", options)
        planner.restore(memory)
    assert proposal.done == frozenset(present), "they do not fly for ever"
    assert not any(leg.intersects(Polygon(zone)) for leg in flown for zone in zones)
    ways = [np.diff(np.array(leg.coords), axis=0)[0] for leg in flown]
    along_m = sum(float(np.hypot(*way)) for way in ways if abs(way[1]) > 5.0 * abs(way[0]))
    return along_m, rounds, planner.lines_left_m()


SOUTH, MIDDLE, NORTH = (20.0, 20.0), (60.0, 100.0), (60.0, 280.0)


@pytest.mark.parametrize("starts", [{"a": SOUTH, "b": NORTH}, {"a": NORTH, "b": SOUTH}])
def test_lines_on_both_sides_of_a_zone_are_flown_by_those_who_are_there(starts: dict[str, tuple[float, float]]) -> None:
    """Who was done took lines of the other that it could not reach, and these were lost."""
    options = PlannerOptions(line_spacing_m=10.0, line_heading_deg=0.0)
    length_m, _, left_m = fly(options, starts, zones=(BAR,))
    assert length_m >= 2 * 12 * PART_M - 20.0
    assert left_m == 0.0


def test_lines_that_only_a_vehicle_that_is_lost_could_reach_are_told() -> None:
    options = PlannerOptions(line_spacing_m=20.0, line_heading_deg=0.0)
    length_m, _, left_m = fly(options, {"a": SOUTH, "b": NORTH}, lost="b", lost_at=2, zones=(BAR,))
    assert length_m >= 6 * PART_M - 20.0
    assert left_m > 3 * PART_M


def test_a_survey_at_a_distance_ends_when_its_lines_are_flown_though_there_is_way_left() -> None:
    options = PlannerOptions(line_spacing_m=20.0, line_heading_deg=0.0)
    length_m, _, left_m = fly(options, {"a": MIDDLE, "b": NORTH})
    assert left_m == 0.0
    # The ways to where lines begin may lie along them, too.
    assert 6 * (HEIGHT - 1.0) - 10.0 <= length_m <= 6 * HEIGHT + 2 * HEIGHT


def test_the_lines_of_who_is_lost_are_flown_and_shared() -> None:
    options = PlannerOptions(line_spacing_m=10.0, line_heading_deg=0.0)
    length_m, rounds, left_m = fly(options, {"a": SOUTH, "b": MIDDLE, "c": NORTH}, lost="b", lost_at=4)
    assert left_m == 0.0
    assert length_m >= 12 * (HEIGHT - 1.0) - 60.0
    _, alone, _ = fly(options, {"a": SOUTH})
    assert rounds < 0.75 * alone, "whoever is done takes a part of what is left to another"


def test_lines_that_are_only_given_a_course_lie_on_it() -> None:
    planner = create_planner("lawnmower", PlannerOptions(line_heading_deg=60.0))
    told = situation(TEAM, np.full(3, 900.0), ("a", "b", "c"))
    planner.propose(replace(told, turns_take_way=False), np.random.default_rng(0))
    routes = [route for route in planner.ways_ahead_m().values() if len(route) > 3]
    assert routes
    _, length_m = across_m(routes, 60.0)
    ways_m = sum(float(np.hypot(*np.diff(route, axis=0).T).sum()) for route in routes)
    assert length_m.sum() > 0.6 * ways_m
