from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from app.evaluation.survey.baselines import lawnmower_baseline, lawnmower_baselines
from app.evaluation.survey.flown import fly_lawnmower
from app.evaluation.survey.run import best_even_survey, run_survey
from app.evaluation.survey.world import SurveyScenario, along, default_map, fly_planner, rmse_m
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain

QUICK = PlannerOptions(search=40)


@pytest.fixture(scope="module")
def harbour() -> Terrain:
    return generate("harbour", 1, width_m=60.0, height_m=60.0)


def test_continuous_soundings_cover_the_leg_and_steps_only_its_end() -> None:
    start, end = np.array([0.0, 0.0, 2.0]), np.array([3.0, 4.0, 2.0])
    points, since = along(start, end, "step")
    assert (points.tolist(), since) == ([end.tolist()], 0.0)
    points, since = along(start, end, "continuous")
    gaps = np.linalg.norm(np.diff(np.vstack([start, points]), axis=0), axis=1)
    assert gaps == pytest.approx(np.full(len(points), 0.26))
    assert since == pytest.approx(5.0 - 0.26 * len(points))
    assert np.linalg.norm(end - points[-1]) == pytest.approx(since)


@given(legs=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=20))
def test_a_sounder_does_not_begin_anew_with_each_leg(legs: Any) -> None:
    ends = np.cumsum([0.0, *legs])
    since, found = 0.0, []
    for start, end in pairwise(ends):
        points, since = along(np.array([start, 0.0, 2.0]), np.array([end, 0.0, 2.0]), "continuous", since)
        found += points[:, 0].tolist()
    assert abs(len(found) - ends[-1] / 0.26) < 1.0 + 1e-6
    assert found == pytest.approx(0.26 * np.arange(1, len(found) + 1), abs=1e-6)


@pytest.mark.slow
def test_a_run_is_reproducible_and_obeys_its_constraints(harbour: Terrain) -> None:
    scenario = SurveyScenario(harbour, steps=6, seed=3)
    first, second = (fly_planner(scenario, "cao", QUICK) for _ in range(2))
    np.testing.assert_array_equal(first.positions_m, second.positions_m)
    np.testing.assert_array_equal(first.soundings.depth_m, second.soundings.depth_m)
    for before, after in zip(first.positions_m[:-1], first.positions_m[1:], strict=True):
        assert scenario.constraints.feasible(before, after[None])[0]


@pytest.mark.slow
def test_a_survey_run_reports_the_planner_beside_its_yardsticks(harbour: Terrain) -> None:
    run = run_survey(SurveyScenario(harbour, steps=8, seed=0), "cao", QUICK)
    relief = float(np.std(harbour.z_m))
    for result in (run, run.usual_practice, run.coverage, run.even, run.oracle):
        assert 0.0 < result.rmse_m < relief
        assert result.l2_norm == pytest.approx(result.rmse_m * 60.0, rel=1e-6)
        assert 0.0 <= result.coverage_pct <= 100.0
        assert result.distance_m <= 2 * 80.0 + 1e-6
    assert run.usual_practice.distance_m <= run.distance_m + 1e-6
    assert run.ratio == pytest.approx(run.rmse_m / min(r.rmse_m for r in (run.usual_practice, run.coverage, run.even)))
    assert run.recorded_track is None


@pytest.mark.slow
def test_baselines_travel_as_far_and_sound_as_often(harbour: Terrain) -> None:
    scenario = SurveyScenario(harbour)
    pair = lawnmower_baselines(harbour, scenario.constraints, scenario.starts_m, 300.0, 4000, scenario.grid)
    assert 400.0 < pair.same_distance.distance_m <= 600.0
    assert 2800 < pair.same_soundings.samples <= 4002
    assert pair.same_soundings.rmse_m < pair.same_distance.rmse_m


def test_a_flown_lawnmower_finishes_its_lines_within_the_distance_that_it_is_given(harbour: Terrain) -> None:
    scenario = SurveyScenario(harbour)
    soundings, flown_m = fly_lawnmower(
        harbour, scenario.constraints, scenario.starts_m, 250.0, relative_noise=0.01, seed=0
    )
    assert flown_m <= 500.0
    # Every part of the area is passed: no line was left half flown.
    tree = cKDTree(np.column_stack([soundings.east_m, soundings.north_m]))
    assert tree.query(scenario.grid.centres_m)[0].max() < 12.0
    truth = harbour.depth_at(soundings.east_m, soundings.north_m)
    deviation = (soundings.depth_m - truth) / soundings.sd_m
    assert np.abs(deviation).mean() < 1.5


@pytest.mark.slow
def test_floors_with_holes_are_surveyed_also_when_the_first_place_gives_no_echo() -> None:
    floor = generate("reef", 1, width_m=40.0, height_m=40.0)
    holes = floor.z_m.copy()
    holes[:14, :20] = np.nan
    run = run_survey(SurveyScenario(replace(floor, z_m=holes), 2, 6, 10.0), "cao", PlannerOptions(search=40))
    assert 0.0 < run.rmse_m < 3.0
    assert 0.0 < run.even.rmse_m < 3.0
    nothing = Terrain(np.where(np.isnan(holes), 5.0, np.nan), 1.0)
    short = run_survey(SurveyScenario(nothing, 1, 2, 0.4, "step"), "lawnmower", PlannerOptions())
    assert short.samples <= 3


def test_even_lines_are_whole_and_fit_into_the_distance() -> None:
    scenario = SurveyScenario(generate("reef", 1), 2, 60, 10.0)
    routes = best_even_survey(scenario, 600.0)
    assert routes is not None
    for start, route in zip(scenario.starts_m[:, :2], routes, strict=True):
        legs = np.diff(np.vstack([start, route]), axis=0)
        assert np.hypot(*legs.T).sum() <= 600.0
        lines = legs[1::2]
        np.testing.assert_allclose(np.hypot(*lines.T), 99.0, atol=1e-6)


@pytest.mark.slow
def test_the_default_planner_beats_the_lawnmower_where_detail_is_concentrated() -> None:
    ratios = []
    for seed in (1, 2):
        scenario = SurveyScenario(generate("harbour", seed, width_m=60.0, height_m=60.0), steps=28, seed=seed)
        track = fly_planner(scenario, "cao", PlannerOptions())
        ours, _ = rmse_m(default_map(track.soundings, scenario.grid), scenario.terrain)
        lawnmower = lawnmower_baseline(
            scenario.terrain,
            scenario.constraints,
            scenario.starts_m,
            float(track.distance_m.mean()),
            scenario.grid,
        )
        ratios.append(ours / lawnmower.rmse_m)
    assert np.exp(np.mean(np.log(ratios))) < 1.0


@pytest.mark.terrains
def test_recorded_track_is_compared_where_the_terrain_has_one(terrains: Path) -> None:
    from app.evaluation.survey.recorded import recorded_soundings

    recorded = recorded_soundings(terrains / "leixoes_sharp.npz")
    assert recorded is not None
    assert len(recorded) == 2560
    assert recorded_soundings(terrains / "leixoes_slope.npz") is None
