"""Routes of vehicles that need no links, over landmarks whose whole position is unknown."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation import RangeSensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.moving_targets import Targets
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from app.exploration.rollout.allowed_raster import allowed_raster
from app.exploration.rollout.flight import Rules
from app.exploration.rollout.floor import FloorEstimate, estimate_floor, held_to, hold_to, let_stay, sample
from app.exploration.rollout.independent_mission import apart_mission
from app.exploration.rollout.independent_routes import (
    RoutesFlown,
    RoutesTask,
    fly_alone,
    improve_apart,
    judge,
    no_paths,
    no_routes,
    route_of,
    trace,
)
from app.exploration.rollout.local_search import DRAWS
from app.exploration.rollout.planner import RolloutPlanner
from app.exploration.rollout.points import SURELY, look_whole, make_points
from app.exploration.rollout.sectors import sectors

CUBE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
RULES = Rules(0.05, np.inf, -1.0, 1.0, 0.4, 0.1, cut_corners=True, directed=True)
NAMES = ("a", "b", "c")
FREE = np.ones(3)
HELD, ACCURACY = 0.3, 0.1
START = np.array([[-0.8, -0.8, 0.2], [-0.7, -0.8, 0.2], [-0.8, -0.7, 0.2]])
LIMITS = Constraints(CUBE, max_step_m=0.05, min_depth_m=-1.0, max_depth_m=1.0, min_altitude_m=0.2, held_altitude_m=HELD)


def hilly(seed: int, n: int = 120) -> Any:
    """Landmarks on gentle hills; half of them were seen, with errors of any shape."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1.0, 1.0, (n, 2))
    depth = 0.6 + 0.2 * np.sin(2.0 * xy[:, 0] + seed) * np.cos(1.5 * xy[:, 1])
    seen = rng.random(n) < 0.5
    shape = rng.normal(0.0, 0.1, (n, 3, 3))
    covariance = np.where(seen[:, None, None], shape @ shape.transpose(0, 2, 1) + 1e-4 * np.eye(3), 0.0)
    covariance[~seen] = np.diag([np.inf] * 3)
    sd = np.where(seen, np.sqrt(np.linalg.eigvalsh(np.where(seen[:, None, None], covariance, 0.0))[:, 2]), np.inf)
    return Belief(xy, depth, sd, np.zeros(n, dtype=bool), np.ones(n), 0.2, covariance)


def flat(depth: float) -> Any:
    """An even floor over the cube."""
    side = np.full((41, 41), depth)
    held = held_to(Bottom.unknown(), np.zeros((0, 3)), HELD)
    return FloorEstimate(-1.0, -1.0, 0.05, side, side.copy(), side - HELD, side - HELD, held)


def make_case(seed: int, stops: int = 4) -> Any:
    """Three vehicles with random routes over what is left."""
    rng = np.random.default_rng(seed)
    belief = hilly(seed)
    row = np.arange(len(belief.xy_m))
    bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m)
    floor = estimate_floor(belief, bottom, np.zeros((0, 3)), CUBE, 0.4, 0.2, 0.6, HELD)
    xyz = np.column_stack([belief.xy_m, belief.depth_m])
    points = make_points(xyz, belief, row, ACCURACY, CUBE, 0.4, 3, len(row), floor)
    routes = no_routes(3, 12, HELD)
    routes.at_m[:, :stops, 0] = rng.uniform(-0.9, 0.9, (3, stops, 2))
    routes.counts[:] = stops
    return belief, points, floor, routes


def flown(routes: Any, points: Any, floor: Any) -> Any:
    """Fly routes to their ends; return score, paths and what is left."""
    paths, left = no_paths(3, 300), np.empty(points.information.shape[1])
    for i in range(3):
        trace(START, i, routes, floor, RULES, paths)
    return judge(paths, FREE, int(routes.counts.sum()), points, RULES, np.inf, left), paths, left


def open_landmarks(information: FloatArray) -> Any:
    """Return which of the information matrices, six numbers each, leave a landmark inaccurate."""
    a, b, c, d, e, f = information
    matrices = np.array([[a, b, c], [b, d, e], [c, e, f]]).transpose(2, 0, 1)
    return np.array([np.diag(np.linalg.pinv(m)).max() >= (SURELY * ACCURACY) ** 2 for m in matrices])


