"""The survey planner beside SGP-Tools, a published planner of informative paths, in the papers' field experiment.

    python -m venv PEER && PEER/bin/pip install "sgptools>=2.0"
    python -m benchmarks.planning.survey_peers --terrains FOLDER --peer-python PEER/bin/python [--only NAME,...]
        [--seeds 1] [--budgets 2.5,1.0] [--sampling step] [--methods ours,offline] [--iterations 25]
        [--ours docs/results/survey.jsonl] [--jobs 1] [--write] [--no-run]

SGP-Tools has a Python of its own because it needs numpy < 2 and this project numpy >= 2 (``sgp_tools.py`` talks to it).
2 vehicles, 500 steps, noise of 1 % of the range, terrains as in ``survey_study.py``. Methods:

``ours``
    The planner ``cao`` and the patterns, as ``bathyfleet evaluate survey`` flies them. With ``--ours`` they are taken
    from the runs that ``survey_study.py`` kept, where it has the same scenario.
``offline``
    Paths by SGP-Tools' ``ContinuousSGP`` with a stationary Matern 3/2 kernel. Its hyperparameters come from a pilot
    that costs nothing: the soundings of a whole lawnmower of the same budget, which do not count for the map.
``adaptive``
    Begins as ``offline``. After each quarter of the way hyperparameters of SGP-Tools' non-stationary ``Attentive``
    kernel are learned from the vehicles' own soundings so far, and the waypoints ahead are optimised anew.

The maps of both are judged like those of the patterns: the better of the default map and the stationary one. Runs are
kept in ``survey-peers.jsonl`` as soon as they are done, so that the comparison can be interrupted and goes on where it
was (with other ``--iterations`` those of SGP-Tools are made anew); ``survey-peers.md`` reports those that are there.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from rich.progress import Progress as ProgressBar

from app.arrays import FloatArray
from app.evaluation.runs.jobs import Progress, run_jobs
from app.evaluation.runs.store import Results
from app.evaluation.survey.run import judge
from app.evaluation.survey.world import SOUNDING_RATE_HZ, SPEED_MPS, SurveyScenario, fly_routes
from app.exploration.lines.lawnmower import lawnmower_routes
from app.mapping.types import Soundings
from benchmarks.common.report import Page, facts, make_parser, put_page
from benchmarks.planning.survey_study import PATCHY, STEPS, VEHICLES, StudyJob, best_pattern, chosen_floors, study_jobs

METHODS = ("ours", "offline", "adaptive")
REPLAN_AT = (0.25, 0.5, 0.75)
WORKER = Path(__file__).with_name("sgp_tools.py")
HOW_TO = 'python -m venv PEER && PEER/bin/pip install "sgptools>=2.0", then --peer-python PEER/bin/python'
VERSION = "from importlib.metadata import version; print(version('sgptools'))"
OF_OURS = ("rmse_m", "rmse_stationary_m", "samples", "distance_m", "plan_s", "usual_practice", "coverage", "ratio")

Run = Mapping[str, Any]


class Peer:
    """SGP-Tools in a process of its own."""

    def __init__(self, python: str) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [python, str(WORKER)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._said
        )

    def plan(self, **asked: Any) -> dict[str, Any]:
        """Return what ``sgp_tools.plan`` answers."""
        assert self._process.stdin is not None  # noqa: S101
        assert self._process.stdout is not None  # noqa: S101
        self._process.stdin.write(orjson.dumps(asked, option=orjson.OPT_SERIALIZE_NUMPY) + b"\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            self._said.seek(0)
            last = self._said.read().decode(errors="replace").splitlines()[-1:]
            raise RuntimeError(f"SGP-Tools gave up: {' '.join(last)}")
        found: dict[str, Any] = orjson.loads(answer)
        return found


@cache
def the_peer(python: str) -> Peer:
    """Return this process's peer: TensorFlow takes its time to start."""
    return Peer(python)


@dataclass(frozen=True)
class OursJob(StudyJob):
    """``cao`` and the patterns."""

    @property
    def title(self) -> str:
        return f"{self.job.scenario.terrain.name}, ours"

    def run(self, progress: Progress) -> dict[str, Any]:
        return {**what(self.key, "ours", self.job.scenario), **of_ours(self.job.run(progress)), "taken_from": None}


