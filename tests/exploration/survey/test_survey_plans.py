from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.estimation import SingleBeam
from app.evaluation.survey.world import SurveyScenario, fly_planner
from app.exploration.core.constraints import Constraints
from app.exploration.core.routes import CORNER_TOLERANCE, Turns, Vehicles, flown_m, next_waypoint, turn_m
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.exploration.survey.backbone import backbone, packed
from app.exploration.survey.error import MOST_DOUBTS, SECOND_LOOK, with_second_looks
from app.exploration.survey.local_search import DRAWS, PlanSearch, ViaPoints, improve, warm_up
from app.exploration.survey.value import SurveyObjective, lower_to_route, lower_to_segment, make_nodes, plan_value
from simulator.floors.seafloors import generate
from tests.support.exploration.situations import make_belief, make_situation

NO_TURNS = Turns(0.0, 0.0)
SQUARE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]])
coordinate = st.floats(0.0, 100.0)


def nodes_of(seed: int = 0, n: int = 400) -> Any:
    rng = np.random.default_rng(seed)
    return make_nodes(rng.uniform(0.0, 100.0, (n, 2)), rng.gamma(1.0, 1.0, n))


def distance_to_segment(points: Any, a: Any, b: FloatArray) -> Any:
    along = b - a
    t = np.clip((points - a) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    return np.hypot(*(points - a - t[:, None] * along).T)


@settings(max_examples=50, deadline=None)
@given(coordinate, coordinate, coordinate, coordinate, st.floats(1.0, 150.0))
def test_nodes_within_reach_of_a_leg_get_their_distance_to_it(ax: Any, ay: Any, bx: Any, by: Any, reach: Any) -> None:
    nodes = nodes_of()
    d2 = np.full(len(nodes.x), np.inf)
    lower_to_segment(d2, nodes, ax, ay, bx, by, reach)
    true = distance_to_segment(nodes.en_m, np.array([ax, ay]), np.array([bx, by]))
    near = true <= reach
    np.testing.assert_allclose(np.sqrt(d2[near]), true[near], atol=1e-6)
    assert (np.sqrt(d2[~near]) >= reach - 1e-6).all()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=30), st.integers(0, 100))
def test_among_soundings_legs_lower_what_they_lower_without_knowing_how_far_those_are(sounded: Any, seed: int) -> None:
    nodes = nodes_of(seed)
    to_soundings = np.asarray(cKDTree(np.array(sounded)).query(nodes.en_m)[0]) ** 2
    plain, knowing = to_soundings.copy(), to_soundings.copy()
    for ax, ay, bx, by in np.random.default_rng(seed).uniform(0.0, 100.0, (10, 4)):
        lower_to_segment(plain, nodes, ax, ay, bx, by, 300.0)
        lower_to_segment(knowing, nodes.sounded(to_soundings), ax, ay, bx, by, 300.0)
    np.testing.assert_array_equal(knowing, plain)


@dataclass(frozen=True)
class WithZone(SurveyScenario):
    """A survey round keep-out zones."""

    zones: tuple[np.ndarray, ...] = ()

    @property
    def constraints(self) -> Constraints:
        return replace(super().constraints, keep_out=self.zones)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
@example(16163, 3)  # the route turns back through where a leg begins
def test_a_route_is_flown_leg_by_leg_to_its_end_and_no_farther_than_it_is_long(seed: int, corners: Any) -> None:
    rng = np.random.default_rng(seed)
    route, step = rng.uniform(0.0, 100.0, (corners, 2)), rng.uniform(0.5, 12.0)
    length = flown_m(3.0, 4.0, np.nan, route, NO_TURNS)
    x, y, first, flown = 3.0, 4.0, 0, 0.0
    while first < len(route):
        nx, ny, first = next_waypoint(x, y, route, first, len(route), step, CORNER_TOLERANCE)
        flown += float(np.hypot(nx - x, ny - y))
        assert np.hypot(nx - x, ny - y) <= step * (1 + 1e-9)
        x, y = nx, ny
    np.testing.assert_allclose([x, y], route[-1], atol=1e-6)
    assert length - 0.5 * corners * step <= flown <= length + 1e-6


