"""The survey planner beside its yardsticks on all sea floors: every symmetry of the square, budgets, samplings, sonars.

    python -m benchmarks.planning.survey_study --terrains FOLDER [--seeds 0 1 ...] [--budgets 2.5,1.0]
        [--samplings step,continuous] [--sounders single] [--only NAME,...] [--jobs 1] [--write] [--no-run]

Each run is what ``bathyfleet evaluate survey`` does: 2 vehicles, 500 steps, noise of 1 % of the range. Runs are kept in
``survey.jsonl`` as soon as they are done, so that the study can be interrupted and goes on where it was; ``survey.md``
reports those that are there. Terrains are those of 100 x 100 m in the folder and two generated ones.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress as ProgressBar

from app.estimation import Sensor
from app.evaluation.runs.jobs import Progress, run_jobs
from app.evaluation.runs.store import Results
from app.evaluation.runs.summary import spread
from app.evaluation.survey.job import SurveyJob
from app.evaluation.survey.recorded import recorded_soundings
from app.evaluation.survey.symmetry import turned, turned_soundings
from app.evaluation.survey.world import Sampling, Sounder, SurveyScenario
from app.exploration.planner.options import PlannerOptions
from app.mapping.types import Soundings
from benchmarks.common.report import Page, facts, make_parser, put_page
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

SIDE_M = (95.0, 110.0)
GENERATED = (("reef", 1), ("reef_field", 1))
PATCHY = ("leixoes_sharp", "leixoes_sharp_wall_sw", "leixoes_sharp_diagonal", "reef", "reef_field")
STEPS, VEHICLES = 500, 2

PATTERNS = ("usual_practice", "coverage", "even")
"""What the planner is compared with; runs that were made before there was one lack it."""

Run = Mapping[str, Any]


@dataclass(frozen=True)
class SeaFloor:
    """A terrain as its file has it, with the track that was flown over it where there is one."""

    name: str
    terrain: Terrain
    recorded: Soundings | None


@dataclass(frozen=True)
class StudyJob:
    """One run; ``key`` says what makes it what it is."""

    key: str
    job: SurveyJob

    @property
    def title(self) -> str:
        return f"{self.job.scenario.terrain.name}, {self.job.title}"

    @property
    def steps(self) -> int:
        return self.job.steps

    @property
    def sensor(self) -> Sensor:
        return self.job.sensor

    def run(self, progress: Progress) -> dict[str, Any]:
        return {"key": self.key, **self.job.run(progress)}


def sea_floors(folder: Path | None) -> list[SeaFloor]:
    """Return the generated sea floors and those of about 100 x 100 m in the folder."""
    found = [SeaFloor(name, replace(generate(name, seed), name=name), None) for name, seed in GENERATED]
    for file in sorted(folder.glob("*.npz")) if folder else []:
        terrain = replace(load_terrain(file), name=file.stem)
        if all(SIDE_M[0] <= side <= SIDE_M[1] for side in (terrain.width_m, terrain.height_m)):
            found.append(SeaFloor(file.stem, terrain, recorded_soundings(file)))
    return sorted(found, key=lambda floor: (floor.name not in PATCHY, floor.name))


def chosen_floors(parser: argparse.ArgumentParser, folder: Path | None, only: str | None) -> list[SeaFloor]:
    """Return the sea floors named in ``only``, all without it; ends with a usage error where there is no such one."""
    floors = sea_floors(folder)
    if only is None:
        return floors
    wanted = only.split(",")
    lacking = set(wanted) - {floor.name for floor in floors}
    if lacking:
        parser.error(f"--only: there is no {', '.join(sorted(lacking))}")
    return [floor for floor in floors if floor.name in wanted]


def study_jobs(
    floors: Iterable[SeaFloor],
    symmetries: Sequence[int],
    budgets: Sequence[float],
    samplings: Sequence[Sampling],
    sounders: Sequence[Sounder],
) -> list[StudyJob]:
    """Return every run, symmetry by symmetry, so that an interrupted study has all terrains."""
    floors = list(floors)
    jobs = []
    for symmetry in symmetries:
        for sounder in sounders:
            for sampling in samplings:
                for budget in budgets:
                    for floor in floors:
                        scenario = SurveyScenario(
                            turned(floor.terrain, symmetry), VEHICLES, STEPS, budget, sampling,
                            seed=symmetry, sounder=sounder, symmetry=symmetry,
                        )  # fmt: skip
                        recorded = floor.recorded
                        if recorded is not None:
                            recorded = turned_soundings(recorded, floor.terrain, symmetry)
                        key = f"{floor.name}/{symmetry}/{budget:g}/{sampling}/{sounder}"
                        jobs.append(StudyJob(key, SurveyJob(scenario, "cao", PlannerOptions(), recorded)))
    return jobs


def report(runs: Sequence[Run], head: Sequence[str]) -> str:
    """Return the report in Markdown."""
    lines = ["# Surveys: the field experiment beside its yardsticks", ""]
    lines += head
    lines += [
        "",
        f"{VEHICLES} vehicles, {STEPS} steps, noise 1 % of the range to the bottom. RMSE in metres of the default map,"
        " mean over the symmetries of the square that were run. *ratio*: over the RMSE of the best of lawnmower,"
        " equal-area coverage and whole even lines, each with the better of the default map and a stationary"
        " Matern 3/2 process; with its 95 % interval, and the worst run."
        " *lasting*: mean of ours over that of the pattern which is better on average"
        " over the symmetries: choosing the better one run by run has luck in it. *map*: default over stationary map on"
        " our own soundings. The oracle places as many soundings anywhere, knowing the truth; *gap* is how far we came"
        " from the better pattern to it.",
    ]
    setups = dict.fromkeys((r["sounder"], r["sampling"], r["max_step_m"]) for r in runs)
    for sounder, sampling, budget in sorted(setups):
        mine = [r for r in runs if (r["sounder"], r["sampling"], r["max_step_m"]) == (sounder, sampling, budget)]
        lines += ["", f"## Largest step {budget:g} m, sampling {sampling}, {sounder}", "", *_table(mine)]
    lines += _beams(runs)
    return "\n".join(lines) + "\n"


def _table(runs: Sequence[Run]) -> list[str]:
    rows = [
        "| terrain | runs | ours | better pattern | random | oracle | ratio | worst | lasting | gap | map | recorded |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    names = list(dict.fromkeys(r["terrain"] for r in runs))
    names.sort(key=lambda name: (name not in PATCHY, name))
    means: dict[str, float] = {}
    maps: dict[str, float] = {}
    lasting: list[float] = []
    oracle: list[float] = []
    for name in names:
        mine = [r for r in runs if r["terrain"] == name]
        ratio = spread([r["ratio"] for r in mine])
        means[name] = ratio.mean
        pattern = [best_pattern(r) for r in mine]
        ways = [_mean(r[way]["rmse_m"] for r in mine) for way in PATTERNS if all(way in r for r in mine)]
        lasting.append(_mean(r["rmse_m"] for r in mine) / min(ways))
        maps[name] = _mean(r["rmse_m"] / r["rmse_stationary_m"] for r in mine)
        if name in PATCHY:
            oracle.append(_mean(r["oracle"]["rmse_m"] for r in mine) / float(np.mean(pattern)))
        recorded = [r["ratio_recorded"] for r in mine if r.get("ratio_recorded") is not None]
        rows.append(
            f"| {name} | {len(mine)} | {_mean(r['rmse_m'] for r in mine):.3f} | {np.mean(pattern):.3f} | "
            f"{_mean(r['random']['rmse_m'] for r in mine):.2f} | {_mean(r['oracle']['rmse_m'] for r in mine):.3f} | "
            f"{ratio.mean:.3f} ± {ratio.ci95:.3f} | {ratio.max:.3f} | {lasting[-1]:.3f} | "
            f"{_mean(r['gap_closed'] for r in mine):.2f} | "
            f"{maps[name]:.3f} | "
            f"{f'{np.mean(recorded):.3f}' if recorded else ''} |"
        )
    patchy = [value for name, value in means.items() if name in PATCHY]
    rows += ["", f"Mean ratio over all terrains {np.mean(list(means.values())):.3f}, worst {max(means.values()):.3f}"]
    rows[-1] += f"; over the patchy ones {np.mean(patchy):.3f}." if patchy else "."
    rows[-1] += f" Lasting: {np.mean(lasting):.3f}, worst {max(lasting):.3f}."
    rows[-1] += f" Below both patterns: {sum(r['ratio'] < 1.0 for r in runs)} of {len(runs)} runs."
    rows[-1] += f" Default over stationary map: worst {max(maps.values()):.3f}"
    patchy = [value for name, value in maps.items() if name in PATCHY]
    rows[-1] += f", patchy {np.mean(patchy):.3f}." if patchy else "."
    rows[-1] += f" Oracle over the better pattern, patchy: {np.mean(oracle):.2f}." if oracle else ""
    return rows


def _beams(runs: Sequence[Run]) -> list[str]:
    """Return what more beams gain: the errors over those of a single beam in the same survey."""
    by_key = {r["key"]: r for r in runs}
    rows: dict[tuple[str, str, float], list[tuple[float, float]]] = {}
    for r in runs:
        single = by_key.get(r["key"].rpartition("/")[0] + "/single")
        if r["sounder"] != "single" and single is not None:
            better = [best_pattern(x) for x in (r, single)]
            pair = r["rmse_m"] / single["rmse_m"], better[0] / better[1]
            rows.setdefault((r["sounder"], r["sampling"], r["max_step_m"]), []).append(pair)
    if not rows:
        return []
    lines = [
        "",
        "## More beams",
        "",
        "RMSE over that with a single beam down, same terrain, symmetry, step and sampling; mean over the runs.",
        "",
        "| sounder | sampling | largest step | runs | ours | better pattern |",
        "|---|---|---|---|---|---|",
    ]
    for (sounder, sampling, budget), pairs in sorted(rows.items()):
        ours, pattern = np.mean(pairs, axis=0)
        lines.append(f"| {sounder} | {sampling} | {budget:g} m | {len(pairs)} | {ours:.3f} | {pattern:.3f} |")
    return lines


def best_pattern(run: Run) -> float:
    """Return the RMSE of the best of the patterns that were flown beside a run."""
    return min(float(run[way]["rmse_m"]) for way in PATTERNS if way in run)


def _mean(values: Iterable[float | None]) -> float:
    """Return the mean of those that are there: an oracle that did no better leaves no gap to close."""
    known = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def numbers(text: str) -> list[int]:
    """Return ``1:4`` or ``1,2,3`` as a list."""
    first, colon, end = text.partition(":")
    return list(range(int(first), int(end))) if colon else [int(part) for part in text.split(",")]


def main() -> None:
    parser = make_parser(__doc__, Page("survey.md"), seeds=range(8))
    parser.add_argument("--terrains", type=Path, help="folder of terrain files")
    parser.add_argument("--budgets", default="2.5,1.0", help="largest steps in metres")
    parser.add_argument("--samplings", default="step,continuous")
    parser.add_argument("--sounders", default="single")
    parser.add_argument("--only", help="terrains, separated by commas")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--runs", type=Path, default=Page("survey.jsonl").path, help="where runs are kept")
    parser.add_argument("--no-run", action="store_true")
    given = parser.parse_args()
    floors = chosen_floors(parser, given.terrains, given.only)
    budgets = [float(part) for part in given.budgets.split(",")]
    jobs = study_jobs(floors, given.seeds, budgets, given.samplings.split(","), given.sounders.split(","))
    results = Results(given.runs)
    open_ = [] if given.no_run else [job for job in jobs if job.key not in results.runs]
    with ProgressBar(disable=not open_) as bar:
        task = bar.add_task("surveys", total=len(open_))
        for run in run_jobs(open_, given.jobs, lambda job, step: bar.update(task, description=job.title)):
            results.add(run)
            bar.advance(task)
    head = facts(command="python -m benchmarks.planning.survey_study --terrains FOLDER --write", processes=given.jobs)
    text = report(list(results.runs.values()), head)
    put_page(given.write, [text])
    print(f"{given.runs}: {len(open_)} runs made, {len(results.runs)} kept")


if __name__ == "__main__":
    main()
