"""Surveys at sea: the same minutes for everybody, turning circles and decisions included."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.evaluation.cli import evaluate_app
from app.evaluation.survey.dynamics import fly_pattern_at_sea, fly_planner_at_sea
from app.evaluation.survey.run import best_even_survey, judge
from app.evaluation.survey.world import SPEED_MPS, SurveyScenario
from app.exploration.core.routes import Turns
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate
from simulator.floors.terrain_files import save_npz

MINUTES = 1.5
QUICK = PlannerOptions(search=50, candidates=16)


@pytest.fixture
def scenario() -> SurveyScenario:
    return SurveyScenario(generate("smooth", 3, width_m=60.0, height_m=60.0), vehicles=2, steps=30, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["cao", "lawnmower", "random"])
def test_everybody_flies_for_the_same_minutes(scenario: SurveyScenario, planner: str) -> None:
    track = fly_planner_at_sea(scenario, planner, QUICK, MINUTES)
    most_m = 1.15 * 60.0 * MINUTES * SPEED_MPS  # through the water, diving included
    assert (track.flown_m <= most_m).all()
    assert (track.on_plan_m <= track.flown_m).all()
    if planner != "lawnmower":  # which circles once its lines are flown
        assert (track.flown_m >= 0.7 * 60.0 * MINUTES * SPEED_MPS).all()
    places = track.soundings
    margin_m = 15.0  # of a turning circle at the border
    assert (places.east_m > -margin_m).all()
    assert (places.east_m < 60.0 + margin_m).all()


@pytest.mark.slow
def test_the_same_seed_flies_the_same_survey(scenario: SurveyScenario) -> None:
    first, again = (fly_planner_at_sea(scenario, "cao", QUICK, 1.0) for _ in range(2))
    np.testing.assert_array_equal(first.soundings.depth_m, again.soundings.depth_m)
    np.testing.assert_array_equal(first.flown_m, again.flown_m)


def test_a_pattern_has_the_lines_that_can_be_finished(scenario: SurveyScenario) -> None:
    turns = Turns(5.0, 0.0)
    track = fly_pattern_at_sea(scenario, lambda metres: best_even_survey(scenario, metres, turns), MINUTES)
    assert track.finished
    assert (track.on_plan_m > 0.8 * track.flown_m).all()
    assert (track.flown_m <= 1.15 * 60.0 * MINUTES * SPEED_MPS).all()


def test_minutes_in_which_no_pattern_can_be_finished_are_compared_all_the_same(scenario: SurveyScenario) -> None:
    track = fly_pattern_at_sea(scenario, lambda metres: None, MINUTES)
    assert len(track.soundings) == 0
    np.testing.assert_array_equal(track.flown_m, [0.0, 0.0])
    assert judge(scenario, track.soundings, track.flown_m, yardstick=True).samples == 0


@pytest.mark.slow
def test_the_command_tells_minutes_and_metres(tmp_path: Path) -> None:
    floor = tmp_path / "floor.npz"
    save_npz(generate("smooth", 5, width_m=40.0, height_m=40.0), floor)
    words = ["survey", "--terrain", str(floor), "--dynamics", "--minutes", "1", "--steps", "10", "--json"]
    result = CliRunner().invoke(evaluate_app, words)
    assert result.exit_code == 0, result.output
    run = json.loads(result.stdout)
    assert run["minutes"] == 1.0
    assert 0.0 < run["on_plan_m"] <= run["flown_m"] <= 1.15 * 2 * 60.0 * SPEED_MPS
    assert run["ratio"] > 0.0
    refused = CliRunner().invoke(evaluate_app, [*words[:3], "--minutes", "2"])
    assert refused.exit_code == 2
    assert "--dynamics" in refused.output
