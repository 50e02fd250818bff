"""Whether the goal area is seen first, wherever the way to it leads."""

import numpy as np
import pytest

from app.estimation import Scanner
from app.evaluation.search.world import SearchScenario, explored_pct, fully_explored, run_search
from app.exploration.planner.options import PlannerOptions
from simulator.obstacles.obstacles import ObstacleWorld


def wall_across_the_goal_area() -> ObstacleWorld:
    """A wall that no chart shows cuts the goal area in two, open in the south only; far from it all is open."""
    solid = np.zeros((70, 110), dtype=np.bool_)
    solid[12:, 70:73] = True
    entry = np.array([8.5, 35.5])
    return ObstacleWorld("wall", solid, np.zeros_like(solid), 1.0, entry, np.array([70.0, 45.0]), entry)


@pytest.mark.slow
@pytest.mark.parametrize("robots", [1, 2])
def test_what_lies_behind_a_long_way_round_is_looked_at_before_the_rest_of_the_site(robots: int) -> None:
    scenario = SearchScenario(wall_across_the_goal_area(), 20.0, 420.0, robots, scanner=Scanner(8.0, 1.0))
    flown = run_search(scenario, "rollout", PlannerOptions())
    north, east = np.indices(scenario.world.solid.shape) + 0.5
    goal = np.hypot(east - scenario.world.goal_m[0], north - scenario.world.goal_m[1]) <= scenario.goal_radius_m
    assert explored_pct(flown.grid, fully_explored(scenario) & goal) > 98.0
    assert flown.collisions == 0
    assert np.hypot(*(flown.positions_m[-1, :, :2] - scenario.world.entry_m).T).max() <= 3.0 * robots
