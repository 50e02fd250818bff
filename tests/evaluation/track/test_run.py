"""The dynamic case in closed loop, small."""

import json
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from typer.testing import CliRunner

from app.arrays import FloatArray
from app.estimation import Fading, Landmarks3D
from app.evaluation.cli import evaluate_app
from app.evaluation.track import consistency
from app.evaluation.track.plain_ekf import PlainEkf
from app.evaluation.track.presumed import Presumed
from app.evaluation.track.report import markdown
from app.evaluation.track.run import run_track
from app.evaluation.track.setups import TrackJob, experiments, report_jobs
from app.evaluation.track.trace_greedy import foretold_trace
from app.evaluation.track.world import TrackScenario, TrackWorld
from app.exploration.core.problem import Proposal
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate

FLOOR = generate("rugged", 1, width_m=50.0, height_m=50.0)
OPTIONS = PlannerOptions(rollouts=5, candidates=8)
SMALL = TrackScenario(FLOOR, landmarks=150, steps=12)
FADING = TrackScenario(landmarks=60, steps=60, fading=Fading(drift=0.06))


def figures(run: Any) -> Any:
    return {k: v for k, v in asdict(run).items() if k not in ("wall_s", "plan_ms_median", "plan_ms_p99")}


@pytest.mark.parametrize("planner", [pytest.param("rollout", marks=pytest.mark.slow), "cao", "lawnmower", "random"])
def test_the_same_seed_gives_the_same_run(planner: Any) -> None:
    first, second = (run_track(SMALL, planner, OPTIONS) for _ in range(2))
    assert figures(first) == figures(second)


def test_vehicles_keep_the_clearance_and_know_where_they_are_without_fading() -> None:
    world = TrackWorld(SMALL)
    for _ in range(10):
        world.move(world.positions + np.array([0.02, 0.01, 0.04]))
        floor = world._cube.depth_at(world.positions[:, :2])
        assert (floor - world.positions[:, 2] >= SMALL.clearance - 1e-9).all()
    assert world.localization_errors().max() == 0.0


def test_whom_its_altimeter_lifts_gets_less_far_in_a_step() -> None:
    class AlongTheBottom:
        def propose(self, situation: Any, rng: np.random.Generator) -> Proposal:
            """Whole steps to the east, as deep as vehicles may go by what is known, whatever the floor does."""
            move = situation.constraints.max_step_m * (1.0 - 1e-9) * np.array([1.0, 0.0, 0.0])
            return Proposal(situation.positions + move, 0.0)

    places: list[FloatArray] = []
    scenario = replace(SMALL, seed=3)
    world = TrackWorld(scenario)
    with patch("app.evaluation.track.run.create_planner", lambda *_: AlongTheBottom()):
        run = run_track(scenario, "random", OPTIONS, observe=lambda positions, *_: places.append(positions.copy()))
    legs = np.diff(np.array([world.positions, *places]), axis=0)
    step = scenario.constraints.max_step_m
    lifted = legs[..., 2] < -0.1 * step
    assert lifted.any(), "the floor rises somewhere"
    assert np.linalg.norm(legs, axis=2)[lifted] == pytest.approx(step, rel=1e-6)
    assert (legs[~lifted][:, 0] > 0.99 * step).all()
    assert run.broken_constraints == 0
    floor = world._cube.depth_at(np.concatenate(places)[:, :2])
    assert (floor - np.concatenate(places)[:, 2] >= scenario.clearance - 1e-9).all()


def test_drift_that_is_reckoned_with_breaks_no_limit() -> None:
    assert run_track(FADING, "random", OPTIONS).broken_constraints == 0


def test_nobody_is_told_where_an_unseen_landmark_is() -> None:
    """Two worlds whose landmarks differ look the same before anything is seen."""
    far = replace(SMALL, visibility=0.01)
    one, other = TrackWorld(far), TrackWorld(far)
    other.truth = np.random.default_rng(5).permutation(other.truth) * [1.0, -1.0, 1.0]
    np.testing.assert_array_equal(one.belief.xy_m, other.belief.xy_m)
    assert np.isinf(one.belief.sd_m).all()


