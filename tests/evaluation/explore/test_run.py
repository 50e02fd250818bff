from typing import Any

import numpy as np
import pytest

from app.estimation import RangeSensor
from app.evaluation.explore.run import ExploreRun, run_explore
from app.evaluation.explore.team_changes import TeamSchedule
from app.evaluation.explore.world import CubeTerrain, ExploreScenario, World
from app.exploration.core.constraints import inside_area
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain

NO_CHANGES = TeamSchedule()


@pytest.fixture(scope="module")
def smooth() -> Terrain:
    return generate("smooth", 2, width_m=80.0, height_m=60.0)


def run(
    terrain: Terrain, planner: str, steps: int = 120, seed: int = 0, changes: TeamSchedule = NO_CHANGES, **options: Any
) -> ExploreRun:
    scenario = ExploreScenario(terrain, landmarks=300, steps=steps, seed=seed, changes=changes)
    return run_explore(scenario, planner, PlannerOptions(**options))


def test_the_cube_keeps_the_aspect_and_casts_depths(smooth: Terrain) -> None:
    cube = CubeTerrain(smooth)
    assert cube.half.tolist() == [1.0, 0.75]
    axis = np.linspace(-1, 1, 200)
    depth = cube.depth_at(np.stack(np.meshgrid(axis, 0.75 * axis), axis=-1))
    assert 0.2 <= depth.min() < 0.25
    assert 0.95 < depth.max() <= 1.0


def test_remaining_landmarks_only_ever_decrease(smooth: Terrain) -> None:
    result = run(smooth, "cao")
    assert (np.diff(result.history) <= 0.0).all()
    assert result.remaining_pct == result.history[-1]
    assert result.real_tries == 0


@pytest.mark.parametrize(
    ("planner", "tries"),
    [
        ("cao", 0),
        ("lawnmower", 0),
        ("random", 0),
        pytest.param("rollout", 0, marks=pytest.mark.slow),
        ("spsa", 0),
        ("osarses", 2),
        ("spsa-tried", 2),
        ("fdsa-tried", 18),
    ],
)
def test_same_seed_same_run(smooth: Terrain, planner: str, tries: int) -> None:
    first, second = (run(smooth, planner, steps=8, tries=2) for _ in range(2))
    assert first.history == second.history
    assert first.distance == second.distance
    assert first.real_tries == 8 * tries


@pytest.mark.slow
def test_planners_stand_in_the_expected_order(smooth: Terrain) -> None:
    left = {
        "random": run(smooth, "random").remaining_pct,
        "osarses": run(smooth, "osarses", tries=5).remaining_pct,
        "cao": run(smooth, "cao").remaining_pct,
    }
    assert left["cao"] < left["osarses"] < left["random"]


@pytest.mark.slow
def test_the_first_term_alone_is_a_deadlock_that_the_other_terms_resolve(smooth: Terrain) -> None:
    left = {terms: run(smooth, "osarses", tries=5, objective=terms).remaining_pct for terms in ("J", "J+J1+J2", "full")}
    assert left["J"] > 80.0
    assert left["full"] < left["J"] - 20.0
    assert left["J+J1+J2"] < left["J"] - 10.0


@pytest.mark.slow
def test_polynomial_cao_learns_from_contributions_and_beats_chance(smooth: Terrain) -> None:
    by_vehicle, of_team, random = (
        run(smooth, "cao", steps=200, regressors="polynomial", contribution="vehicle").remaining_pct,
        run(smooth, "cao", steps=200, regressors="polynomial", contribution="team").remaining_pct,
        run(smooth, "random", steps=200).remaining_pct,
    )
    assert by_vehicle < of_team < random


def test_vehicles_never_touch_the_true_bottom(smooth: Terrain) -> None:
    world = World(ExploreScenario(smooth))
    deep = world.positions + np.array([0.0, 0.0, 5.0])
    lifted = world.clear(deep)
    np.testing.assert_allclose(world.cube.depth_at(lifted[:, :2]) - lifted[:, 2], 0.05)
    np.testing.assert_array_equal(world.clear(world.positions), world.positions)


@pytest.mark.parametrize("planner", ["cao", "lawnmower", "random", "rollout", "osarses"])
def test_a_lost_vehicle_does_not_stall_the_others(smooth: Terrain, planner: str) -> None:
    result = run(smooth, planner, steps=40, changes=TeamSchedule(lost=((2, 10),)), tries=2)
    assert result.history[-1] < result.history[10]


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["lawnmower", "rollout"])
@pytest.mark.parametrize(
    "happens",
    [
        {},
        {"keep_out_fraction": 0.15},
        {"changes": TeamSchedule(lost=((2, 30),))},
        {"changes": TeamSchedule(joining=((1, 30),))},
        {"robots": 2},
        {"robots": 8},
    ],
    ids=["nothing", "keep-out", "loss", "newcomer", "two", "many"],
)
def test_who_has_a_plan_finishes_whatever_happens_and_hardly_breaks_a_limit(
    smooth: Terrain, planner: str, happens: dict[str, Any]
) -> None:
    scenario = ExploreScenario(smooth, landmarks=300, steps=240, **happens)
    result = run_explore(scenario, planner, PlannerOptions(rollouts=100))
    assert result.t99 is not None
    assert result.broken_constraints <= 0.04 * scenario.robots * scenario.steps


