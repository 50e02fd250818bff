"""Whether what is claimed of landmarks holds in the papers' scenario, and what holding it costs the planner's finish.

    python -m benchmarks.planning.landmarks [--terrains FOLDER] [--seeds 0 2 4] [--only NAME,...] [--planners NAME,...]
        [--steps 300] [--jobs 1] [--runs FILE] [--write]

Each run is flown twice: with our estimator, and with the papers' weighted least squares, which presumes landmarks below
the vehicles. NEES is the mean squared error over its variance of landmarks that count as done at the end, 1 where
claims hold; *within 0.02* is the share of them whose depth is within the deviation that counts as done (68 % at that
very deviation, more as looks go on). t99 is the step at which 99 % are done. Generated floors are drawn by the run's
seed. Runs that ``--runs`` holds are not flown again, and others are added to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from rich.progress import Progress as ProgressBar

from app.arrays import FloatArray, IntArray
from app.estimation import LandmarkEstimator, Landmarks, RangeSensor, Sensor
from app.estimation.depth_least_squares import fit_depth
from app.evaluation.explore.run import run_explore
from app.evaluation.explore.terrains import CELLS, REAL
from app.evaluation.explore.world import ExploreScenario
from app.evaluation.runs.jobs import Progress, run_jobs
from app.exploration.planner.options import PlannerOptions
from benchmarks.common.report import LANDMARKS, make_parser, write_section
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

GENERATED = ("canyon", "flat", "harbour", "reef", "ridge", "rugged", "slope", "smooth")
OURS, PAPERS = "ours", "least squares"


class LeastSquares(LandmarkEstimator):
    """The papers' weighted least squares, linearised at each estimate, landmarks presumed below the vehicles."""

    def update(
        self, landmarks: Landmarks, vehicle: int, position: FloatArray, index: IntArray, ranges: FloatArray
    ) -> Landmarks:
        """Take in the ranges that one vehicle measured."""
        depth, variance, looks = landmarks.depth_m.copy(), landmarks.variance_m2.copy(), landmarks.looks.copy()
        accurate, credited = landmarks.accurate.copy(), landmarks.credited.copy()
        h2 = ((landmarks.xy_m[index] - position[:2]) ** 2).sum(axis=1)
        noise = self.sensor.relative_noise
        for k, m in enumerate(index):
            depth[m], variance[m] = fit_depth(depth[m], variance[m], h2[k], float(position[2]), ranges[k], noise)
        looks[index] += 1
        done = (variance[index] < self.accuracy_sd_m**2) | (looks[index] > self.visit_cap)
        fresh = index[done & ~accurate[index]]
        accurate[fresh], credited[fresh] = True, vehicle
        return replace(
            landmarks, depth_m=depth, variance_m2=variance, looks=looks, accurate=accurate, credited=credited
        )


@dataclass(frozen=True)
class LandmarkJob:
    """One run with one estimator."""

    scenario: ExploreScenario
    planner: str
    estimator: str

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.scenario.terrain.name}, seed {self.scenario.seed}, {self.planner}, {self.estimator}"

    @property
    def key(self) -> tuple[str, int, str, str]:
        """What tells it from others."""
        return self.scenario.terrain.name, self.scenario.seed, self.planner, self.estimator

    @property
    def steps(self) -> int:
        """Its length."""
        return self.scenario.steps

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return self.scenario.sensor

    def run(self, progress: Progress) -> dict[str, Any]:
        """Fly it."""
        estimator = LeastSquares(RangeSensor()) if self.estimator == PAPERS else None
        run = run_explore(replace(self.scenario, estimator=estimator), self.planner, PlannerOptions(), progress)
        return {
            "terrain": run.terrain, "seed": run.seed, "planner": self.planner, "estimator": self.estimator,
            "t99": run.t99, "left": run.remaining_pct, "nees": run.done_nees, "within": run.done_within_pct,
        }  # fmt: skip