@given(seed=st.integers(0, 1000), at=st.tuples(*[st.floats(-1.1, 1.1)] * 2, st.floats(0.0, 0.5)))
@settings(max_examples=30, deadline=None)
def test_a_look_adds_what_the_fisher_information_of_a_range_is(seed: int, at: Any) -> None:
    _, points, _, _ = make_case(seed)
    points = points._replace(horizon=np.full_like(points.horizon, -np.inf))
    information = points.information.copy()
    done = open_landmarks(information) == 0
    already = done.copy()
    completed = look_whole(at[0], at[1], at[2], points, 0.4, 0.1, information, done)
    away = points.work.xyz.T - np.array(at)
    r = np.linalg.norm(away, axis=1)
    u = away / r[:, None]
    gained = np.where((r < 0.4) & ~already, 1.0 / (0.1 * r) ** 2, 0.0)[:, None, None] * u[:, :, None] * u[:, None, :]
    expected = points.information + gained[:, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)].T
    np.testing.assert_allclose(information, expected, rtol=1e-9, atol=1e-9)
    looked = (r < 0.4) & ~already
    np.testing.assert_array_equal(done[looked], ~open_landmarks(expected)[looked])
    assert completed == done.sum() - already.sum()


def test_a_ridge_hides_what_lies_behind_it_and_not_what_lies_before_it() -> None:
    floor = flat(0.5)
    floor.depth_m[:, 21:23] = 0.3
    xyz = np.array([[0.0, 0.0, 0.5], [0.2, 0.0, 0.5]])
    belief = Belief(
        xyz[:, :2], xyz[:, 2], np.full(2, np.inf), np.zeros(2, dtype=bool), np.ones(2), 0.2,
        np.repeat(np.diag([np.inf] * 3)[None], 2, axis=0),
    )  # fmt: skip
    points = make_points(xyz, belief, np.arange(2), ACCURACY, CUBE, 0.4, 3, 2.0, floor)
    seen = []
    for x, z in ((-0.1, 0.25), (0.05, 0.05), (0.3, 0.25)):
        information = points.information.copy()
        look_whole(x, 0.0, z, points, 0.6, 0.1, information, np.zeros(2, dtype=bool))
        changed = (information != points.information).any(axis=0)
        seen.append({float(points.work.xyz[0, m]) for m in np.flatnonzero(changed)})
    assert seen == [{0.0}, {0.0, 0.2}, {0.2}]


def test_one_straight_line_does_not_tell_where_a_landmark_is_and_a_second_one_does() -> None:
    n = 1
    belief = Belief(
        np.array([[0.12, 0.0]]), np.array([0.5]), np.full(n, np.inf), np.zeros(n, dtype=bool), np.ones(n), 0.2,
        np.diag([np.inf] * 3)[None],
    )  # fmt: skip
    points = make_points(np.array([[0.12, 0.0, 0.5]]), belief, np.array([0]), ACCURACY, CUBE, 0.4, 3, 1.0, flat(0.5))
    information, done = points.information.copy(), np.zeros(n, dtype=bool)
    for x in (0.0, 0.24):
        assert not done[0]
        for y in np.arange(-0.4, 0.4, 0.05):
            look_whole(x, y, 0.2, points, 0.4, 0.1, information, done)
    assert done[0]


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_a_vehicle_alone_keeps_its_step_its_depths_and_comes_to_the_end(seed: int) -> None:
    _, _, floor, routes = make_case(seed)
    at, after, k = START[:1].copy(), np.empty((1, 3)), 0
    for _ in range(400):
        if k >= routes.counts[0]:
            break
        k = fly_alone(at, route_of(routes, 0), k, int(routes.counts[0]), floor, RULES, after)
        assert np.linalg.norm(after - at) <= RULES.step_m + 1e-9
        assert RULES.min_depth_m <= after[0, 2] <= RULES.max_depth_m
        at = after.copy()
    assert k == routes.counts[0]


@given(seed=st.integers(0, 1000), zones=st.booleans())
@settings(max_examples=10, deadline=None)
def test_the_search_never_worsens_routes_and_reports_their_true_score(seed: int, zones: Any) -> None:
    _, points, floor, routes = make_case(seed)
    zone = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
    free = allowed_raster(Constraints(CUBE, (zone,) if zones else ()))
    before, paths, left = flown(routes, points, floor)
    draws = np.random.default_rng(seed).random((60, DRAWS + 1))
    best = RoutesFlown(routes, paths, left)
    trial = RoutesFlown(no_routes(3, 12, HELD), no_paths(3, 300), left.copy())
    score = improve_apart(best, before, trial, draws, RoutesTask(START, FREE, points, floor, RULES), free, 1.0)
    assert score <= before
    again, _, left_again = flown(routes, points, floor)
    assert again == pytest.approx(score)
    np.testing.assert_allclose(left, left_again)
    assert judge(paths, FREE, int(routes.counts.sum()), points, RULES, score * 0.99, left) >= score * 0.99