def test_what_is_claimed_of_done_landmarks_holds_beside_walls_too() -> None:
    walls = generate("canyon", 2, width_m=80.0, height_m=80.0)
    flown = run(walls, "lawnmower", steps=150)
    assert flown.done_nees is not None
    assert flown.done_within_pct is not None
    assert 0.6 < flown.done_nees < 1.5
    assert flown.done_within_pct > 90.0
    blind = ExploreScenario(walls, landmarks=30, steps=1, sensor=RangeSensor(visibility_m=1e-6))
    assert run_explore(blind, "random", PlannerOptions()).done_nees is None


@pytest.mark.slow
def test_rollouts_finish_before_the_lawnmower_on_average() -> None:
    """Single runs differ by a tenth and more by chance."""
    floors = [generate("smooth", seed, width_m=80.0, height_m=60.0) for seed in (2, 4, 6)]
    first = {name: [run(floor, name, steps=200).t99 for floor in floors] for name in ("rollout", "lawnmower")}
    finished = {name: [t99 for t99 in steps if t99 is not None] for name, steps in first.items()}
    assert {name: len(steps) for name, steps in finished.items()} == {"rollout": 3, "lawnmower": 3}
    assert sum(finished["rollout"]) < sum(finished["lawnmower"])


def test_vehicles_keep_their_numbers_when_others_leave_and_join(smooth: Terrain) -> None:
    changes = TeamSchedule(lost=((1, 2), (4, 3)), joining=((2, 2),))
    world = World(ExploreScenario(smooth, landmarks=300, changes=changes))
    third = world.positions[2]
    teams = []
    for step in (1, 2, 3):
        world.change_team(step)
        teams.append(world.names)
    assert teams == [("auv-1", "auv-2", "auv-3"), ("auv-2", "auv-3", "auv-4", "auv-5"), ("auv-2", "auv-3", "auv-5")]
    np.testing.assert_array_equal(world.positions[1], third)
    for step in range(20):
        world.landmarks = world.measure(world.positions, world.landmarks, np.random.default_rng(step))
    assert set(world.landmarks.credited[world.landmarks.accurate]) <= {1, 2, 4}
    assert (world.landmarks.credited == 1).any()
    counted = world.evaluate(world.positions, world.landmarks, 0, []).progress.accurate
    assert counted.sum() == world.landmarks.accurate.sum()


@pytest.mark.parametrize("seed", range(5))
def test_a_newcomer_is_launched_within_range_of_a_team_member_at_its_height(smooth: Terrain, seed: int) -> None:
    scenario = ExploreScenario(
        smooth, landmarks=10, seed=seed, changes=TeamSchedule(joining=((1, 1),)), keep_out_fraction=0.15
    )
    world = World(scenario)
    heights = world.cube.depth_at(world.positions[:, :2]) - world.positions[:, 2]
    world.change_team(1)
    newcomer, others = world.positions[3], world.positions[:3]
    height = world.cube.depth_at(newcomer[None, :2])[0] - newcomer[2]
    distances = np.linalg.norm(others - newcomer, axis=1)
    horizontal = np.linalg.norm((others - newcomer)[:, :2], axis=1)
    launched_beside = np.isclose(heights, height) & (distances <= 0.8 * 0.3)
    assert launched_beside.any()
    assert (horizontal[launched_beside] >= 0.5 * 0.3 * 0.2).any()
    assert inside_area(scenario.constraints, newcomer[None, :2])[0]


def test_landmarks_lie_outside_the_keep_out_zones(smooth: Terrain) -> None:
    for landmarks in (200, None):
        scenario = ExploreScenario(smooth, landmarks=landmarks, keep_out_fraction=0.2)
        world = World(scenario)
        assert inside_area(scenario.constraints, world.truth[:, :2]).all()
        assert np.isfinite(world.truth).all()


def test_every_cell_of_known_depth_is_a_landmark_when_asked() -> None:
    z = np.random.default_rng(0).uniform(3.0, 9.0, (6, 8))
    z[2, 3] = np.nan
    world = World(ExploreScenario(Terrain(z, 2.0), landmarks=None))
    assert len(world.truth) == 47
    np.testing.assert_allclose(
        world.truth[0], [-1.0 + 0.125, -0.75 + 0.125, 0.2 + 0.8 * (z[0, 0] - np.nanmin(z)) / np.ptp(z[np.isfinite(z)])]
    )


def test_the_sea_floor_hides_what_lies_behind_it_when_asked() -> None:
    z = np.full((40, 40), 10.0)
    z[:, 19:21] = 2.0
    open_, hidden = (World(ExploreScenario(Terrain(z, 1.0), line_of_sight=los)) for los in (False, True))
    beside = np.array([[-0.1, 0.0, 0.9]])
    behind = open_.truth[:, 0] > 0.1
    assert open_.visible(beside)[0, behind].any()
    assert not hidden.visible(beside)[0, behind].any()
    before = open_.truth[:, 0] < -0.08
    np.testing.assert_array_equal(open_.visible(beside)[0, before], hidden.visible(beside)[0, before])


def test_a_broken_limit_is_counted_once_per_vehicle(smooth: Terrain) -> None:
    world = World(ExploreScenario(smooth))
    assert world.broken(world.positions) == 0
    too_far = world.positions + np.array([0.08, 0.0, 0.0])
    assert world.broken(too_far) == 3
    world.positions = world.positions + np.array([[0.0], [0.4], [0.8]])  # out of range of each other already
    nearer = world.positions - np.array([[0.0], [0.01], [0.02]])
    assert world.broken(nearer) == 0
