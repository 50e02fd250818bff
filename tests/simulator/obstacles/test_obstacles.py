"""Worlds of obstacles: car parks and a harbour."""

import numpy as np
import pytest
from scipy.ndimage import label

from simulator.obstacles.car_parks import SCENARIOS, car_park, harbour_basin
from simulator.obstacles.obstacles import ObstacleWorld

WORLDS = [car_park(scenario, seed) for scenario in SCENARIOS for seed in (0, 3)] + [harbour_basin(0), harbour_basin(5)]


@pytest.mark.parametrize("world", WORLDS, ids=lambda world: world.name)
def test_a_robot_gets_from_the_entry_to_the_goal(world: ObstacleWorld) -> None:
    assert (world.clearance_m(np.array([world.entry_m, world.goal_m])) > 2.0).all()
    north, east = np.indices(world.solid.shape) + 0.5
    clear = world.clearance_m(np.column_stack([east.ravel(), north.ravel()])).reshape(world.solid.shape) >= 1.0
    parts, _ = label(clear)
    (a, b), (c, d) = world.entry_m.astype(int)[::-1], world.goal_m.astype(int)[::-1]
    assert parts[a, b] == parts[c, d] != 0


@pytest.mark.parametrize("world", WORLDS, ids=lambda world: world.name)
def test_some_obstacles_are_known_beforehand_and_most_of_the_others_are_not(world: ObstacleWorld) -> None:
    assert world.known.any()
    assert not (world.known & ~world.solid).any()
    assert (world.solid & ~world.known).sum() > 200


def test_the_third_car_park_traps_who_goes_straight_for_the_goal() -> None:
    for seed in range(3):
        world = car_park(3, seed)
        along = np.linspace(0.0, 1.0, 1000)[:, None]
        straight = world.entry_m + along * (world.goal_m - world.entry_m)
        hit = straight[world.clearance_m(straight) == 0.0][0]
        # Where the straight way ends the wall goes on to both sides for 25 m and more, without a gap.
        solid = world.solid & ~world.known
        corner = int(np.flatnonzero(solid[:, 50])[np.flatnonzero(solid[:, 50]) > 30][0])
        assert solid[corner, 30:corner].all()
        assert solid[30:corner, corner].all()
        assert hit.max() <= corner + 3


def test_the_same_seed_draws_the_same_and_another_another() -> None:
    assert np.array_equal(car_park(2, 4).solid, car_park(2, 4).solid)
    assert not np.array_equal(car_park(2, 4).solid, car_park(2, 5).solid)
    with pytest.raises(ValueError, match=r"scenario is 4; it must be one of 1, 2, 3"):
        car_park(4)


def test_clearance_is_the_distance_to_the_closest_edge() -> None:
    solid = np.zeros((10, 10), dtype=bool)
    solid[5, 5] = True
    corner = np.array([0.5, 0.5])
    world = ObstacleWorld("one", solid, solid, 2.0, corner, corner, corner)
    at = np.array([[11.0, 11.0], [8.0, 11.0], [14.0, 14.0], [-1.0, 3.0]])
    assert world.clearance_m(at) == pytest.approx([0.0, 2.0, np.hypot(2.0, 2.0), 0.0])