@given(seed=st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_a_vehicle_that_is_away_half_of_the_time_is_not_relied_upon(seed: int) -> None:
    _, points, floor, routes = make_case(seed)
    whole, paths, _ = flown(routes, points, floor)
    half = judge(paths, np.array([0.5, 1.0, 1.0]), 12, points, RULES, np.inf, np.empty(points.information.shape[1]))
    assert half >= whole


def test_what_is_done_ten_steps_earlier_is_worth_twelve_steps_in_the_end() -> None:
    xyz = np.array([[0.0, 0.0, 0.5], [0.02, 0.0, 0.5], [0.8, 0.0, 0.5]])
    belief = Belief(
        xyz[:, :2], xyz[:, 2], np.full(3, np.inf), np.zeros(3, dtype=bool), np.ones(3), 0.2,
        np.repeat(np.diag([np.inf] * 3)[None], 3, axis=0),
    )  # fmt: skip
    points = make_points(xyz, belief, np.arange(3), ACCURACY, CUBE, 0.4, 3, 3.0, flat(0.5))
    around = np.array([[0.1, 0.1, 0.2], [-0.1, 0.1, 0.2], [0.0, -0.1, 0.2]] * 2)
    scores = []
    for first, last in ((30, 50), (20, 62)):
        paths = no_paths(1, 100)
        paths.at_m[0] = [-0.8, -0.8, 0.2]
        paths.at_m[0, first : first + 6] = around
        paths.at_m[0, last : last + 6] = np.add(around, [0.8, 0.0, 0.0])
        paths.length[0] = last + 6
        scores.append(judge(paths, np.ones(1), 2, points, RULES, np.inf, np.empty(3)))
    assert scores[1] < scores[0]


def test_first_routes_give_each_vehicle_a_strip_of_its_own() -> None:
    left = np.random.default_rng(0).uniform(-1.0, 1.0, (300, 2))
    routes = list(sectors(left, START[:, :2], CUBE, 0.4))
    kept = 0
    for team in routes:
        spans = [np.ptp(route, axis=0) for route in team]
        if all(span.min() < 0.67 for span in spans):
            kept += 1
            axis = int(np.argmin(spans[0]))
            middles = sorted(route[:, axis].mean() for route in team)
            assert np.diff(middles) == pytest.approx([2 / 3] * 2, abs=0.02)
    assert kept > 20
    assert any(len(team[0]) > 10 for team in routes), "lines across the first ones follow"


def test_nobody_climbs_because_an_estimate_calls_it_too_low() -> None:
    _, _, floor, _ = make_case(1)
    low = np.array([[0.3, 0.1, sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, 0.3, 0.1) + 0.1]])
    let_stay(floor, low, HELD, 0.1)
    assert sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, 0.3, 0.1) >= low[0, 2] - 0.03


def test_an_altimeter_is_believed_more_than_the_estimate() -> None:
    _, _, floor, _ = make_case(1)
    sounded = np.array([[0.3, 0.1, sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, 0.3, 0.1) + 0.2]])
    hold_to(floor, sounded, 0.12)
    assert sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, 0.3, 0.1) == pytest.approx(
        sounded[0, 2], abs=0.03
    )


def test_a_vehicle_that_follows_the_floor_comes_close_to_it_in_a_trench() -> None:
    north = np.linspace(-1.0, 1.0, 60)
    xy = np.stack(np.meshgrid(north, north), axis=-1).reshape(-1, 2)
    depth = np.where(np.abs(xy[:, 0]) < 0.15, 0.8, 0.4)
    n = len(xy)
    belief = Belief(
        xy, depth, np.full(n, 0.01), np.zeros(n, dtype=bool), np.ones(n), 0.2, np.repeat(1e-4 * np.eye(3)[None], n, 0)
    )
    bottom = Bottom.from_landmarks(xy, depth)
    reached = []
    for follows in (False, True):
        floor = estimate_floor(
            belief, bottom, np.zeros((0, 3)), CUBE, 0.4, 0.2, 0.6, HELD, follows=follows
        )  # fmt: skip
        reached.append(sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, 0.0, 0.0))
    assert reached[0] < 0.4
    assert reached[1] == pytest.approx(0.8 - HELD, abs=0.02)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_every_step_that_a_vehicle_may_try_is_short_enough_and_leads_somewhere(seed: int) -> None:
    team = replace(situation(1, START), belief=hilly(seed))
    bottom = Bottom.from_landmarks(team.belief.xy_m, team.belief.depth_m)
    mission = apart_mission(
        team, FREE, bottom, np.zeros((0, 3)), allowed_raster(LIMITS), RangeSensor(0.4),
        PlannerOptions(accuracy_sd_m=ACCURACY), np.random.default_rng(seed),
    )  # fmt: skip
    best = mission.plan(list(np.random.default_rng(seed).uniform(-0.9, 0.9, (3, 4, 2))))
    for i, here in enumerate(START):
        wishes, passed = mission.steps(best, i)
        assert len(wishes) == len(passed)
        moves = wishes - here
        assert (np.linalg.norm(moves, axis=1) <= LIMITS.max_step_m).all()
        assert ((np.hypot(*moves[1:, :2].T) > 0.0) | (moves[1:, 2] < 0.0)).all(), "down on the spot an altimeter undoes"
        assert moves[-1] == pytest.approx([0.0, 0.0, -LIMITS.max_step_m])
        assert passed[-1] == 0