@pytest.mark.parametrize(
    ("spacing", "least", "most"), [(0.1, 6.9, 7.2), (1.0, 4.2, 5.1), (2.0, 1.1, 1.2), (9.0, 1.1, 1.2)]
)
def test_turning_round_to_a_near_line_costs_what_a_dubins_path_does(spacing: float, least: float, most: float) -> None:
    right_angle = 0.5 * np.pi
    first = turn_m(right_angle, 0.0, 50.0, Turns(1.0, 0.0))
    second = turn_m(right_angle, right_angle, spacing, Turns(1.0, 0.0))
    assert least <= first + second <= most
    other_way = turn_m(-right_angle, right_angle, spacing, Turns(1.0, 0.0))
    assert other_way == pytest.approx(first) == pytest.approx(right_angle - 1.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1.0, 400.0), st.floats(0.0, 5.0))
def test_a_route_is_worth_what_lies_along_the_metres_that_a_vehicle_has_left(seed: int, left: Any, radius: Any) -> None:
    rng = np.random.default_rng(seed)
    nodes, route, start = nodes_of(seed), rng.uniform(0.0, 100.0, (4, 2)), np.array([3.0, 4.0])
    objective = SurveyObjective(15.0, 2.0, Turns(radius, 0.0), 200.0)
    d2 = np.full(len(nodes.x), np.inf)
    rest = lower_to_route(d2, nodes, objective, start, np.nan, left, route, len(route))
    whole = flown_m(3.0, 4.0, np.nan, route, objective.turns)
    assert rest == pytest.approx(max(0.0, left - whole), abs=1e-6)
    corners = np.vstack([start, route])
    legs = np.hypot(*np.diff(corners, axis=0).T)
    flown = np.full(len(nodes.x), np.inf)
    if radius == 0.0 or left >= whole:
        at = np.concatenate([[0.0], np.cumsum(legs)])
        ends = np.unique(np.append(at[at < left], min(left, at[-1])))
        cut = np.column_stack([np.interp(ends, at, corners[:, k]) for k in (0, 1)])
        for a, b in pairwise(cut):
            flown = np.minimum(flown, distance_to_segment(nodes.en_m, a, b))
        np.testing.assert_allclose(np.sqrt(d2), flown, atol=1e-6)


def test_vertices_close_together_are_flown_in_one_leg() -> None:
    arc = np.array([[0.0, 8.0], [0.02, 8.05], [0.06, 8.1], [0.12, 8.14], [0.2, 8.16], [30.0, 8.16]])
    x, y, first = next_waypoint(0.0, 0.0, arc, 0, len(arc), 10.0, CORNER_TOLERANCE)
    assert (x, y, first) == pytest.approx((0.2, 8.16, 5))
    x, y, first = next_waypoint(0.0, 0.0, arc, 0, len(arc), 10.0, 0.0)
    assert (x, y, first) == (0.0, 8.0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["cao", "lawnmower"])
def test_vehicles_do_not_linger_at_the_corners_of_a_keep_out_zone(planner: Any) -> None:
    zone = np.array([[40.0, 30.0], [70.0, 30.0], [70.0, 60.0], [40.0, 60.0]])
    terrain = generate("flat", 1)
    scenario = WithZone(terrain, 2, 100, 10.0, "step", zones=(zone,))
    track = fly_planner(scenario, planner, PlannerOptions(search=200))
    legs = np.linalg.norm(np.diff(track.positions_m, axis=0), axis=2)
    inside = (track.positions_m[..., 0] > 40) & (track.positions_m[..., 0] < 70)
    inside &= (track.positions_m[..., 1] > 30) & (track.positions_m[..., 1] < 60)
    assert not inside.any()
    assert (legs < 0.5).sum() <= 4  # a team gives way now and then; a rounded corner took a step every 5 cm
    assert np.median(legs) > 9.0


def test_searching_never_worsens_a_plan_and_says_truly_what_it_is_worth() -> None:
    nodes = nodes_of(1)
    starts, headings = np.array([[2.0, 2.0], [7.0, 2.0]]), np.full(2, np.nan)
    vehicles = Vehicles(starts, headings, np.array([300.0, 250.0]))
    objective = SurveyObjective(15.0, 2.0, Turns(2.0, 0.0), 60.0)
    d2 = np.full(len(nodes.x), np.inf)
    vias = np.zeros((2, 40, 2))
    vias[:, :2] = [[[20.0, 90.0], [40.0, 10.0]], [[70.0, 90.0], [90.0, 10.0]]]
    counts, locked = np.array([2, 2]), np.array([1, 0])
    before = plan_value(d2, nodes, objective, vehicles, vias, counts)
    draws = np.random.default_rng(0).random((1500, DRAWS))
    search = PlanSearch(5.0, Constraints(SQUARE).region, 0.5, 0.01)
    after, after_counts, value = improve(d2, nodes, objective, vehicles, ViaPoints(vias, counts, locked), search, draws)
    assert value < 0.9 * before
    assert value == pytest.approx(plan_value(d2, nodes, objective, vehicles, after, after_counts))
    np.testing.assert_array_equal(after[0, 0], vias[0, 0])
    for j in range(2):
        route = after[j, : after_counts[j]]
        assert ((route >= 0.5 - 1e-9) & (route <= 99.5 + 1e-9)).all()


