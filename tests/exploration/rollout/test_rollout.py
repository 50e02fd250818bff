"""Whole-mission rollouts, against slow references and by properties."""

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.estimation import RangeSensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.bottom_contacts import FeltBottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.exploration.rollout.allowed_raster import allowed_raster, clear_ways, settle_waypoint
from app.exploration.rollout.flight import (
    DIVE,
    FlownPlan,
    Plan,
    Rules,
    Task,
    begin,
    fly_plan,
    fly_step,
    look,
    make_work,
    new_checkpoints,
)
from app.exploration.rollout.floor import ENVELOPE_SLOPE, deepest_dive_m, estimate_floor, sample
from app.exploration.rollout.initial_plans import Backbone, backbones, with_team
from app.exploration.rollout.local_search import DRAWS, improve
from app.exploration.rollout.tour import shortest_order, tour_of
from app.exploration.rollout.unseen import deeper_than_presumed, look_in_vain
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

CUBE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
RULES = Rules(0.05, 0.3, -1.0, 1.0, 0.4, 0.1, cut_corners=True)
LINK = 0.29
ROOM = 12
CLEARANCE = 0.05


def hilly(seed: int, n: int = 250) -> Any:
    """Landmarks all over the cube, on gentle hills; a third of them was seen."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1.0, 1.0, (n, 2))
    depth = 0.6 + 0.2 * np.sin(2.0 * xy[:, 0] + seed) * np.cos(1.5 * xy[:, 1])
    seen = rng.random(n) < 0.33
    belief = Belief(
        xy, np.where(seen, depth, np.nan), np.where(seen, 0.03, np.inf), np.zeros(n, dtype=bool), np.ones(n), 0.2
    )
    return belief, depth


def rough(rng: np.random.Generator) -> Belief:
    """Landmarks that are known, each at a depth of its own."""
    xy, depth = rng.uniform(-1.0, 1.0, (400, 2)), rng.uniform(0.3, 0.9, 400)
    return Belief(xy, depth, np.full(400, 0.02), np.ones(400, dtype=bool), np.ones(400), 0.2)


def floor_of(belief: Belief, felt: Any = None) -> Any:
    bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m)
    return estimate_floor(belief, bottom, np.zeros((0, 3)) if felt is None else felt, CUBE, 0.4, CLEARANCE, 0.6)


def make_case(seed: int, vehicles: int = 3, waypoints: int = 5) -> Any:
    """A team in a row, a random plan that keeps its links, and the landmarks to be done."""
    rng = np.random.default_rng(seed)
    belief, depth = hilly(seed)
    floor = floor_of(belief)
    row = np.column_stack([np.zeros(vehicles), 0.25 * np.arange(vehicles)])
    start = np.column_stack([row - 0.8, np.zeros(vehicles)])
    for i in range(vehicles):
        start[i, 2] = sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, *start[i, :2]) - 0.05
    plan = Plan(np.zeros((ROOM, vehicles, 2)), np.zeros(ROOM), np.zeros(ROOM), np.arange(vehicles))
    for k in range(waypoints):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        turned = row @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        plan.at_m[k] = np.clip(rng.uniform(-0.7, 0.7, 2) + turned, -1.0, 1.0)
        plan.height_m[k] = rng.uniform(0.12, 0.25)
        plan.sinking[k] = rng.choice([0.0, 0.5, DIVE])
    work, _ = make_work(np.column_stack([belief.xy_m, depth]), np.full(len(depth), 2500.0), CUBE, 0.15, 2.0, 250, 30.0)
    return start, plan, waypoints, work, floor


def flown(
    start: Any,
    plan: Any,
    count: Any,
    work: Any,
    floor: Any,
    checkpoints: Any = None,
    origin: int = 0,
    bound: Any = np.inf,
    save: Any = None,
) -> Any:
    if checkpoints is None:
        checkpoints = new_checkpoints(ROOM, len(start), len(work.need))
        begin(checkpoints, start, work)
    left = np.empty(len(work.need))
    score = fly_plan(
        checkpoints, origin, plan, count, Task(work, floor, RULES, 400.0), bound, left, save or checkpoints
    )
    return score, left, checkpoints


def copied(plan: Plan) -> Any:
    return Plan(plan.at_m.copy(), plan.height_m.copy(), plan.sinking.copy(), plan.chain)


@given(seed=st.integers(0, 1000), at=st.tuples(*[st.floats(-1.2, 1.2)] * 2, st.floats(-0.2, 0.9)))
@settings(max_examples=40, deadline=None)
def test_a_look_gives_what_eq_5_says_to_every_landmark_in_sight(seed: int, at: Any) -> None:
    _, _, _, work, _ = make_case(seed)
    need = work.need.copy()
    done = look(at[0], at[1], at[2], work, RULES, need)
    offset = work.xyz.T - np.array(at)
    r2 = (offset**2).sum(axis=1)
    gained = np.where(r2 < 0.4**2, offset[:, 2] ** 2 / (0.1**2 * r2**2), 0.0)
    np.testing.assert_allclose(need, work.need - gained, rtol=1e-9)
    assert done == ((work.need - gained) <= 0.0).sum()


@given(seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_flying_obeys_step_links_depths_and_the_estimated_floor(seed: int) -> None:
    start, plan, count, _, floor = make_case(seed)
    at, k, after = start, 0, np.empty_like(start)
    for _ in range(200):
        if k >= count:
            break
        k = fly_step(at, plan, k, count, floor, RULES, after)
        assert (np.linalg.norm(after - at, axis=1) <= RULES.step_m + 1e-9).all()
        assert (after[:, 2] >= RULES.min_depth_m).all()
        assert (after[:, 2] <= RULES.max_depth_m).all()
        for i in range(2):
            assert np.linalg.norm(after[i] - after[i + 1]) <= RULES.com_range_m + 1e-6
        for x, y, z in after:
            clear = deepest_dive_m(floor, x, y)
            assert z <= max(clear, sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)) + 1e-6
        at = after.copy()
    assert k == count, "the plan is flown to its end"


@given(seed=st.integers(0, 1000), changed=st.integers(0, 4))
@example(seed=458, changed=4)
@example(seed=153, changed=1)
@settings(max_examples=40, deadline=None)
def test_a_changed_plan_flown_from_the_change_on_scores_as_if_flown_from_the_start(seed: int, changed: Any) -> None:
    start, plan, count, work, floor = make_case(seed)
    _, _, checkpoints = flown(start, plan, count, work, floor)
    other = copied(plan)
    other.at_m[changed] += np.random.default_rng(seed).uniform(-0.05, 0.05, 2)
    scratch = new_checkpoints(ROOM, len(start), len(work.need))
    resumed, left, _ = flown(start, other, count, work, floor, checkpoints, changed, save=scratch)
    whole, left_whole, _ = flown(start, other, count, work, floor)
    assert resumed == pytest.approx(whole, abs=1e-9)
    np.testing.assert_allclose(left, left_whole, atol=1e-9)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_a_flight_is_given_up_only_when_it_cannot_beat_the_bound(seed: int) -> None:
    start, plan, count, work, floor = make_case(seed)
    score, _, _ = flown(start, plan, count, work, floor)
    assert flown(start, plan, count, work, floor, bound=score * 1.001)[0] == score
    assert flown(start, plan, count, work, floor, bound=score * 0.999)[0] >= score * 0.999


@given(seed=st.integers(0, 1000), zones=st.booleans())
@settings(max_examples=15, deadline=None)
def test_the_search_never_worsens_a_plan_and_reports_its_true_score(seed: int, zones: Any) -> None:
    start, plan, count, work, floor = make_case(seed)
    zone = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    free = allowed_raster(Constraints(CUBE, (zone,) if zones else ()))
    before, left, checkpoints = flown(start, plan, count, work, floor)
    trial, scratch = copied(plan), new_checkpoints(ROOM, len(start), len(work.need))
    draws = np.random.default_rng(seed).random((150, DRAWS))
    best, tried = FlownPlan(plan, checkpoints, left), FlownPlan(trial, scratch, left.copy())
    count, score = improve(best, count, before, tried, draws, Task(work, floor, RULES, 400.0), free, LINK)
    assert score <= before
    again, _, _ = flown(start, plan, count, work, floor)
    # An appended waypoint is flown to from where the plan ended before, which may cost part of a step.
    assert again == pytest.approx(score, abs=1.0)


@given(seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_ways_lead_round_zones_with_the_team_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(-0.5, 0.1, 2)
    high = low + rng.uniform(0.2, 0.4, 2)
    zone = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    constraints = Constraints(CUBE, (zone,))
    free = allowed_raster(constraints)
    start = np.array([[-0.9, -0.9], [-0.9, -0.7], [-0.9, -0.5]])
    plan = Plan(np.zeros((ROOM, 3, 2)), np.zeros(ROOM), np.zeros(ROOM), np.arange(3))
    plan.at_m[0] = [[0.9, 0.5], [0.9, 0.7], [0.9, 0.9]]
    assert settle_waypoint(free, plan.at_m[0], plan.chain, LINK)
    count = clear_ways(free, plan, 1, start, 0, 0, LINK)
    if count < 0:
        return  # it may find no way within its few detours, but must then say so
    here = start
    for k in range(count):
        for f in np.linspace(0.0, 1.0, 60):
            at = here + f * (plan.at_m[k] - here)
            assert not ((at > low) & (at < high)).all(axis=1).any()
            assert (np.hypot(*np.diff(at, axis=0).T) <= LINK + 1e-9).all()
        here = plan.at_m[k]


def over_a_pit() -> Any:
    """Two vehicles beside a pit at (0, 0), narrower than it is deep; one landmark on its bottom, at 0.9."""
    rng = np.random.default_rng(0)
    xy = np.vstack([rng.uniform(-1.0, 1.0, (900, 2)), np.zeros((1, 2))])
    depth = np.where(np.hypot(*xy.T) < 0.12, 0.9, 0.3)
    belief = Belief(xy, depth, np.full(len(xy), 0.01), np.zeros(len(xy), dtype=bool), np.ones(len(xy)), 0.2)
    start = np.array([[-0.3, 0.0, 0.15], [-0.1, 0.0, 0.15]])
    plan = Plan(np.zeros((ROOM, 2, 2)), np.full(ROOM, 0.1), np.zeros(ROOM), np.arange(2))
    plan.at_m[0] = [[-0.01, 0.0], [0.01, 0.0]]
    plan.at_m[1] = [[0.3, 0.0], [0.5, 0.0]]
    return belief, start, plan


def test_only_a_dive_goes_down_into_a_steep_pit_and_comes_up_again() -> None:
    belief, start, plan = over_a_pit()
    floor = floor_of(belief)
    lowest = []
    for dives in (False, True):
        plan.sinking[0] = DIVE if dives else 0.5
        at, k, after = start, 0, np.empty_like(start)
        path: list[Any] = []
        while k < 2 and len(path) < 100:
            k = fly_step(at, plan, k, 2, floor, RULES, after)
            assert (np.linalg.norm(after - at, axis=1) <= RULES.step_m + 1e-9).all()
            assert np.linalg.norm(after[0] - after[1]) <= RULES.com_range_m + 1e-6
            at = after.copy()
            path.append(at)
        assert k == 2
        lowest.append(max(float(step[:, 2].max()) for step in path))
        assert (path[-1][:, 2] < 0.3).all()
    assert lowest[0] < 0.45
    assert lowest[1] > 0.7


@given(seed=st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_a_step_is_no_longer_than_allowed_where_uneven_floor_lifts_the_vehicle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    floor = floor_of(rough(rng))
    at = np.array([[-0.8, -0.8, 0.3]])
    plan = Plan(rng.uniform(-0.8, 0.8, (4, 1, 2)), np.full(4, 0.15), np.full(4, 0.3), np.arange(1))
    after, k = np.empty_like(at), 0
    for _ in range(60):
        if k == 4:
            break
        k = fly_step(at, plan, k, 4, floor, RULES, after)
        x, y, z = after[0]
        shoal = sample(floor.shoal_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        lifted = np.array([x, y, min(z, max(shoal, at[0, 2] - RULES.lifted * RULES.step_m))])
        assert np.linalg.norm(lifted - at[0]) <= RULES.step_m + 1e-9
        at = after.copy()


def test_over_uneven_floor_the_deeper_one_of_two_stays_in_range_of_one_that_is_lifted() -> None:
    # In the west the floor is as uneven as can be, in the east there is a pit.
    xy = np.random.default_rng(0).uniform(-1.0, 1.0, (600, 2))
    depth = np.where(xy[:, 0] < 0.0, np.where(np.arange(600) % 2 == 0, 0.25, 0.65), 0.95)
    belief = Belief(xy, depth, np.full(600, 0.02), np.ones(600, dtype=bool), np.ones(600), 0.2)
    floor = floor_of(belief)
    at = np.array([[-0.05, 0.0, 0.15], [0.05, 0.0, 0.15]])
    plan = Plan(at[None, :, :2].copy(), np.full(1, 0.1), np.full(1, DIVE), np.arange(2))
    after, k = np.empty_like(at), 0
    for _ in range(30):
        if k == 1:
            break
        k = fly_step(at, plan, k, 1, floor, RULES, after)
        lifted = after.copy()
        lifted[0, 2] = min(after[0, 2], at[0, 2] - RULES.lifted * RULES.step_m)
        assert np.linalg.norm(lifted[0] - lifted[1]) <= RULES.com_range_m
        at = after.copy()
    assert at[1, 2] - at[0, 2] > 0.15, "the one over the pit goes down"


@given(seed=st.integers(0, 1000), east=st.floats(-0.9, 0.9), north=st.floats(-0.9, 0.9))
@settings(max_examples=40, deadline=None)
def test_a_dive_goes_no_deeper_than_its_constraints_let_it(seed: int, east: Any, north: Any) -> None:
    # Else the move is refused each time, and a team stands over what it left for as long as the plan stands.
    belief = rough(np.random.default_rng(seed))
    bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m)
    limits = Constraints(CUBE, max_step_m=RULES.step_m, min_depth_m=-1.0, max_depth_m=1.0, min_altitude_m=CLEARANCE)
    at = np.array([[east, north, 0.2]])
    plan = Plan(at[None, :, :2].copy(), np.full(1, 0.1), np.full(1, DIVE), np.arange(1))
    floor, after, k = floor_of(belief), np.empty_like(at), 0
    for _ in range(30):
        if k == 1:
            break
        k = fly_step(at, plan, k, 1, floor, RULES, after)
        assert limits.feasible(at, after[None], bottom)[0]
        at = after.copy()
    assert k == 1, "the dive ends"


def test_a_dive_goes_down_into_a_pit_that_a_single_landmark_tells_of_and_not_onto_what_was_felt() -> None:
    side = np.linspace(-1.0, 1.0, 34)
    xy = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    pit = int(np.argmin(np.hypot(*(xy - 0.1).T)))
    belief = Belief(
        xy, np.where(np.arange(len(xy)) == pit, 0.9, 0.4), np.full(len(xy), 0.02), np.ones(len(xy), dtype=bool),
        np.ones(len(xy)), 0.2,
    )  # fmt: skip
    felt = np.array([[*xy[pit], 0.7]])
    for floor, deepest in ((floor_of(belief), 0.9), (floor_of(belief, felt), 0.7)):
        assert deepest_dive_m(floor, *xy[pit]) == pytest.approx(deepest - CLEARANCE)


def test_a_plan_that_leaves_what_can_be_taken_costs_more_than_one_that_takes_it() -> None:
    belief, start, plan = over_a_pit()
    floor = floor_of(belief)
    xyz = np.array([[0.0, 0.0, 0.9], [0.01, 0.01, 0.9]])
    work, _ = make_work(xyz, np.full(2, 2500.0), CUBE, 0.15, 0.0, 900, 30.0)
    scores = []
    for sinking in (DIVE, 0.0):
        plan.sinking[0] = sinking
        score, left, _ = flown(start, plan, 2, work, floor)
        scores.append(score)
        assert (left > 0.0).any() == (sinking == 0.0)
    assert scores[0] < scores[1]


@given(seed=st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_landmarks_looked_for_in_vain_are_never_presumed_deeper_than_they_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1.0, 1.0, (300, 2))
    depth = np.where(np.hypot(*(xy - rng.uniform(-0.5, 0.5, 2)).T) < 0.25, rng.uniform(0.6, 1.0), 0.3)
    depth_known, least = np.full(300, np.nan), np.full(300, -np.inf)
    for _ in range(12):
        at = np.column_stack([rng.uniform(-1.0, 1.0, (3, 2)), rng.uniform(0.0, 0.24, 3)])
        away = np.linalg.norm(at[:, None] - np.column_stack([xy, depth])[None], axis=2).min(axis=0)
        depth_known[away < 0.4] = depth[away < 0.4]
        belief = Belief(xy, depth_known.copy(), np.ones(300), np.zeros(300, dtype=bool), np.ones(300), 0.2)
        least = look_in_vain(least, belief, at, 0.4, 1.0)
    assert (least <= depth + 1e-9).all()
    deeper = deeper_than_presumed(belief, least)
    assert np.isnan(depth_known[[int(np.hypot(*(xy - at[:2]).T).argmin()) for at in deeper]]).all()


def test_a_landmark_on_a_wall_above_is_not_presumed_deep() -> None:
    xy = np.array([[0.0, 0.0], [0.3, 0.0], [0.31, 0.0]])
    depth = np.array([0.9, 0.2, np.nan])
    belief = Belief(xy, depth, np.ones(3), np.zeros(3, dtype=bool), np.ones(3), 0.2)
    in_the_pit, above = np.array([[0.0, 0.0, 0.8]]), np.array([[0.3, 0.0, 0.1]])
    none = np.full(3, -np.inf)
    assert look_in_vain(none, belief, in_the_pit, 0.4, 1.5)[2] == -np.inf
    assert look_in_vain(none, belief, above, 0.4, 1.5)[2] == pytest.approx(0.1 + np.sqrt(0.4**2 - 0.01**2))


@given(seed=st.integers(0, 1000), n=st.integers(1, 40))
@settings(max_examples=25, deadline=None)
def test_a_tour_passes_every_landmark_and_keeps_its_links(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    left = np.column_stack([rng.uniform(-0.9, 0.9, (n, 2)), rng.uniform(0.3, 0.9, n)])
    here = np.array([[-0.9, -0.9], [-0.8, -0.9], [-0.9, -0.8]])
    tour = tour_of(left, np.full(n, 0.2), here, 0.3, LINK, 0.4)
    gaps = np.hypot(*np.diff(tour.at_m[:, tour.chain], axis=1).transpose(2, 0, 1))
    assert (gaps <= LINK).all()
    middles = tour.at_m.mean(axis=1)
    away = np.hypot(*(left[:, None, :2] - middles[None]).transpose(2, 0, 1))
    assert (away.min(axis=1) <= 2 * 0.35 * 0.4).all()
    deep = left[:, 2] - 0.2 > 0.75 * 0.4
    assert tour.dives.any() == deep.any()


@given(seed=st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_no_section_of_a_short_way_is_better_flown_the_other_way_round(seed: int) -> None:
    places = np.random.default_rng(seed).uniform(-1.0, 1.0, (7, 2))
    start = np.zeros(2)
    order = shortest_order(start, places)
    assert sorted(order) == list(range(7))

    def length(which: Any) -> float:
        return float(np.hypot(*np.diff(np.vstack([start, places[which]]), axis=0).T).sum())

    for i in range(7):
        for j in range(i + 1, 7):
            turned = np.concatenate([order[:i], order[i : j + 1][::-1], order[j + 1 :]])
            assert length(order) <= length(turned) + 1e-9


def test_the_envelope_lets_every_rise_be_climbed() -> None:
    belief, depth = hilly(3)
    known = Belief(belief.xy_m, depth, np.full(len(depth), 0.01), belief.accurate, belief.weight, 0.2)
    floor = floor_of(known)
    slope = np.abs(np.diff(floor.deepest_m, axis=1)) / floor.cell_m
    assert slope.max() <= ENVELOPE_SLOPE + 1e-9
    assert (floor.deepest_m <= floor.depth_m - CLEARANCE).all()


def test_a_wall_that_was_felt_is_kept_clear_of() -> None:
    belief, _ = hilly(3)
    wall = np.array([[0.1, 0.2, 0.3]])
    felt = floor_of(belief, wall)
    here = sample(felt.deepest_m, felt.west_m, felt.south_m, felt.cell_m, 0.1, 0.2)
    assert here <= 0.3 - CLEARANCE + ENVELOPE_SLOPE * felt.cell_m
    before = floor_of(belief)
    assert here < sample(before.deepest_m, before.west_m, before.south_m, before.cell_m, 0.1, 0.2)


def test_altimeters_tell_where_the_bottom_is() -> None:
    felt = FeltBottom()
    team = make_situation(constraints=Constraints(SQUARE, max_step_m=10.0, min_altitude_m=1.5))
    felt.ask(team.vehicles, team.positions + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert felt.feel(team).tolist() == [False, True]
    np.testing.assert_allclose(felt.points_m, [team.positions[1] + np.array([0.0, 0.0, 1.5])])


def test_sweeps_cover_what_is_left_from_every_corner() -> None:
    rng = np.random.default_rng(0)
    left = rng.uniform(-1.0, 1.0, (300, 2))
    here = np.array([[-0.9, -0.9], [-0.8, -0.9], [-0.9, -0.8]])
    sweeps = backbones(left, here, CUBE, 0.4, 0.3, LINK)
    corners = {tuple(np.sign(sweep.at_m[0].mean(axis=0)).astype(int)) for sweep in sweeps if len(sweep.at_m) > 2}
    assert corners == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    for sweep in sweeps:
        gaps = np.hypot(*np.diff(sweep.at_m[:, sweep.chain], axis=1).transpose(2, 0, 1))
        assert (gaps <= LINK + 1e-9).all()


def test_a_plan_outlives_a_change_of_the_team() -> None:
    at = np.stack([np.column_stack([np.full(3, x), [0.0, 0.2, 0.4]]) for x in (0.0, 0.5)])
    plan = Backbone(at, np.array([0, 1, 2]))
    fewer = with_team(plan, ("a", "b", "c"), ("a", "c"))
    assert fewer is not None
    np.testing.assert_array_equal(fewer.at_m, at[:, [0, 2]])
    more = with_team(plan, ("a", "b", "c"), ("a", "b", "c", "d"))
    assert more is not None
    np.testing.assert_allclose(more.at_m[:, 3], [[0.0, 0.6], [0.5, 0.6]])
    assert more.chain.tolist() == [0, 1, 2, 3]
    assert with_team(plan, ("a", "b", "c"), ("x", "y")) is None


def test_a_restored_planner_goes_on_among_landmarks_that_were_never_seen() -> None:
    situation = make_situation(
        belief=make_belief(known=False), constraints=Constraints(SQUARE, max_step_m=5.0, com_range_m=20.0)
    )
    one, other = (create_planner("rollout", PlannerOptions(rollouts=8), RangeSensor(10.0)) for _ in range(2))
    one.propose(situation, np.random.default_rng(0))
    other.restore(one.snapshot())
    a, b = (planner.propose(situation, np.random.default_rng(1)).positions for planner in (one, other))
    np.testing.assert_array_equal(a, b)