def test_presumed_places_keep_to_what_nobody_looked_at() -> None:
    presumed = Presumed(np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]]), 0.4, flat=True)
    everywhere = presumed.places(800, np.zeros((0, 3)))
    assert abs(everywhere[:, 0].mean()) < 0.02
    cells = len(presumed.middles)
    for x in np.arange(-1.0, 0.01, 0.1):
        for y in np.arange(-1.0, 1.01, 0.1):
            presumed.look(np.array([[x, y, 0.3]]), np.full((1, cells), 0.5))
    later = presumed.places(800, np.array([[-0.5, -0.5, 0.5]]))
    assert np.mean(later[:, 0] > 0.0) > 0.7
    assert presumed.places(0, np.zeros((0, 3))).shape == (0, 3)


def test_where_several_vehicles_looked_in_vain_less_is_presumed_than_where_one_did() -> None:
    presumed = Presumed(np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]]), 0.4, flat=True)
    floor = np.full((1, len(presumed.middles)), 0.5)
    for east in np.linspace(-1.0, 1.0, 41):
        for north in np.linspace(-1.0, 1.0, 11):
            for _ in range(4 if east < 0.0 else 1):
                presumed.look(np.array([[east, north, 0.3]]), floor)
    assert (presumed.looks > 0).all()
    places = presumed.places(100, np.zeros((0, 3)))
    assert np.mean(places[:, 0] > 0.0) > 0.95


def test_a_vehicle_surfaces_when_needed_and_localization_becomes_good_again() -> None:
    run = run_track(FADING, "cao", OPTIONS)
    assert run.resurfacings >= 1
    assert run.needless_resurfacings == 0
    assert run.localization_ok_pct is not None
    assert run.localization_ok_pct > 80.0


def test_ranges_and_own_fixes_serve_where_fixes_are_not_shared() -> None:
    run = run_track(replace(FADING, shared_fix=False), "cao", OPTIONS)
    assert run.resurfacings >= 2


@pytest.mark.parametrize(("noise", "fixed"), [(0.1, 0.0), (0.0, 0.1)])
def test_the_foretold_trace_is_that_of_a_slow_reference(noise: Any, fixed: Any) -> None:
    rng = np.random.default_rng(0)
    points, team = rng.uniform(-1, 1, (4, 3)), rng.uniform(-1, 1, (1, 3, 3))
    covariances = np.array([a @ a.T + 0.1 * np.eye(3) for a in rng.standard_normal((4, 3, 3))])
    expected = 0.0
    for point, P in zip(points, covariances, strict=True):
        for place in team[0]:
            u = point - place
            r = np.linalg.norm(u)
            H = u[None] / r
            S = H @ P @ H.T + noise**2 * (r**2 + H @ P @ H.T) + fixed**2
            P = P - P @ H.T @ H @ P / S
        expected += np.trace(P)
    assert foretold_trace(team, points, covariances, np.full(4, np.inf), noise, fixed)[0] == pytest.approx(expected)


def test_a_filter_that_takes_its_noise_to_be_fixed_believes_ranges_from_afar_too_much() -> None:
    box = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    far = (0, np.array([-1.0, 0.0, -1.0]), np.array([0]), np.array([1.8]))
    knows, believes = (PlainEkf(0.1, 0.05, box, fixed).update(Landmarks3D.unknown(1), *far) for fixed in (None, 0.05))
    assert np.trace(believes.covariance_m2[0]) < np.trace(knows.covariance_m2[0])


@pytest.mark.parametrize(("part", "expected"), [(1.0, 3.0), (0.2, 75.0)])
def test_a_run_tells_whether_claimed_deviations_hold(part: float, expected: float) -> None:
    """Claimed at a fifth, deviations make the normalised squared error 25 times as large; all errors stay small."""

    class Known(TrackWorld):
        def sense(self, rng: np.random.Generator) -> None:
            n = len(self.truth)
            covariance = np.repeat((part * 0.02) ** 2 * np.eye(3)[None], n, axis=0)
            place = self.truth + 0.02 * np.random.default_rng(0).standard_normal((n, 3))
            known = Landmarks3D.unknown(n)
            self.known = replace(known, position_m=place, covariance_m2=covariance, accurate=np.arange(n) > 20)

    with patch("app.evaluation.track.run.TrackWorld", Known):
        run = run_track(replace(SMALL, steps=1), "lawnmower", OPTIONS)
    assert run.accurate_nees == pytest.approx(expected, rel=0.2)
    assert run.wrongly_accurate_pct == 0.0


