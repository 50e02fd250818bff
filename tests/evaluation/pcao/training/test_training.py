"""PCAO18's simulation, its yardsticks and the training: against slow references, and killed in the middle."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.estimation import Landmarks, landmark_sets
from app.estimation.beams import Attitude, Multibeam
from app.evaluation.pcao.simulation.kernel import KnownLandmarks, floor_at, fly, meets, unknown
from app.evaluation.pcao.simulation.oracles import FDSA, SE, SPSA, _credits, _progress, fly_tried, tries_per_step
from app.evaluation.pcao.simulation.task import TrainingTask
from app.evaluation.pcao.simulation.world import SONAR, SeaFloor
from app.evaluation.pcao.terrains import sea_floor, sea_floors_of
from app.evaluation.pcao.training.optimisers import METHODS, regressors, step_size
from app.evaluation.pcao.training.scoring import LocalScorer
from app.evaluation.pcao.training.training import Checkpoint, CheckpointError, make_optimiser, train
from app.exploration.core.objective import objective
from app.exploration.pcao.controller import gains
from app.exploration.pcao.model import PcaoModel, Training, default_model
from simulator.floors.terrain import TerrainError

SMALL: dict[str, Any] = {"robots": 2, "landmarks": 60, "steps": 12}


@pytest.fixture(scope="module")
def floor() -> Any:
    return SeaFloor(sea_floor("harbour:3"))


@pytest.fixture(scope="module")
def task(floor: Any) -> Any:
    return TrainingTask((floor, SeaFloor(sea_floor("ridge:3"))), (0, 1), **SMALL)


@pytest.mark.parametrize("sonar", [SONAR, Multibeam(0.1, 0.4, 0.3, 1, 0.0), Multibeam(0.1, 0.3, 0.05, 9, 1.2)])
def test_the_kernels_beams_meet_what_the_sonars_do(floor: SeaFloor, sonar: Multibeam) -> None:
    physics = replace(floor, sonar=sonar).physics
    rng = np.random.default_rng(0)
    landmarks = np.column_stack([rng.uniform(-0.4, 0.4, (400, 2)), rng.uniform(-0.1, 0.5, 400)])
    for heading in rng.uniform(0, 2 * np.pi, 6):
        expected = sonar.meets(np.zeros(3), Attitude(heading), landmarks)
        turn = np.sin(heading), np.cos(heading)
        got = [meets(physics, east, north, up, *turn) >= 0.0 for east, north, up in landmarks]
        np.testing.assert_array_equal(got, expected)
    assert 0 < expected.sum() < 400


def test_the_kernels_floor_is_the_terrains(floor: SeaFloor) -> None:
    xy = np.random.default_rng(1).uniform(-1.0, 1.0, (300, 2))
    expected = floor.cube.depth_at(xy)
    got = [floor_at(floor.raster, floor.physics, x, y) for x, y in xy]
    np.testing.assert_allclose(got, expected, atol=1e-12)


@pytest.mark.slow
def test_a_flight_never_loses_what_it_knows_and_repeats_itself(floor: SeaFloor, task: TrainingTask) -> None:
    parameters = default_model().parameters
    remaining, error = task.run(floor, 5, parameters)
    assert (np.diff(remaining) <= 0).all()
    assert (np.diff(error) <= 1e-12).all()
    again, _ = task.run(floor, 5, parameters)
    np.testing.assert_array_equal(remaining, again)
    assert task.cost(remaining, error) == pytest.approx((error[:-1].sum() + 10.0 * remaining[-1]) / 12)


def test_the_tries_are_judged_by_the_objective(floor: SeaFloor) -> None:
    """J1, J2 and J3 of the compiled yardsticks are those of app.exploration.core.objective."""
    rng = np.random.default_rng(2)
    m, n = 50, 3
    points = np.column_stack([rng.uniform(-1, 1, (m, 2)), rng.uniform(0.2, 1, m)])
    looks = rng.integers(0, 3, m)
    depth = np.where(looks > 0, points[:, 2], np.nan)
    accurate = (looks > 0) & (rng.random(m) < 0.4)
    credited = np.where(accurate, rng.integers(0, n, m), -1)
    visible = (rng.random((n, m)) < 0.2) & (looks > 0)
    positions = np.column_stack([rng.uniform(-1, 1, (n, 2)), np.full(n, 0.2)])
    known = KnownLandmarks(depth, np.where(looks > 0, 0.01, np.inf), looks, accurate, credited)
    progress, J3 = _progress(positions, points, known, visible, _credits(known, n))
    landmarks = replace(Landmarks.unknown(points[:, :2]), looks=looks, accurate=accurate, credited=credited)
    expected = objective(
        positions, np.column_stack([points[:, :2], depth]), landmark_sets(landmarks, visible), int(accurate.sum())
    )
    np.testing.assert_allclose(progress[0], expected.progress.accurate)
    np.testing.assert_allclose(progress[1], expected.progress.J1)
    np.testing.assert_allclose(progress[2], expected.progress.J2)
    assert J3.sum() == pytest.approx(expected.J3)


def test_real_tries_cost_what_the_paper_says() -> None:
    steps = 500
    assert [steps * (1 + tries_per_step(SE, c, 3)) for c in (0, 5, 50, 500)] == [500, 3000, 25500, 250500]
    assert steps * (1 + tries_per_step(SPSA, 0, 3)) == 1500
    assert steps * (1 + tries_per_step(FDSA, 0, 3)) == 9500


@pytest.mark.slow
def test_more_tries_and_the_trained_controller_do_better(floor: SeaFloor) -> None:
    landmarks, start, headings = floor.draw(0, 3, 200)
    left = [
        fly_tried(floor.raster, floor.physics, landmarks, start, headings, SE, c, 150, np.random.default_rng(0))[0][-1]
        for c in (0, 20)
    ]
    horizontal, vertical = gains(default_model().parameters)
    rng = np.random.default_rng(0)
    remaining, _ = fly(floor.raster, floor.physics, landmarks, start, headings, horizontal, vertical, 150, False, rng)
    assert remaining[-1] < left[1] < left[0]
    assert remaining[-1] < 0.25 * len(landmarks)
    assert not unknown(3).accurate.any()


def test_the_step_of_algorithm_1_decays_as_it_must() -> None:
    a = np.array([step_size(k) for k in range(100_000)])
    assert (np.diff(a) < 0).all()
    assert a[-1] < 0.01
    # sum k^-0.6 diverges and sum k^-1.2 converges: doubling the length keeps adding, and adds ever less
    assert a[50_000:].sum() > 0.3 * a[:50_000].sum()
    assert (a[50_000:] ** 2).sum() < 0.05 * (a[:50_000] ** 2).sum()


@pytest.mark.parametrize("method", sorted(METHODS))
def test_a_killed_training_goes_on_to_the_same_end(method: str, task: TrainingTask, tmp_path: Path) -> None:
    scorer, rounds = LocalScorer(task, 1), 3
    count = rounds * len(make_optimiser(method, 1).ask())
    whole = make_optimiser(method, 1)
    curve = train(whole, scorer, Checkpoint(tmp_path / "whole", {"seed": 1}), count)

    class KilledError(Exception):
        pass

    def die(curve: Any) -> None:
        if len(curve.scores) >= count // rounds:
            raise KilledError

    with pytest.raises(KilledError):
        train(make_optimiser(method, 1), scorer, Checkpoint(tmp_path / "cut", {"seed": 1}), count, die)
    with (tmp_path / "cut").open("ab") as out:
        out.write(b'{"asked": "1.2", "sco')  # killed while writing
    resumed, scored = make_optimiser(method, 1), []

    class Counting:
        def score(self, controllers: Any) -> Any:
            scored.extend(controllers)
            return scorer.score(controllers)

    again = train(resumed, Counting(), Checkpoint(tmp_path / "cut", {"seed": 1}), count)
    assert again.scores == curve.scores
    np.testing.assert_array_equal(resumed.best, whole.best)
    assert len(scored) == count - count // rounds


def test_a_checkpoint_of_another_training_is_refused(tmp_path: Path) -> None:
    Checkpoint(tmp_path / "c", {"seed": 1, "steps": 5})
    with pytest.raises(CheckpointError, match="seed is 1 there, 2 here"):
        Checkpoint(tmp_path / "c", {"seed": 2, "steps": 5})


def best_after(method: Any, count: int) -> Any:
    """Look for given gains: a score without noise that every optimiser is asked to lower."""
    wanted = np.concatenate([part.ravel() for part in gains(default_model().parameters)])
    optimiser = make_optimiser(method, 0)
    while count > 0:
        asked = optimiser.ask()
        have = regressors(np.array(asked))[:, 1 : 1 + len(wanted)] * 10.0
        optimiser.tell(asked, ((have - wanted) ** 2).sum(axis=1).tolist())
        count -= len(asked)
    return optimiser.best_score


def test_algorithm_1_and_cma_es_learn_where_random_search_does_not() -> None:
    random, pcao, cma = (best_after(method, 200) for method in ("random", "pcao", "cma"))
    assert pcao < 0.8 * random
    assert cma < 0.8 * random


def test_regressors_hold_the_gains_and_their_squares() -> None:
    parameters = default_model().parameters
    horizontal, vertical = gains(parameters)
    g = np.concatenate([horizontal.ravel(), vertical.ravel()]) / 10.0
    np.testing.assert_allclose(regressors(parameters[None])[0], [1.0, *g, *g**2])


def test_sea_floors_are_named_by_file_folder_or_family(tmp_path: Path) -> None:
    np.savez(tmp_path / "one.npz", z=np.full((4, 4), 5.0), cell_m=1.0)
    assert [t.name for t in sea_floors_of(["ridge:2,smooth:1", str(tmp_path)])] == ["ridge:2", "smooth:1", "one"]
    with pytest.raises(TerrainError, match="neither a file nor FAMILY:SEED"):
        sea_floor("nowhere")


def test_the_train_command_writes_a_model_that_evaluations_fly_with(tmp_path: Path) -> None:
    out = tmp_path / "model.json"
    command = ["train", "--out", str(out), "--terrains", "smooth:1", "ridge:1", "--iterations", "3", "--runs", "1"]
    command += ["--method", "pcao", "--robots", "2", "--landmarks", "40", "--steps", "8", "--jobs", "2"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    model = PcaoModel.model_validate_json(out.read_bytes())
    assert model.training.terrains == ("smooth:1", "ridge:1")
    assert model.training.evaluations == 3
    assert model.training.command.startswith("bathyfleet train --out FILE --terrains smooth:1,ridge:1 --iterations 3")
    assert out.with_suffix(".png").stat().st_size > 1000

    again = CliRunner().invoke(app, [*command[:-2], "--seed", "5"])
    assert again.exit_code != 0
    assert "of another training (seed is 0 there, 5 here)" in str(again.exception)

    np.savez(tmp_path / "flat.npz", z=np.full((20, 20), 5.0) + np.arange(20) / 10, cell_m=1.0)
    explore = ["evaluate", "explore", "--terrain", str(tmp_path / "flat.npz"), "--planner", "pcao", "--steps", "3"]
    flown = CliRunner().invoke(app, [*explore, "--landmarks", "30", "--model", str(out), "--json"])
    assert flown.exit_code == 0, flown.output
    assert orjson.loads(flown.stdout)["planner"] == "pcao"


def test_a_training_on_many_sea_floors_can_be_written_down() -> None:
    many = tuple(f"harbour:{k}" for k in range(2000))
    training = Training(command=f"bathyfleet train --out FILE --terrains {','.join(many)}", terrains=many)
    model = PcaoModel.of(default_model().parameters, training)
    assert PcaoModel.model_validate_json(model.model_dump_json()).training == training


def test_what_is_no_model_is_refused_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "m.json").write_text('{"format": "bathyfleet-pcao", "version": 1}')
    np.savez(tmp_path / "flat.npz", z=np.full((20, 20), 5.0), cell_m=1.0)
    explore = ["evaluate", "explore", "--terrain", str(tmp_path / "flat.npz"), "--planner", "pcao"]
    result = CliRunner().invoke(app, [*explore, "--model", str(tmp_path / "m.json")], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert "is no model file" in result.output