@dataclass(frozen=True)
class PeerJob:
    """A survey by SGP-Tools."""

    key: str
    method: str
    scenario: SurveyScenario
    python: str
    iterations: int

    @property
    def title(self) -> str:
        return f"{self.scenario.terrain.name}, SGP-Tools {self.method}"

    @property
    def steps(self) -> int:
        return self.scenario.steps

    @property
    def sensor(self) -> None:
        return None

    def run(self, progress: Progress) -> dict[str, Any]:
        peer, scenario, starts = the_peer(self.python), self.scenario, self.scenario.starts_m
        distance = scenario.steps * scenario.max_step_m
        asked = {
            "side_m": [scenario.terrain.width_m, scenario.terrain.height_m],
            "starts_m": np.ascontiguousarray(starts[:, :2]),
            "distance_m": distance,
            "max_step_m": scenario.max_step_m,
            "iterations": self.iterations,
            "seed": scenario.seed,
        }
        pilot = scenario.log(5)
        lines = lawnmower_routes(scenario.constraints, starts[:, :2], np.full(len(starts), distance))
        fly_routes(pilot, starts, lines, distance, scenario.max_step_m)
        plans = [peer.plan(**asked, kernel="matern32", soundings=table(pilot.soundings))]
        for part in REPLAN_AT if self.method == "adaptive" else ():
            paths = np.array(plans[-1]["paths_m"])
            visited = 1 + round(part * (paths.shape[1] - 1))
            so_far, _ = fly(scenario, paths[:, :visited], part)
            again = {"kernel": "attentive", "soundings": table(so_far), "paths_m": paths, "visited": visited}
            plans.append(peer.plan(**asked, **again))
        soundings, flown = fly(scenario, np.array(plans[-1]["paths_m"]), 1.0)
        judged = judge(scenario, soundings, flown, yardstick=True)
        progress(scenario.steps)
        times = {name: sum(plan[name] for plan in plans) for name in ("learn_s", "route_s", "optimise_s")}
        last = {name: plans[-1][name] for name in ("waypoints", "sampling_rate", "length_m", "versions")}
        first = {name: plans[0][name] for name in ("lengthscale_m", "noise_variance", "elbo")}
        result = asdict(judged)
        del result["l2_norm"], result["coverage_pct"]
        return {
            **what(self.key, self.method, scenario),
            **result,
            "plan_s": sum(times.values()),
            **times,
            **first,
            **last,
            "iterations": self.iterations,
        }


def what(key: str, method: str, scenario: SurveyScenario) -> dict[str, Any]:
    """Return what says which run it is."""
    return {
        "key": key,
        "method": method,
        "terrain": scenario.terrain.name,
        "symmetry": scenario.symmetry,
        "seed": scenario.seed,
        "vehicles": scenario.vehicles,
        "steps": scenario.steps,
        "max_step_m": scenario.max_step_m,
        "sampling": scenario.sampling,
    }


def of_ours(run: Run) -> dict[str, Any]:
    """Return what is kept of one of our runs."""
    return {name: run[name] for name in OF_OURS}


def table(soundings: Soundings) -> FloatArray:
    """Return east, north and depth, (n, 3)."""
    return np.column_stack([soundings.east_m, soundings.north_m, soundings.depth_m])


def fly(scenario: SurveyScenario, paths: FloatArray, part: float) -> tuple[Soundings, FloatArray]:
    """Fly the paths (vehicles, waypoints, 2), which begin at the starts; return soundings and distances.

    Every vehicle spreads the steps of that part of the mission evenly along its path, at most the largest step each.
    """
    log, steps = scenario.log(4), round(part * scenario.steps)
    flown = []
    for start, path in zip(scenario.starts_m, paths, strict=True):
        length = min(float(np.hypot(*np.diff(path, axis=0).T).sum()), steps * scenario.max_step_m)
        spacing = SPEED_MPS / SOUNDING_RATE_HZ if scenario.sampling == "continuous" else length / steps
        flown.append(fly_routes(log, start[None], [path[1:]], length, spacing)[0])
    return log.soundings, np.array(flown)


