from typing import Any

import numpy as np
import pytest

from app.evaluation.explore.run import ExploreRun, run_explore
from app.evaluation.explore.team_changes import TeamSchedule
from app.evaluation.explore.teams import SILENT_AFTER, LimitedTeam, UnlimitedTeam
from app.evaluation.explore.world import ExploreScenario, World
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain


@pytest.fixture(scope="module")
def smooth() -> Terrain:
    return generate("smooth", 2, width_m=80.0, height_m=60.0)


def run(terrain: Terrain, planner: str = "cao", steps: int = 100, **settings: Any) -> ExploreRun:
    scenario = ExploreScenario(terrain, landmarks=300, steps=steps, **settings)
    return run_explore(scenario, planner, PlannerOptions())


def limited(terrain: Terrain, capacity: int = 10, loss: float = 0.0, **settings: Any) -> tuple[World, LimitedTeam]:
    world = World(ExploreScenario(terrain, landmarks=200, capacity=capacity, **settings))
    return world, LimitedTeam(world, capacity, loss, np.random.default_rng(0))


def test_the_planner_is_given_only_what_was_transmitted(smooth: Terrain) -> None:
    world, team = limited(smooth, capacity=2)
    noise = np.random.default_rng(1)
    team.sense(noise)
    vehicles, positions, belief = team.report(1)
    assert vehicles.tolist() == [0, 1, 2]
    np.testing.assert_allclose(positions, world.positions, atol=1e-6)
    assert 0 < np.isfinite(belief.depth_m).sum() <= 3 * 2 < team.landmarks.seen.sum()
    everything = UnlimitedTeam(World(world.scenario))
    everything.sense(noise)
    _, _, whole = everything.report(1)
    np.testing.assert_array_equal(np.isfinite(whole.depth_m), team.landmarks.seen)


@pytest.mark.slow
def test_small_messages_cost_something_and_even_one_entry_is_of_use(smooth: Terrain) -> None:
    """While the bulk is being done, on average: single runs of cao differ by as much as messages cost, or more."""
    free, ten, one = (
        [run(smooth, steps=90, capacity=capacity, seed=seed) for seed in range(4)] for capacity in (None, 10, 1)
    )
    remaining = [float(np.mean([each.remaining_pct for each in runs])) for runs in (free, ten, one)]
    assert remaining[0] < 40.0
    assert max(remaining[1:]) < remaining[0] + 25.0
    for unlimited, more, less in zip(free, ten, one, strict=True):
        assert unlimited.message_bytes == 0 < less.message_bytes < more.message_bytes <= 90 * 3 * (64 + 64 + 20)


def test_same_seed_same_run_also_when_messages_are_lost(smooth: Terrain) -> None:
    first, second = (run(smooth, steps=20, capacity=5, message_loss=0.3) for _ in range(2))
    assert first.history == second.history
    assert first.message_bytes == second.message_bytes


def test_what_anyone_knows_never_becomes_less_and_lost_messages_do_not_stall_the_team(smooth: Terrain) -> None:
    result = run(smooth, steps=150, capacity=5, message_loss=0.3)
    assert (np.diff(result.history) <= 0.0).all()
    assert result.remaining_pct < 60.0


def test_a_silent_vehicle_stays_and_is_left_out_until_it_is_heard_again(smooth: Terrain) -> None:
    world, team = limited(smooth)
    noise = np.random.default_rng(1)
    arrives = team._arrives
    silent = {"on": True}
    team._arrives = lambda message: message[1] != 1 or not silent["on"]
    start = world.positions.copy()
    for step in range(1, SILENT_AFTER + 3):
        team.sense(noise)
        vehicles, positions, _ = team.report(step)
        assert vehicles.tolist() == [0, 2]
        world.positions = world.clear(team.order(vehicles, positions + np.array([0.02, 0.0, 0.0])))
    assert np.abs(world.positions[[0, 2]] - start[[0, 2]]).max() > 0.1
    np.testing.assert_array_equal(world.positions[1], start[1])
    silent["on"] = False
    vehicles, positions, _ = team.report(step + 1)
    assert vehicles.tolist() == [0, 1, 2]
    team._arrives = arrives


def test_a_vehicle_that_is_lost_is_missed_after_a_while_and_a_new_one_takes_part_at_once(smooth: Terrain) -> None:
    world, team = limited(smooth, changes=TeamSchedule(lost=((2, 3),), joining=((1, 3),)))
    noise, there = np.random.default_rng(1), []
    for step in range(1, SILENT_AFTER + 5):
        world.change_team(step)
        team.sense(noise)
        vehicles, positions, _ = team.report(step)
        there.append(vehicles.tolist())
        world.positions = team.order(vehicles, positions)
    assert there[1] == [0, 1, 2]
    assert there[2] == [0, 1, 2, 3]
    assert there[-1] == [0, 2, 3]


def test_no_leg_is_longer_than_a_step_though_the_station_plans_from_an_old_position(smooth: Terrain) -> None:
    world, team = limited(smooth, loss=0.5)
    noise, radio = np.random.default_rng(1), np.random.default_rng(2)
    for step in range(1, 15):
        team.sense(noise)
        vehicles, positions, _ = team.report(step)
        move = radio.standard_normal(positions.shape)
        waypoints = positions + 0.05 * move / np.linalg.norm(move, axis=1, keepdims=True)
        after = team.order(vehicles, waypoints)
        assert (np.linalg.norm(after - world.positions, axis=1) <= 0.05 * (1 + 1e-9)).all()
        world.positions = after


def test_what_cannot_be_run_is_said(smooth: Terrain) -> None:
    with pytest.raises(ValueError, match="65536 landmarks"):
        ExploreScenario(smooth, landmarks=70_000, capacity=10)
    newcomers = TeamSchedule(joining=((200, 2), (54, 3)))
    with pytest.raises(ValueError, match="256 vehicles, not 257; let 1 fewer join"):
        ExploreScenario(smooth, landmarks=10, capacity=3, changes=newcomers)
    assert ExploreScenario(smooth, landmarks=10, robots=2, capacity=3, changes=newcomers).changes is newcomers
    assert ExploreScenario(smooth, landmarks=10, changes=newcomers).capacity is None
    with pytest.raises(ValueError, match="set a capacity"):
        ExploreScenario(smooth, message_loss=0.1)
    with pytest.raises(ValueError, match="leave the capacity out"):
        run(smooth, "osarses", steps=3, capacity=10)
