from typing import Any

import numpy as np
import pytest

from app.evaluation.survey.oracle import oracle_soundings
from app.evaluation.survey.symmetry import SYMMETRIES, turned, turned_soundings
from app.evaluation.survey.world import SurveyScenario, default_map, rmse_m
from app.mapping.types import Soundings
from benchmarks.planning.survey_at_sea import figures
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain


@pytest.fixture(scope="module")
def reef() -> Terrain:
    return generate("reef", 2, width_m=40.0, height_m=40.0)


@pytest.mark.parametrize("symmetry", range(SYMMETRIES))
def test_soundings_turn_with_their_sea_floor(symmetry: Any) -> None:
    terrain = generate("rugged", 1, width_m=30.0, height_m=20.0)
    rng = np.random.default_rng(symmetry)
    east, north = rng.uniform(1.0, 29.0, 50), rng.uniform(1.0, 19.0, 50)
    soundings = Soundings(east, north, terrain.depth_at(east, north), np.ones(50))
    there, floor = turned_soundings(soundings, terrain, symmetry), turned(terrain, symmetry)
    np.testing.assert_allclose(floor.depth_at(there.east_m, there.north_m), soundings.depth_m, atol=1e-9)


def test_the_symmetries_are_eight_different_ones() -> None:
    terrain = generate("rugged", 1, width_m=8.0, height_m=8.0)
    assert len({turned(terrain, k).z_m.tobytes() for k in range(SYMMETRIES)}) == SYMMETRIES


def test_an_oracle_does_better_than_the_same_number_of_random_soundings(reef: Terrain) -> None:
    scenario = SurveyScenario(reef)
    placed = oracle_soundings(scenario.log(3), reef, 150, 2.0)
    assert len(placed) == 150
    log = scenario.log(4)
    log.sound(np.column_stack([np.random.default_rng(0).uniform(0.0, 40.0, (150, 2)), np.full(150, 2.0)]))
    errors = [rmse_m(default_map(s, scenario.grid), reef)[0] for s in (placed, log.soundings)]
    assert errors[0] < errors[1]


@pytest.mark.parametrize(("sounder", "beams", "aside_m"), [("single", 1, 0.0), ("dvl", 3, 3.3), ("swath", 5, 8.0)])
def test_sounders_hear_so_many_beams_across_the_way(sounder: Any, beams: Any, aside_m: Any) -> None:
    flat = Terrain(np.full((60, 60), 10.0), 1.0)
    scenario = SurveyScenario(flat, sounder=sounder, relative_noise=1e-6)
    log = scenario.log(1)
    log.sound(np.array([[30.0, 30.0, 2.0]]), np.array([0.0]))
    soundings = log.soundings
    assert len(soundings) == beams
    np.testing.assert_allclose(soundings.depth_m, 10.0, atol=1e-3)
    np.testing.assert_allclose(soundings.north_m, 30.0, atol=1e-3)
    assert np.ptp(soundings.east_m) / 2 == pytest.approx(aside_m, abs=0.1)


def test_intervals_of_few_surveys_at_sea_are_students() -> None:
    def flown(ratio: float) -> dict[str, Any]:
        even = {"rmse_m": 1.0}
        return {"set": "demo", "terrain": "demo", "ratio": ratio, "rmse_m": ratio,
                "usual_practice": even, "coverage": even, "even": even, "lawnmower": even}  # fmt: skip

    found = figures([flown(1.0), flown(1.1)])
    assert found["demo"].startswith("1.050 ± 0.635 of 2,")
    assert found["demo, over lawnmower lines"].startswith("1.049 ± 0.635 of 2,")