def report(runs: Sequence[Run], head: Sequence[str]) -> str:
    """Return the report in Markdown."""
    lines = ["# Surveys: beside SGP-Tools", ""]
    lines += head
    peers = [r for r in runs if r["method"] != "ours"]
    for versions in dict.fromkeys(", ".join(f"{k} {v}" for k, v in r["versions"].items()) for r in peers):
        lines += [f"- SGP-Tools in its own Python: {versions}"]
    seeds = sorted({r["seed"] for r in runs})
    lines += [f"- seeds (each with the symmetry of that number): {', '.join(map(str, seeds))}"]
    steps = sorted({r["iterations"] for r in peers})
    lines += [f"- iterations of SGP-Tools' optimiser (L-BFGS) per plan: {', '.join(map(str, steps))}"] if steps else []
    lines += [
        "",
        f"{VEHICLES} vehicles, {STEPS} steps, noise 1 % of the range to the bottom; every vehicle may travel {STEPS}"
        " times the largest step. RMSE in metres: ours of the default map, the others of the better of the default map"
        " and a stationary Matern 3/2 process; *pattern*: the better of lawnmower and equal-area coverage. *offline*:"
        " hyperparameters from the soundings of a whole lawnmower, which SGP-Tools gets for nothing and which are not"
        " in its map; *adaptive*: relearned three times from its own soundings with a non-stationary kernel. Planning"
        " in seconds for the whole mission: ours on the clock, SGP-Tools in CPU time of one thread.",
    ]
    for sampling, budget in sorted({(r["sampling"], r["max_step_m"]) for r in runs}):
        mine = [r for r in runs if (r["sampling"], r["max_step_m"]) == (sampling, budget)]
        for method in METHODS[1:]:
            rows = _table(mine, method)
            if rows:
                lines += ["", f"## Largest step {budget:g} m, sampling {sampling}, SGP-Tools {method}", "", *rows]
    return "\n".join(lines) + "\n"