@pytest.mark.slow
def test_what_improves_plans_is_compiled_before_a_mission_needs_it() -> None:
    warm_up()
    compiled = set(improve.signatures)
    fly_planner(SurveyScenario(generate("reef", 1), 2, 60, 10.0, "step"), "cao", PlannerOptions(search=50))
    assert set(improve.signatures) == compiled


def test_doubted_soundings_raise_the_weight_around_them_unless_they_are_many() -> None:
    situation = make_situation(soundings=np.random.default_rng(0).uniform(0.0, 100.0, (1000, 2)))
    even = np.ones(len(situation.belief.xy_m))
    few, many = (np.random.default_rng(1).uniform(0.0, 100.0, (n, 2)) for n in (3, int(3000 * MOST_DOUBTS)))
    raised = with_second_looks(even, replace(situation, doubtful_en_m=few), 10.0)
    near = cKDTree(few).query(situation.belief.xy_m)[0] <= 6.0
    assert near.any()
    np.testing.assert_array_equal(raised, np.where(near, SECOND_LOOK, 1.0))
    np.testing.assert_array_equal(with_second_looks(even, replace(situation, doubtful_en_m=many), 10.0), even)
    np.testing.assert_array_equal(with_second_looks(even, situation, 10.0), even)


def closest_m(place: np.ndarray, *, doubted: bool) -> float:
    """Fly a survey of a flat floor; return how close its legs come to a place that is doubted from step six on."""
    situation = make_situation()
    xy, positions = situation.belief.xy_m, situation.positions
    planner, rng = create_planner("cao", PlannerOptions(search=400), SingleBeam(0.01)), np.random.default_rng(0)
    sounded, closest = positions[:, :2], np.inf
    for step in range(1, situation.steps_total + 1):
        away = np.asarray(cKDTree(sounded).query(xy)[0])
        belief = replace(
            situation.belief, depth_m=np.full(len(xy), 12.0), sd_m=0.05 + 0.02 * away, weight=np.ones(len(xy))
        )
        doubtful = place[None] if doubted and step > 5 else np.zeros((0, 2))
        now = replace(
            situation, step=step, positions=positions, belief=belief, soundings_en_m=sounded, doubtful_en_m=doubtful
        )
        after = planner.propose(now, rng).positions
        for a, b in zip(positions[:, :2], after[:, :2], strict=True):
            sounded = np.vstack([sounded, np.linspace(a, b, 9)])
            closest = min(closest, float(distance_to_segment(place[None], a, b)[0]))
        positions = after
    return closest


def test_a_doubted_sounding_is_looked_at_again() -> None:
    place = np.array([29.0, 50.0])  # between two lines
    assert closest_m(place, doubted=False) > 2.5
    assert closest_m(place, doubted=True) < 1.5


def test_every_vehicle_flies_the_metres_that_it_has_left_and_no_more() -> None:
    situation = make_situation()
    planner, rng = create_planner("cao", PlannerOptions(search=200), SingleBeam(0.01)), np.random.default_rng(0)
    positions, names = situation.positions, situation.vehicles
    left: FloatArray = 150.0 * np.arange(1.0, len(names) + 1.0) + 0.3
    sounded = positions[:, :2]
    for step in range(1, 200):
        moving = left > 0.1
        if not moving.any():
            break
        now = replace(
            situation, step=step, positions=positions, soundings_en_m=sounded, moving=moving, left_m=left.copy()
        )
        after = planner.propose(now, rng).positions
        np.testing.assert_array_equal(after[~moving], positions[~moving])
        left = left - np.asarray(np.linalg.norm(after - positions, axis=1), dtype=np.float64)
        assert (left > -1e-6).all()
        sounded, positions = np.vstack([sounded, after[:, :2]]), after
    assert (left < 25.0).all()


