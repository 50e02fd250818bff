import numpy as np
import pytest

from app.evaluation.cube_world import CubeTerrain, ExploreScenario, World
from app.evaluation.explore import run_explore
from app.exploration.options import PlannerOptions
from simulator.seafloors import generate


@pytest.fixture(scope="module")
def smooth():
    return generate("smooth", 2, width_m=80.0, height_m=60.0)


def run(terrain, planner, steps=120, seed=0, **options):
    scenario = ExploreScenario(terrain, landmarks=300, steps=steps, seed=seed)
    return run_explore(scenario, planner, PlannerOptions(**options))


def test_the_cube_keeps_the_aspect_and_casts_depths(smooth):
    cube = CubeTerrain(smooth)
    assert cube.half.tolist() == [1.0, 0.75]
    axis = np.linspace(-1, 1, 200)
    depth = cube.depth_at(np.stack(np.meshgrid(axis, 0.75 * axis), axis=-1))
    assert 0.2 <= depth.min() < 0.25
    assert 0.95 < depth.max() <= 1.0


def test_remaining_landmarks_only_ever_decrease(smooth):
    result = run(smooth, "cao")
    assert (np.diff(result.history) <= 0.0).all()
    assert result.remaining_pct == result.history[-1]
    assert result.real_tries == 0


@pytest.mark.parametrize("planner", ["cao", "lawnmower", "random", "osarses"])
def test_same_seed_same_run(smooth, planner):
    first, second = (run(smooth, planner, steps=15, tries=2) for _ in range(2))
    assert first.history == second.history
    assert first.distance == second.distance
    assert first.real_tries == (30 if planner == "osarses" else 0)


def test_planners_stand_in_the_expected_order(smooth):
    left = {
        "random": run(smooth, "random").remaining_pct,
        "osarses": run(smooth, "osarses", tries=5).remaining_pct,
        "cao": run(smooth, "cao").remaining_pct,
    }
    assert left["cao"] < left["osarses"] < left["random"]


def test_vehicles_never_touch_the_true_bottom(smooth):
    world = World(ExploreScenario(smooth))
    deep = world.positions + np.array([0.0, 0.0, 5.0])
    lifted = world.clear(deep)
    np.testing.assert_allclose(world.cube.depth_at(lifted[:, :2]) - lifted[:, 2], 0.05)
    np.testing.assert_array_equal(world.clear(world.positions), world.positions)