def _table(runs: Sequence[Run], method: str) -> list[str]:
    """Return the rows of the terrains and symmetries that both have been run on."""
    ours = {(r["terrain"], r["symmetry"]): r for r in runs if r["method"] == "ours"}
    theirs = {(r["terrain"], r["symmetry"]): r for r in runs if r["method"] == method}
    both = [place for place in ours if place in theirs]
    if not both:
        return []
    rows = [
        "| terrain | runs | ours | SGP-Tools | pattern | ours / SGP-Tools | SGP-Tools / pattern | ours / pattern |"
        " planning, ours | planning, SGP-Tools |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    means: dict[str, FloatArray] = {}
    for name in sorted({name for name, _ in both}, key=lambda name: (name not in PATCHY, name)):
        mine = [(ours[place], theirs[place]) for place in both if place[0] == name]
        figures = []
        for a, b in mine:
            pattern = best_pattern(a)
            ratios = a["rmse_m"] / b["rmse_m"], b["rmse_m"] / pattern, a["rmse_m"] / pattern
            figures.append((a["rmse_m"], b["rmse_m"], pattern, *ratios, a["plan_s"], b["plan_s"]))
        means[name] = mean = np.mean(figures, axis=0)
        rows.append(
            f"| {name} | {len(mine)} | "
            + " | ".join(f"{value:.3f}" for value in mean[:6])
            + f" | {mean[6]:.0f} s | {mean[7]:.0f} s |"
        )
    for label, names in (("patchy", [n for n in means if n in PATCHY]), ("all", list(means))):
        if names:
            a, b, c = np.exp(np.mean([np.log(means[n][3:6]) for n in names], axis=0))
            rows.append(f"| *{label}, geometric mean* | {len(names)} | | | | {a:.3f} | {b:.3f} | {c:.3f} | | |")
    return rows


def command_for(runs: Sequence[Run]) -> str:
    """Return the command that makes all of these runs."""
    peers = [run for run in runs if run["method"] != "ours"]
    choices = {
        "--only": sorted({run["terrain"] for run in runs}),
        "--seeds": sorted({run["symmetry"] for run in runs}),
        "--methods": [method for method in METHODS if any(run["method"] == method for run in runs)],
        "--iterations": sorted({run["iterations"] for run in peers}),
    }
    given = [
        f"{option} {(' ' if option == '--seeds' else ',').join(map(str, values))}"
        for option, values in choices.items()
        if values
    ]
    given += ["--ours docs/results/survey.jsonl"] if any(run.get("taken_from") for run in runs) else []
    program = "python -m benchmarks.planning.survey_peers --terrains FOLDER --peer-python PEER/bin/python"
    return " ".join([program, *given, "--write"])


def is_kept(job: OursJob | PeerJob, runs: Mapping[str, Run]) -> bool:
    """Return whether the run is there; one of SGP-Tools with another number of iterations is made anew."""
    run = runs.get(job.key)
    return run is not None and (isinstance(job, OursJob) or run["iterations"] == job.iterations)


def taken(file: Path | None, jobs: Iterable[OursJob]) -> list[dict[str, Any]]:
    """Return our runs that the study has kept already."""
    if file is None:
        return []
    kept = Results(file).runs
    found = []
    for job in jobs:
        run = kept.get(job.key.removesuffix("/ours") + "/single")
        if run is not None:
            found.append({**what(job.key, "ours", job.job.scenario), **of_ours(run), "taken_from": file.name})
    return found


def main() -> None:
    parser = make_parser(__doc__, Page("survey-peers.md"), seeds=[1])
    parser.add_argument("--terrains", type=Path, help="folder of terrain files")
    parser.add_argument("--peer-python", default=sys.executable, help="a Python that has SGP-Tools")
    parser.add_argument("--budgets", default="2.5,1.0", help="largest steps in metres")
    parser.add_argument("--sampling", choices=("step", "continuous"), default="step")
    parser.add_argument("--methods", default="ours,offline", help=f"of {', '.join(METHODS)}")
    parser.add_argument("--only", help="terrains, separated by commas")
    parser.add_argument("--iterations", type=int, default=25, help="of SGP-Tools' optimiser per plan")
    parser.add_argument("--ours", type=Path, help="runs of survey_study.py to take ours from")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--runs", type=Path, default=Page("survey-peers.jsonl").path, help="where runs are kept")
    parser.add_argument("--no-run", action="store_true")
    given = parser.parse_args()
    methods = given.methods.split(",")
    if set(methods) - set(METHODS):
        parser.error(f"--methods: there is no {', '.join(sorted(set(methods) - set(METHODS)))}")
    if not given.no_run and set(methods) != {"ours"}:
        there = subprocess.run([given.peer_python, "-c", VERSION], capture_output=True, text=True, check=False)
        if there.returncode or int(there.stdout.partition(".")[0]) < 2:
            parser.error(f"--peer-python has no sgptools 2: {HOW_TO}")
    floors = chosen_floors(parser, given.terrains, given.only)
    budgets = [float(part) for part in given.budgets.split(",")]
    ours: list[OursJob] = []
    jobs: list[OursJob | PeerJob] = []
    for study in study_jobs(floors, given.seeds, budgets, [given.sampling], ["single"]):
        key = study.key.removesuffix("/single")
        for method in methods:
            if method == "ours":
                ours.append(OursJob(f"{key}/ours", study.job))
                jobs.append(ours[-1])
            else:
                scenario = study.job.scenario
                jobs.append(PeerJob(f"{key}/{method}", method, scenario, given.peer_python, given.iterations))
    results = Results(given.runs)
    for run in taken(given.ours, (job for job in ours if job.key not in results.runs)):
        results.add(run)
    open_ = [] if given.no_run else [job for job in jobs if not is_kept(job, results.runs)]
    with ProgressBar(disable=not open_) as bar:
        task = bar.add_task("surveys", total=len(open_))
        for run in run_jobs(open_, given.jobs, lambda job, step: bar.update(task, description=job.title)):
            results.add(run)
            bar.advance(task)
    head = facts(command=command_for(list(results.runs.values())), processes=given.jobs)
    text = report(list(results.runs.values()), head)
    put_page(given.write, [text])
    print(f"{given.runs}: {len(open_)} runs made, {len(results.runs)} kept")


if __name__ == "__main__":
    main()