@pytest.mark.slow
def test_ground_that_gave_no_echo_is_not_flown_over_again() -> None:
    floor = generate("reef", 1)
    hole = floor.z_m.copy()
    hole[55:, 55:] = np.nan
    scenario = SurveyScenario(replace(floor, z_m=hole), 2, 80, 10.0)
    track = fly_planner(scenario, "cao", PlannerOptions(search=1000))
    legs = np.hypot(*np.moveaxis(np.diff(track.positions_m[..., :2], axis=0), 2, 0))
    middles = 0.5 * (track.positions_m[1:, :, :2] + track.positions_m[:-1, :, :2])
    inside = (middles > 58.0).all(axis=2)
    assert (legs * inside).sum() < 0.24 * legs.sum()  # about what the even lines take; 0.28 when it is forgotten


@pytest.mark.parametrize("left", [(400.0, 400.0), (700.0, 700.0), (500.0, 1900.0)])
def test_the_backbone_is_as_long_as_each_vehicle_can_fly(left: tuple[float, float]) -> None:
    vehicles = Vehicles(np.array([[2.0, 2.0], [7.0, 2.0]]), np.full(2, np.nan), np.array(left))
    nodes = nodes_of(2)
    objective = SurveyObjective(20.0, 2.0, Turns(3.0, 0.0), 1e6)
    shares = backbone(Constraints(SQUARE, max_step_m=10.0), vehicles, nodes, objective)
    lengths = np.array(
        [
            flown_m(x, y, np.nan, share.stops, objective.turns)
            for (x, y), share in zip(vehicles.en_m, shares, strict=True)
        ]
    )
    assert (lengths <= 1.4 * np.array(left)).all()  # one line more, of which a part is flown
    assert lengths.sum() > 0.75 * sum(left)
    vias, counts = packed([share.stops for share in shares])
    far = np.full(len(nodes.x), np.inf)
    other = backbone(
        Constraints(SQUARE, max_step_m=10.0), vehicles._replace(left_m=0.5 * vehicles.left_m), nodes, objective
    )
    value = plan_value(far, nodes, objective, vehicles, vias, counts)
    assert value < plan_value(far, nodes, objective, vehicles, *packed([share.stops for share in other]))


def test_where_a_zone_cuts_the_area_each_side_has_a_backbone_of_its_own() -> None:
    """A vehicle got stops behind the zone, and stayed before it for the rest of the mission."""
    bar = np.array([[-5.0, 50.0], [105.0, 50.0], [105.0, 60.0], [-5.0, 60.0]])
    vehicles = Vehicles(np.array([[2.0, 2.0], [90.0, 40.0], [50.0, 90.0]]), np.full(3, np.nan), np.full(3, 300.0))
    objective = SurveyObjective(20.0, 2.0, Turns(3.0, 0.0), 1e6)
    shares = backbone(Constraints(SQUARE, (bar,), max_step_m=10.0), vehicles, nodes_of(2), objective)
    for (x, y), share in zip(vehicles.en_m, shares, strict=True):
        way = np.vstack([[x, y], share.stops])
        assert not LineString(way).intersects(Polygon(bar))
        assert flown_m(x, y, np.nan, share.stops, objective.turns) > 200.0


def most_across_m(left_m: float, legs: int) -> float:
    """Survey a floor that is rough in one corner; return how far the leg goes to the side that does so most."""
    situation = make_situation(belief=make_belief(cell=5.0))
    rough = np.asarray((situation.belief.xy_m > 50.0).all(axis=1))
    planner, rng = create_planner("cao", PlannerOptions(search=1000), SingleBeam(0.01)), np.random.default_rng(0)
    positions, most = situation.positions, 0.0
    sounded, left = positions[:, :2], np.full(len(positions), left_m)
    for step in range(1, legs + 1):
        away = np.asarray(cKDTree(sounded).query(situation.belief.xy_m)[0])
        belief = replace(
            situation.belief,
            depth_m=np.full(len(rough), 12.0),
            sd_m=np.where(rough, 0.1 * away, 0.001 * away),
            weight=np.where(rough, 9.0, 0.01),
        )
        now = replace(
            situation, step=step, positions=positions, belief=belief, soundings_en_m=sounded, left_m=left.copy()
        )
        after = planner.propose(now, rng).positions
        ways = after - positions
        if step > 3:  # the first legs go to where the lines begin
            most = max(most, float(np.abs(ways[:, :2]).min(axis=1).max()))
        left -= np.linalg.norm(ways, axis=1)
        sounded = np.vstack([sounded, *np.linspace(positions[:, :2], after[:, :2], 9)])
        positions = after
    return most


def test_lines_that_lie_closer_than_the_places_that_plans_are_judged_at_stay_even() -> None:
    assert most_across_m(left_m=1500.0, legs=90) < 0.5  # corners are cut
    assert most_across_m(left_m=300.0, legs=30) > 1.0
