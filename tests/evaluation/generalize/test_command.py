"""``bathyfleet evaluate generalize``: the table of every task on unseen floors."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.evaluation.cli import evaluate_app
from app.evaluation.generalize.flights import coverage
from app.evaluation.generalize.report import markdown
from app.evaluation.generalize.site import site_of
from app.evaluation.generalize.summary import figure_of, summary_of, worst_of
from app.evaluation.generalize.tasks import TASKS
from app.evaluation.runs.summary import first_step
from simulator.floors.unseen_floors import UNSEEN, unseen_floor


def call(*arguments: str) -> Any:
    return CliRunner().invoke(evaluate_app, ["generalize", *arguments])


def run(floor: str, ours: float, yardstick: float, *, kept: bool = True) -> dict[str, Any]:
    family, seed = floor.split(":")
    return {"floor": floor, "family": family, "seed": int(seed), "ours": ours, "yardstick": yardstick, "kept": kept,
            "facts": {"left_pct": 0.5}}  # fmt: skip


def test_the_tasks_are_those_of_the_project() -> None:
    assert list(TASKS) == ["explore", "track", "pcao", "search", "survey", "coverage"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(TASKS))
def test_every_task_has_its_table_and_its_picture(name: str, tmp_path: Path) -> None:
    result = call("--quick", "--tasks", name, "--floors", "1", "--seeds", "even", "--json", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)[name]
    assert told.keys() >= {"floors", "mean", "ci95", "worst"}
    assert told["floors"] == 1
    assert told["worst"][0]["floor"] == f"{sorted(UNSEEN)[0]}:0"
    assert f"## {name}: the worst floors" in (tmp_path / "generalization.md").read_text()
    assert (tmp_path / "images" / f"generalization-{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_floor_that_one_vehicle_covers_alone_is_told() -> None:
    flown = coverage(unseen_floor("outcrops", 0, width_m=42.0, height_m=30.0), 0, "quick")
    assert [] in flown.tracks


@pytest.mark.slow
def test_an_interrupted_evaluation_goes_on(tmp_path: Path) -> None:
    arguments = ("--quick", "--tasks", "pcao", "--seeds", "1", "--json", "--out", str(tmp_path))
    first = json.loads(call(*arguments, "--floors", "1").stdout)
    kept = (tmp_path / "generalization.jsonl").read_bytes()
    with (tmp_path / "generalization.jsonl").open("ab") as out:
        out.write(kept[: len(kept) // 2])  # killed while it wrote
    second = json.loads(call(*arguments, "--floors", "2").stdout)
    assert second["pcao"]["floors"] == 2
    assert first["pcao"]["worst"][0] in second["pcao"]["worst"]
    assert (tmp_path / "generalization.jsonl").read_bytes().startswith(kept)
    only = json.loads(call(*arguments, "--floors", "5", "--no-run").stdout)
    assert only["pcao"]["floors"] == 2
    assert "3 runs are still missing" in (tmp_path / "generalization.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--tasks", "diving"), "diving"),
        (("--seeds", "some"), "some"),
        (("--seeds", "3", "--floors", "20"), "10 floors"),
        (("--seeds", "3,3", "--floors", "20"), "10 floors"),
        (("--no-run",), "--out"),
    ],
)
def test_what_cannot_be_flown_is_refused(arguments: tuple[str, ...], says: str) -> None:
    result = call(*arguments)
    assert result.exit_code != 0
    assert says in result.output


def test_differences_are_paired_and_ratios_are_of_the_same_floor() -> None:
    runs = [run("dunes:1", 50.0, 100.0), run("canyons:1", 180.0, 200.0), run("wrecks:1", 30.0, 40.0, kept=False)]
    of = summary_of(TASKS["explore"], runs)
    assert of["mean"] == pytest.approx(np.mean([0.5, 0.9, 0.75]))
    assert of["difference"]["mean"] == pytest.approx(-80.0 / 3.0)
    assert of["kept"] == 2
    assert [one["floor"] for one in of["worst"]] == ["canyons:1", "wrecks:1", "dunes:1"]


def test_floors_on_which_the_yardstick_never_got_there_are_told_apart() -> None:
    got_there = [run("dunes:1", 50.0, 100.0) | {"facts": {"left_by_yardstick_pct": left}} for left in (0.0, 1.0)]
    never = run("canyons:1", 100.0, 501.0) | {"facts": {"left_by_yardstick_pct": 1.1}}
    of = summary_of(TASKS["explore"], [*got_there, never])
    assert of["floors"] == 3
    assert (of["yardstick_done"]["floors"], of["yardstick_done"]["mean"]) == (2, 0.5)
    assert of["yardstick_done"]["difference"]["mean"] == -50.0
    text = markdown({"explore": [*got_there, never]}, {}, 0, {})
    assert "On 1 of 3 floors the yardstick did not get there" in text
    assert "On the other 2 the figure is 0.5" in text
    assert summary_of(TASKS["explore"], got_there)["yardstick_done"] is None


def test_what_is_left_is_told_as_it_is() -> None:
    runs = [run("dunes:1", 3.0, 1.0), run("canyons:1", 0.0, 1.0)]
    assert [figure_of(TASKS["pcao"], one) for one in runs] == [3.0, 0.0]
    assert worst_of(TASKS["pcao"], runs)[0]["floor"] == "dunes:1"


def test_eleven_of_1100_are_one_percent() -> None:
    left = 100.0 * float(1.0 - np.float64(1089) / 1100)
    assert left != 1.0
    assert first_step([50.0, left, 0.0]) == 2
    assert first_step([50.0, 1.09]) is None


@pytest.mark.parametrize("family", sorted(UNSEEN))
def test_a_site_has_a_way_from_its_entry_to_its_goal(family: str) -> None:
    site = site_of(unseen_floor(family, 2, width_m=80.0, height_m=80.0))
    assert site.clearance_m(np.stack([site.entry_m, site.goal_m])).min() >= 2.0
    assert np.hypot(*(site.goal_m - site.entry_m)) > 20.0
    assert not (site.known & ~site.solid).any()
