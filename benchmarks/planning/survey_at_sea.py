"""Surveys at sea beside patterns flown for the same minutes: the demonstration's mission, and floors of 100 x 100 m.

    python -m benchmarks.planning.survey_at_sea [--terrains FOLDER] [--seeds 0 1 ...] [--sets demo,floors,unseen]
        [--only NAME,...] [--jobs 1] [--write]

Every run is what ``bathyfleet evaluate survey --dynamics`` does: 2 vehicles with turning circles, each 600 m at
1.3 m/s, legs of 10 m ahead, decisions that take half a second, noise of 1 % of the range. ``demo`` is the harbour with
the seed of the run, ``floors`` those of the study (:mod:`.survey_study`), ``unseen`` generated ones of every family
whose seeds nothing was chosen on. *ratio* is our RMSE over that of the best of three patterns; each of these has the
better of two maps, and choosing the best of three afterwards has luck in it. *lasting* is our mean over the mean of the
pattern that is best on average. *over lawnmower lines* is our RMSE over that of the planner ``lawnmower``, which fits
its lines to the way that there is, flown and mapped as ours: a geometric mean with its 95 % interval.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress as ProgressBar

from app.evaluation.runs.jobs import run_jobs
from app.evaluation.runs.summary import spread
from app.evaluation.survey.job import SurveyJob
from app.evaluation.survey.world import SPEED_MPS, SurveyScenario
from app.exploration.planner.options import PlannerOptions
from benchmarks.common.names import named
from benchmarks.common.report import FLIGHT, make_parser, write_section
from benchmarks.planning.survey_study import PATCHY, PATTERNS, sea_floors
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain

VEHICLES, STEPS, STEP_M = 2, 60, 10.0
MINUTES = STEPS * STEP_M / SPEED_MPS / 60.0
OURS, YARDSTICK = "cao", "lawnmower"
UNSEEN = 1000
"""Added to the seed where generated floors are to be others than those that anything was chosen on."""


SETS = ("demo", "floors", "unseen")


def floors(sets: Sequence[str], folder: Path | None, seed: int) -> Iterator[tuple[str, Terrain]]:
    """Yield the sea floors of some sets under one seed, each with the name of its set."""
    if "demo" in sets:
        yield "demo", replace(generate("harbour", seed), name=f"demo {seed}")
    if "floors" in sets:
        for floor in sea_floors(folder):
            yield "floors", replace(floor.terrain, name=floor.name)
    if "unseen" in sets:
        for family in sorted(FAMILIES):
            yield "unseen", replace(generate(family, UNSEEN + seed), name=f"unseen {family}")


def figures(runs: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return what the report shows: the mean ratio of every set with its 95 % interval, then floor by floor."""
    found = {}
    for name in dict.fromkeys(run["set"] for run in runs):
        mine = [run for run in runs if run["set"] == name]
        found[name] = _ratio(mine)
        patchy = [run for run in mine if run["terrain"] in PATCHY]
        if patchy:
            found[f"{name}, patchy"] = _ratio(patchy)
        found[f"{name}, over lawnmower lines"] = _over_lawnmower(mine)
    for terrain in dict.fromkeys(run["terrain"] for run in runs):
        found[terrain] = _ratio([run for run in runs if run["terrain"] == terrain])
    return found


def _ratio(runs: Sequence[dict[str, Any]]) -> str:
    ratios = spread([run["ratio"] for run in runs])
    ours = np.mean([run["rmse_m"] for run in runs])
    patterns = np.min([np.mean([run[name]["rmse_m"] for run in runs]) for name in PATTERNS])
    interval = f" ± {ratios.ci95:.3f}" if len(runs) > 1 else ""
    return f"{ratios.mean:.3f}{interval} of {len(runs)}, worst {ratios.max:.3f}, lasting {ours / patterns:.3f}"


def _over_lawnmower(runs: Sequence[dict[str, Any]]) -> str:
    logs = spread([float(np.log(run["rmse_m"] / run[YARDSTICK]["rmse_m"])) for run in runs])
    mean = float(np.exp(logs.mean))
    interval = f" ± {mean * logs.ci95:.3f}" if len(runs) > 1 else ""
    return f"{mean:.3f}{interval} of {len(runs)}, {np.exp(logs.min):.3f} to {np.exp(logs.max):.3f}"


def main() -> None:
    """Run what the command line asks for."""
    parser = make_parser(__doc__, FLIGHT, seeds=[0])
    parser.add_argument("--terrains", type=Path, help="folder of terrain files")
    parser.add_argument("--sets", default="demo", help=f"{', '.join(SETS)}, separated by commas")
    parser.add_argument("--only", default="", help="names of sea floors, separated by commas")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    sets = named(parser, "--sets", given.sets, SETS)
    every = {seed: list(floors(sets, given.terrains, seed)) for seed in given.seeds}
    only = named(parser, "--only", given.only, (terrain.name for drawn in every.values() for _, terrain in drawn))
    jobs, flown_over = [], []
    for seed, drawn in every.items():
        for name, terrain in drawn:
            if only and terrain.name not in only:
                continue
            scenario = SurveyScenario(terrain, VEHICLES, STEPS, STEP_M, "continuous", seed=seed)
            jobs += [SurveyJob(scenario, planner, PlannerOptions(), None, MINUTES) for planner in (OURS, YARDSTICK)]
            flown_over.append((name, terrain.name, seed))
    by_run = {}
    with ProgressBar() as bar:
        task = bar.add_task("surveys", total=len(jobs))
        for run in run_jobs(jobs, given.jobs, lambda job, step: bar.update(task, description=job.title)):
            by_run[run["terrain"], run["seed"], run["planner"]] = run
            bar.advance(task)
    runs = [
        {**by_run[floor, seed, OURS], "set": name, YARDSTICK: by_run[floor, seed, YARDSTICK]}
        for name, floor, seed in flown_over
    ]
    found = figures(runs)
    print("\n".join(f"{name}: {value}" for name, value in found.items()))
    title = f"Surveys at sea: {(given.only or given.sets).replace(',', ', ')}"
    found["load_of_the_machine"] = f"{os.getloadavg()[2]:.1f}"
    write_section(given.write, FLIGHT, title, found, seeds=given.seeds, hidden={given.terrains: "FOLDER"})


if __name__ == "__main__":
    main()
