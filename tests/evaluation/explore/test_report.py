import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from app.evaluation.cli import evaluate_app
from app.evaluation.explore.report import Report, markdown
from app.evaluation.explore.setups import ReportSection, Setup, TableJob, jobs_of, run_key, sections
from app.evaluation.explore.terrains import report_terrains
from app.evaluation.runs.store import Results
from simulator.floors.seafloors import generate
from simulator.floors.terrain_files import save_npz

QUICK = ("--seeds", "0:1", "--steps", "5", "--quick", "--only", "table1,planners")


def call(*arguments: str) -> Result:
    return CliRunner().invoke(evaluate_app, ["tables", *arguments])


def run_of(
    setup: Setup, seed: int, *, terrain: str = "here", remaining: float = 0.0, t99: int | None = None, broken: int = 0
) -> tuple[Any, ...]:
    key = run_key(setup, terrain, seed, 500)
    return key, {"remaining_pct": remaining, "t99": t99, "broken_constraints": broken, "history": [remaining] * 100}


def report_of(runs: list[Any], section: ReportSection, seeds: tuple[int, ...] = (0, 1, 2)) -> Report:
    return Report(dict(runs), [section], ["here"], [], seeds, 500, {"command": "`this`"}, {})


@pytest.mark.slow
def test_one_command_makes_report_pictures_and_results_and_an_interrupted_one_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "floors"
    folder.mkdir()
    save_npz(generate("smooth", 0, width_m=40.0, height_m=40.0), folder / "calibration_smooth.npz")
    out = tmp_path / "results"
    first = call("--out", str(out), "--terrains", str(folder), *QUICK)
    assert first.exit_code == 0, first.output
    results = out / "exploration.jsonl"
    lines = results.read_bytes().splitlines(keepends=True)
    text = (out / "exploration.md").read_text()
    assert "images/planners.png" in text
    assert (out / "images" / "planners.png").read_bytes().startswith(b"\x89PNG")
    assert "left out, because their files were not found: monterey_coast_range" in text
    assert "**incomplete**" not in text
    assert str(tmp_path) not in text

    # Killed while it wrote: the last run is torn.
    results.write_bytes(b"".join(lines[:-2]) + lines[-2][:40])
    again = call("--out", str(out), "--terrains", str(folder), *QUICK)
    assert "2 runs made" in again.output

    def tables(report: Any) -> Any:
        return [line for line in report.splitlines() if line.startswith("|")]

    assert tables((out / "exploration.md").read_text()) == tables(text)
    assert "0 runs made" in call("--out", str(out), "--terrains", str(folder), *QUICK).output


def test_generated_terrains_are_there_without_any_file() -> None:
    terrains, missing = report_terrains(None)
    assert [t.name for t in terrains] == ["rugged (seed 1)", "ridge (seed 1)"]
    assert len(missing) == 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--only", "table9"], ["table9", "figure2"]), (["--terrains", "/nowhere/at-all"], ["at-all"])],
)
def test_wrong_input_is_refused_in_words(tmp_path: Path, arguments: list[str], words: list[str]) -> None:
    result = call("--out", str(tmp_path), *arguments)
    assert result.exit_code == 2
    assert all(word in result.output for word in words)


def test_every_run_is_made_once_however_many_tables_need_it() -> None:
    terrains = report_terrains(None)[0]
    jobs = list(jobs_of(sections(500), terrains, [0, 1], 500))
    assert len({job.key for job in jobs}) == len(jobs)
    cao = Setup("cao")
    users = [s.name for s in sections(500) if cao in [setup for _, setup in s.rows]]
    assert users == ["figure5", "planners"]
    assert sum(job.setup == cao for job in jobs) == 2 * len(terrains)


def test_a_run_says_what_it_was(tmp_path: Path) -> None:
    job = TableJob(Setup("random", keep_out=0.1, landmarks=50), generate("ridge", 1), 3, 12)
    result = json.loads(json.dumps(job.run(lambda step: None)))
    assert result["key"] == job.key
    assert (result["seed"], result["landmarks"], len(result["history"])) == (3, 50, 2)
    results = Results(tmp_path / "kept.jsonl")
    results.add(result)
    assert Results(tmp_path / "kept.jsonl").runs == {job.key: result}


def test_the_report_states_means_intervals_and_how_many_reached_the_goal() -> None:
    setup = Setup("cao")
    runs = [
        run_of(setup, k, remaining=r, t99=t, broken=b) for k, (r, t, b) in enumerate([(0.5, 200, 1), (0.7, 220, 3)])
    ]
    section = ReportSection("planners", "Planners", "Text.", (("CAO", setup), ("other", Setup("random"))))
    text = markdown(report_of([*runs, run_of(setup, 2, remaining=3.0, t99=None, broken=2)], section))
    assert "| CAO | 1.40 ± 3.45 |" in text
    assert "| CAO | 210 ± 127 (2 of 3) |" in text
    assert "| CAO | 2.0 ± 2.5 |" in text
    assert "| other | – |" in text
    assert "**incomplete**: 3 runs are still missing" in text


def test_improvements_are_relative_to_what_the_yardstick_leaves() -> None:
    ours, theirs = Setup("cao"), Setup("osarses", 5)
    rows = (("OSARSES(5), 1100 landmarks", theirs), ("CAO, map, 1100 landmarks", ours))
    section = ReportSection("figure5", "Figure", "Text.", rows, published={"CAO, map, 1100 landmarks": "about 17 %"})
    text = markdown(report_of([run_of(ours, 0, remaining=17.6), run_of(theirs, 0, remaining=23.2)], section, (0,)))
    assert "| CAO, map, 1100 landmarks over OSARSES(5) | 24.1 |" in text
    assert "| CAO, map, 1100 landmarks | 17.60 | about 17 % |" in text