def landmark_jobs(
    folder: Path | None, seeds: Sequence[int], planners: Sequence[str], steps: int, only: Sequence[str]
) -> list[LandmarkJob]:
    """Return every run: real floors where there is a folder, then generated ones."""
    jobs = []
    for seed in seeds:
        floors = [] if folder is None else [replace(load_terrain(folder / f"{name}.npz"), name=name) for name in REAL]
        floors += [_generated(family, seed) for family in GENERATED]
        scenarios = [
            ExploreScenario(floor, steps=steps, seed=seed) for floor in floors if floor.name in only or not only
        ]
        jobs += [
            LandmarkJob(scenario, planner, estimator)
            for scenario in scenarios
            for planner in planners
            for estimator in (OURS, PAPERS)
        ]
    return jobs


def figures(runs: Sequence[dict[str, Any]], steps: int) -> dict[str, str]:
    """Return what the report shows: means over the seeds, by planner and terrain, then over all of a planner."""
    found = {}
    for planner in dict.fromkeys(run["planner"] for run in runs):
        flown = [run for run in runs if run["planner"] == planner]
        for terrain in dict.fromkeys(run["terrain"] for run in flown):
            found[f"{planner}, {terrain}"] = _compared([run for run in flown if run["terrain"] == terrain], steps)
        found[f"{planner}, all"] = _compared(flown, steps)
    return found


def _compared(runs: Sequence[dict[str, Any]], steps: int) -> str:
    """Say what ours came to, in brackets the least squares, and the ratio of the sums of t99."""
    ours, papers = ([run for run in runs if run["estimator"] == name] for name in (OURS, PAPERS))
    # A run that does not finish counts as if it had on the step after its last.
    t99 = [np.array([float(run["t99"] or steps + 1) for run in part]) for part in (ours, papers)]
    nees, within, left = (
        [np.array([run[name] for run in part], dtype=float) for part in (ours, papers)]
        for name in ("nees", "within", "left")
    )
    n = len(t99[0])
    se = f" +- {(t99[0] - t99[1]).std(ddof=1) / np.sqrt(n) / t99[1].mean():.3f}" if n > 1 else ""
    return (
        f"NEES {nees[0].mean():.2f}, {nees[0].min():.2f} to {nees[0].max():.2f} (least squares {nees[1].mean():.1f});"
        f" within 0.02 {within[0].mean():.1f} % ({within[1].mean():.1f});"
        f" t99 {t99[0].mean():.1f} ({t99[1].mean():.1f}), ratio {t99[0].sum() / t99[1].sum():.3f}{se},"
        f" {n} runs;"
        f" left {left[0].mean():.2f} % ({left[1].mean():.2f})"
    )


def _generated(family: str, seed: int) -> Terrain:
    return replace(generate(family, seed, width_m=CELLS, height_m=CELLS), name=family)


def main() -> None:
    """Run what the command line asks for."""
    parser = make_parser(__doc__, LANDMARKS, seeds=[0, 2, 4])
    parser.add_argument("--terrains", type=Path, help="folder of terrain files")
    parser.add_argument("--only", default="", help="terrains, separated by commas")
    parser.add_argument("--planners", default="rollout", help="planners, separated by commas")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--runs", type=Path, help="file of runs that were flown before, a JSON object a line")
    given = parser.parse_args()
    only = [name for name in given.only.split(",") if name]
    jobs = landmark_jobs(given.terrains, given.seeds, given.planners.split(","), given.steps, only)
    flown = given.runs.read_bytes().splitlines() if given.runs is not None and given.runs.exists() else []
    before = {(run["terrain"], run["seed"], run["planner"], run["estimator"]): run for run in map(orjson.loads, flown)}
    open_ = [job for job in jobs if job.key not in before]
    runs = [before[job.key] for job in jobs if job.key in before]
    with ProgressBar() as bar:
        task = bar.add_task("landmarks", total=len(open_))
        for run in run_jobs(open_, given.jobs, lambda job, step: bar.update(task, description=job.title)):
            runs.append(run)
            if given.runs is not None:
                with given.runs.open("ab") as file:
                    file.write(orjson.dumps(run) + b"\n")
            bar.advance(task)
    found = figures(runs, given.steps)
    print("\n".join(f"{name}: {value}" for name, value in found.items()))
    title = f"Landmarks that count as done: {given.planners}"
    write_section(
        given.write, LANDMARKS, title, found, seeds=given.seeds, hidden={given.terrains: "FOLDER", given.runs: "FILE"}
    )


if __name__ == "__main__":
    main()