def test_who_knows_nothing_accurately_has_no_deviations_to_hold() -> None:
    assert run_track(replace(SMALL, steps=1), "random", OPTIONS).accurate_nees is None


def test_runs_that_were_kept_without_a_figure_are_reported_too() -> None:
    experiment = experiments(12)[0]
    jobs = list(report_jobs([experiment], FLOOR, [0, 1], 5))
    job = next(job for job in jobs if job.planner == "random")
    kept = {**asdict(run_track(SMALL, "random", OPTIONS)), "key": job.key}
    del kept["accurate_nees"]
    text = markdown(jobs, {job.key: kept}, [experiment], {}, [], {})
    assert "NEES of A" not in text
    text = markdown(jobs, {job.key: {**kept, "accurate_nees": 3.21}}, [experiment], {}, [], {})
    assert "| NEES of A (3) |" in text
    assert "| 3.2 |" in text


def test_runs_that_were_kept_before_a_scenario_learned_more_are_found_again() -> None:
    assert "fixed_noise" not in TrackJob("figure1", "cao", SMALL, OPTIONS).key
    assert "fixed_noise" in TrackJob("figure1", "cao", replace(SMALL, fixed_noise=0.1), OPTIONS).key


def call(*arguments: Any) -> Any:
    return CliRunner().invoke(evaluate_app, ["track", *arguments])


def test_the_command_prints_one_object_with_the_contracts_figures() -> None:
    result = call("--landmarks", "40", "--steps", "5", "--planner", "random", "--json")
    run = json.loads(result.stdout)
    contract = {
        "remaining_pct", "target_tracked_pct", "localization_ok_pct", "resurfacings", "needless_resurfacings",
        "sum_of_error",
    }  # fmt: skip
    assert contract <= run.keys()
    assert run["landmarks"] == 40


def test_a_report_is_made_taken_up_again_and_counts_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A hundred runs of every filter take most of a report's time; what they find is tested with the filters.
    monkeypatch.setattr(consistency, "consistency", partial(consistency.consistency, runs=4))
    arguments = ("--write", str(tmp_path), "--only", "ngcuv12-own-fix", "--steps", "12", "--seeds")
    assert call(*arguments, "0:1").exit_code == 0
    lines = (tmp_path / "tracking.jsonl").read_text().splitlines()
    assert len(lines) == 1
    assert "incomplete" not in (tmp_path / "tracking.md").read_text()
    assert (tmp_path / "tracking.md").read_text().count("| 4 |") == 6
    assert call(*arguments, "0:2", "--no-run").exit_code == 0
    assert "1 of 2 runs are still missing" in (tmp_path / "tracking.md").read_text()
    assert (tmp_path / "tracking.jsonl").read_text().splitlines() == lines


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--setup", "auro15"), "none of med13, ngcuv12"),
        (("--own-fix",), "vehicles know where they are"),
        (("--no-run",), "goes with --write only"),
        (("--planner", "osarses"), "choose from"),
        (("--write", "x", "--only", "figure7"), "choose from"),
        (("--write", "x", "--no-run", "--planner", "cao"), "Invalid value for --planner: the report of --write flies"),
        (("--write", "x", "--no-run", "--own-fix", "--setup", "ngcuv12"), "Invalid value for --setup: the report"),
        (("--seed", "3", "--seeds", "0:2"), "Invalid value for --seed: --seeds names the seeds"),
        (("--seed", "-1"), "Invalid value for '--seed'"),
        (("--write", "x", "--scheduler", "nowhere"), "Invalid value for --scheduler: no Dask cluster answers"),
    ],
)
def test_what_cannot_be_is_refused_with_what_would_be_right(
    arguments: Any, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call(*arguments)
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", "").split())
