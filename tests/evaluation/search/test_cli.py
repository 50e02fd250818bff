"""``bathyfleet evaluate rescue``: ACCESS13's experiment."""

from pathlib import Path
from typing import Any

import orjson
import pytest
from typer.testing import CliRunner

from app.evaluation.cli import evaluate_app

RUNNER = CliRunner()


def rescue(*arguments: str) -> dict[str, Any]:
    result = RUNNER.invoke(evaluate_app, ["rescue", "--json", *arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return orjson.loads(result.stdout)


@pytest.mark.slow
def test_the_default_planner_sees_the_goal_area_and_is_back_in_time() -> None:
    run = rescue("--scenario", "harbour", "--rc", "12", "--window", "400")
    assert run["goal_area_pct"] > 90.0
    assert 15.0 < run["map_pct"] < 60.0
    assert run["returned_in_time"] is True
    assert (run["collisions"], run["too_close"], run["trapped"]) == (0, 0, False)


@pytest.mark.slow
def test_three_robots_see_more_than_one() -> None:
    one, three = (rescue("--scenario", "1", "--window", "90", "--robots", n) for n in ("1", "3"))
    assert three["map_pct"] > 1.5 * one["map_pct"]
    assert three["returned_in_time"]
    assert three["collisions"] == 0


@pytest.mark.slow
def test_planners_are_compared_under_either_clock() -> None:
    compared = rescue("--planner", "cao,random", "--seeds", "0:2", "--window", "90", "--clock", "steps")
    assert len(compared["runs"]) == 4
    mean = {name: metrics["map_pct"]["mean"] for name, metrics in compared["summary"].items()}
    assert mean["cao"] > mean["random"]
    assert all(run["returned_in_time"] for run in compared["runs"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--scenario", "4"], "'4' is none of 1, 2, 3, harbour"),
        (["--planner", "lawnmower"], "there is no planner 'lawnmower'"),
        (["--clock", "sun"], "'sun' is none of way, steps"),
        (["--only", "default"], "goes with --write only"),
        (["--write", "x", "--no-run", "--planner", "cao"], "for --planner: the report of --write flies its own"),
        (["--write", "x", "--no-run", "--window", "500"], "for --window: the report of --write flies its own"),
        (["--write", "x", "--scheduler", "nowhere"], "for --scheduler: no Dask cluster answers"),
    ],
)
def test_what_makes_no_sense_is_refused(
    arguments: Any, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = RUNNER.invoke(evaluate_app, ["rescue", *arguments])
    assert result.exit_code == 2
    assert said in " ".join(result.output.replace("│", "").split())


def test_the_report_names_every_table_and_what_is_still_missing(tmp_path: Path) -> None:
    asked = ["rescue", "--write", str(tmp_path), "--no-run", "--seed", "2"]
    result = RUNNER.invoke(evaluate_app, asked, catch_exceptions=False)
    assert result.exit_code == 0
    text = (tmp_path / "rescue.md").read_text()
    assert "| 1, 50 | 88.88 / 60.23 | 0.14 / 31.02 | 65.27 / 39.99 |" in text
    assert "`bathyfleet evaluate rescue --write FOLDER --seeds 2 --jobs 1`" in text
    assert "Not run yet (`--only`): literal, default, team, literal-way, spsa, random." in text
