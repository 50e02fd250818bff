import json
from typing import Any

import pytest
from typer.testing import CliRunner

from app.evaluation.cli import evaluate_app
from app.evaluation.runs.command import planners_named, seed_list
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import save_npz

EXPLORE = {
    "planner", "terrain", "seed", "robots", "landmarks", "steps", "remaining_pct", "t99", "sum_of_error", "history",
    "distance", "wall_s", "plan_ms_median", "plan_ms_p99", "real_tries",
    "broken_constraints", "done_nees", "done_within_pct", "fallback_steps",
}  # fmt: skip
SURVEY = {"rmse_m", "l2_norm", "samples", "distance_m", "time_s", "coverage_pct"}


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("floor") / "harbour.npz"
    save_npz(generate("harbour", 0, width_m=40.0, height_m=40.0), file)
    return str(file)


def call(*arguments: Any) -> Any:
    return CliRunner().invoke(evaluate_app, list(arguments))


def test_one_run_prints_one_object(terrain: Terrain) -> None:
    result = call("explore", "--terrain", terrain, "--landmarks", "80", "--steps", "5", "--json")
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document.keys() >= EXPLORE
    assert len(document["history"]) == 5


def test_several_runs_print_runs_and_a_summary(terrain: Terrain) -> None:
    result = call(
        "explore", "--terrain", terrain, "--landmarks", "80", "--steps", "4",
        "--planner", "cao,random", "--seeds", "0:2",
        "--json",
    )  # fmt: skip
    document = json.loads(result.stdout)
    assert [(r["planner"], r["seed"]) for r in document["runs"]] == [
        ("cao", 0),
        ("cao", 1),
        ("random", 0),
        ("random", 1),
    ]
    spread = document["summary"]["cao"]["remaining_pct"]
    assert spread.keys() == {"mean", "ci95", "min", "max"}
    assert spread["min"] <= spread["mean"] <= spread["max"]


def test_no_run_is_made_and_counted_twice() -> None:
    assert seed_list(None, "5,1,5") == [5, 1]
    assert planners_named("cao, random,cao", ("cao", "random")) == ["cao", "random"]


def test_where_there_is_little_room_no_name_of_a_column_is_cut_off(
    terrain: Terrain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    result = call("explore", "--terrain", terrain, "--landmarks", "20", "--steps", "2", "--planner", "random")
    assert result.exit_code == 0
    assert "…" not in result.stdout


@pytest.mark.slow
def test_any_number_of_processes_gives_the_same_runs_in_the_same_order(terrain: Terrain) -> None:
    arguments = ("explore", "--terrain", terrain, "--landmarks", "60", "--steps", "3", "--planner", "random,lawnmower",
                 "--seeds", "0:2", "--json")  # fmt: skip
    one, two = (json.loads(call(*arguments, "--jobs", str(n)).stdout)["runs"] for n in (1, 2))
    for run in (*one, *two):
        for key in ("wall_s", "plan_ms_median", "plan_ms_p99"):
            del run[key]
    assert one == two


def test_every_cell_can_be_a_landmark(terrain: Terrain) -> None:
    result = call(
        "explore", "--terrain", terrain, "--landmarks", "all", "--steps", "1", "--planner", "random", "--json"
    )
    assert json.loads(result.stdout)["landmarks"] == 1600


def test_the_team_may_change_and_zones_be_kept_out(terrain: Terrain) -> None:
    result = call(
        "explore", "--terrain", terrain, "--landmarks", "80", "--steps", "6", "--planner", "lawnmower",
        "--keep-out", "0.1", "--lose", "1@2,3@4", "--join", "2@5", "--line-of-sight", "--json",
    )  # fmt: skip
    document = json.loads(result.stdout)
    assert len(document["history"]) == 6
    assert document["robots"] == 3


def test_explore_under_limited_communication(terrain: Terrain) -> None:
    result = call("explore", "--terrain", terrain, "--landmarks", "60", "--steps", "6", "--capacity", "10", "--json")
    document = json.loads(result.stdout)
    assert document["capacity"] == 10
    assert 0 < document["message_bytes"] <= 6 * 3 * (64 + 64 + 20)


@pytest.mark.slow
def test_survey_prints_the_planner_beside_its_yardsticks(terrain: Terrain) -> None:
    result = call(
        "survey", "--terrain", terrain, "--steps", "6", "--max-step", "8", "--sampling", "continuous", "--json"
    )
    document = json.loads(result.stdout)
    for part in (document, document["usual_practice"], document["coverage"], document["even"], document["oracle"]):
        assert part.keys() >= SURVEY
    assert "recorded_track" not in document


def test_without_json_a_table_is_printed(terrain: Terrain) -> None:
    result = call("explore", "--terrain", terrain, "--landmarks", "50", "--steps", "3", "--planner", "random")
    assert "remaining_pct" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--planner", "magic"], ["magic", "cao"]),
        (["--seeds", "a:b"], ["a:b", "FIRST:END"]),
        (["--seeds", "3:3"], ["no number"]),
        (["--landmarks", "many"], ["many", "all"]),
        (["--lose", "2"], ["'2'", "K@T"]),
        (["--lose", "4@10"], ["4@10", "1, 2, 3"]),
        (["--lose", "1@1,2@2,3@3"], ["step 3", "no vehicle"]),
        (["--join", "1@501"], ["1@501", "1 to 500"]),
        (["--keep-out", "0.9"], ["0.9", "0.3"]),
        (["--capacity", "0"], ["--capacity", "greater than or equal to 1"]),
        (["--capacity", "10", "--planner", "osarses"], ["osarses", "everything"]),
        (["--message-loss", "0.1"], ["message loss", "capacity"]),
        (["--regressors", "none"], ["none", "polynomial"]),
        (["--terrain", "/nowhere/at-all.npz"], ["at-all.npz"]),
        (["--model", "model.json", "--planner", "cao,random"], ["--model", "only pcao flies with a model"]),
    ],
)
def test_wrong_input_is_refused_in_words(terrain: Terrain, arguments: Any, words: Any) -> None:
    result = call("explore", "--terrain", terrain, *arguments)
    assert result.exit_code == 2
    for word in words:
        assert word in result.output