def test_no_vehicle_stands_before_a_step_that_only_the_estimate_of_the_floor_has() -> None:
    rng = np.random.default_rng(3)
    xy = np.vstack([rng.uniform([-1.0, 0.25], [1.0, 1.0], (60, 2)), rng.uniform([-1.0, -1.0], [1.0, 0.2], (200, 2))])
    known = np.arange(260) >= 60
    depth = np.where(known, 0.6, np.nan)
    depth[known & (np.abs(xy[:, 1]) < 0.1)] -= 0.25  # nothing of it is true
    shape = np.where(known[:, None, None], 1e-4 * np.eye(3), np.diag([np.inf] * 3))
    belief = Belief(xy, depth, np.where(known, 0.01, np.inf), known, np.ones(260), 0.2, shape)
    planner = create_planner("rollout", PlannerOptions(rollouts=5, accuracy_sd_m=ACCURACY), RangeSensor(0.4))
    track = [np.array([[-0.6, -0.3, 0.3], [0.0, -0.3, 0.3], [0.6, -0.3, 0.3]])]
    for step in range(1, 41):
        asked = replace(situation(step, track[-1]), belief=belief)
        after = planner.propose(asked, np.random.default_rng(step)).positions
        # Altimeters hold the clearance above the true floor.
        track.append(np.column_stack([after[:, :2], np.minimum(after[:, 2], 0.6 - HELD)]))
    way = np.array(track)
    assert (way[-1, :, 1] > 0.1).all()
    flown = np.cumsum(np.hypot(*np.moveaxis(np.diff(way[..., :2], axis=0), 2, 0)), axis=0)
    assert (flown[6:] - flown[:-6]).min() > 0.5 * LIMITS.max_step_m


def situation(step: Any, positions: FloatArray, targets: Any = None) -> Any:
    belief = hilly(2)
    return Situation(
        step, 100, NAMES, positions, np.full(3, np.nan), belief, np.zeros((0, 2)), LIMITS, targets
    )  # fmt: skip


def lost_target() -> Any:
    state = np.array([[0.5, 0.5, -0.2, 0.0, 0.0, 0.0]])
    return Targets(state, np.diag([0.04] * 3 + [1e-6] * 3)[None], np.array([False]), ACCURACY, 0.1)


def test_a_vehicle_on_an_errand_keeps_its_route_and_memory_continues_it() -> None:
    planner = create_planner("rollout", PlannerOptions(rollouts=5, accuracy_sd_m=ACCURACY), RangeSensor(0.4))
    first = planner.propose(situation(1, START), np.random.default_rng(0))
    assert isinstance(planner, RolloutPlanner)
    routes = {name: len(at) for name, at in planner._routes.items()}
    assert set(routes) == set(NAMES)
    memory = planner.snapshot()
    away = situation(2, first.positions, lost_target())
    second = planner.propose(away, np.random.default_rng(1))
    assert len(second.errands) == 1
    assert set(planner._routes) == set(NAMES)
    again = create_planner("rollout", PlannerOptions(rollouts=5, accuracy_sd_m=ACCURACY), RangeSensor(0.4))
    again.restore(memory)
    np.testing.assert_array_equal(again.propose(away, np.random.default_rng(1)).positions, second.positions)


def test_routes_break_no_limit_beside_zones_and_each_other() -> None:
    zone = np.array([[-0.5, -0.9], [-0.3, -0.9], [-0.3, 0.2], [-0.5, 0.2]])
    limits = replace(LIMITS, keep_out=(zone,), min_separation_m=0.06)
    planner = create_planner("rollout", PlannerOptions(rollouts=5, accuracy_sd_m=ACCURACY), RangeSensor(0.4))
    at = START
    for step in range(1, 9):
        asked = replace(situation(step, at), constraints=limits)
        bottom = Bottom.from_landmarks(asked.belief.xy_m, asked.belief.depth_m)
        after = planner.propose(asked, np.random.default_rng(step)).positions
        assert limits.violations(NAMES, at, after, bottom) == ()
        assert np.linalg.norm(after - at, axis=1).max() > 0.0
        at = after
