"""Surveys of whole sites beside the best even survey that fits the budget: real and generated ones of 0.1 to 10 km².

    python -m benchmarks.planning.survey_sites [--terrains FOLDER] [--seeds 1 2] [--parts 0.1,0.3,1.0] [--only NAME,...]
        [--jobs 1] [--write]

Each vehicle flies the same metres, sounding all along its way, noise 1 % of the range. Of generated sites the budget is
a part of full coverage, which is ``LINES`` lines along the longer side; of the real one (large_leixoes_west_1m in the
folder) 2.3 and 5.67 km per vehicle. *even* flies whole even lines, as many as fit, in the direction in which they lie
closer, and has the better of the default map and a stationary Matern 3/2 process; ours has the default map.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress as ProgressBar

from app.estimation import Sensor, SingleBeam
from app.evaluation.runs.jobs import Progress, run_jobs
from app.evaluation.survey.run import best_even_survey, fly_pattern
from app.evaluation.survey.world import SurveyScenario, default_map, fly_planner, rmse_m
from app.exploration.planner.options import PlannerOptions
from benchmarks.common.names import named
from benchmarks.common.report import PLANNING, make_parser, write_section
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

LINES = 40
STEP_M = 25.0
GENERATED = {
    "harbour": (400.0, 250.0, 2),
    "reef": (500.0, 500.0, 3),
    "canyon": (1000.0, 700.0, 2),
    "smooth": (800.0, 1200.0, 3),
    "rugged": (1500.0, 1000.0, 3),
    "ridge": (2000.0, 1500.0, 3),
    "reef_field": (3000.0, 3000.0, 4),
}
"""Width and height in metres, and vehicles."""
REAL, REAL_M, REAL_VEHICLES = "large_leixoes_west_1m", (2300.0, 5670.0), 3


@dataclass(frozen=True)
class SiteJob:
    """A survey by the default planner and the best even one."""

    scenario: SurveyScenario
    budget: str

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.scenario.terrain.name}, {self.budget}"

    @property
    def steps(self) -> int:
        """Its length."""
        return self.scenario.steps

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return SingleBeam(self.scenario.relative_noise)

    def run(self, progress: Progress) -> dict[str, Any]:
        """Fly both."""
        scenario = self.scenario
        track = fly_planner(scenario, "cao", PlannerOptions(), progress)
        ours, _ = rmse_m(default_map(track.soundings, scenario.grid), scenario.terrain)
        metres = scenario.steps * scenario.max_step_m
        routes = best_even_survey(scenario, metres)
        even = ours if routes is None else fly_pattern(scenario, routes, metres).rmse_m
        return {"site": scenario.terrain.name, "budget": self.budget, "ours": ours, "even": even}


def site_jobs(folder: Path | None, seeds: Sequence[int], parts: Sequence[float], only: Sequence[str]) -> list[SiteJob]:
    """Return every run."""
    jobs = []
    for seed in seeds:
        for family, (width, height, vehicles) in GENERATED.items():
            terrain = generate(family, seed, width_m=width, height_m=height, cell_m=max(width, height) / 400.0)
            full_m = LINES * max(width, height) / vehicles
            for part in parts:
                steps = max(4, round(part * full_m / STEP_M))
                jobs.append(SiteJob(_scenario(terrain, family, vehicles, steps, seed), f"{part:g} of full coverage"))
        if folder is not None:
            for metres in REAL_M:
                floor = load_terrain(folder / f"{REAL}.npz")
                jobs.append(
                    SiteJob(_scenario(floor, REAL, REAL_VEHICLES, round(metres / STEP_M), seed), f"{metres:g} m each")
                )
    return [job for job in jobs if not only or job.scenario.terrain.name in only]


def figures(runs: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return what the report shows: means over the seeds."""
    found = {}
    for site, budget in dict.fromkeys((r["site"], r["budget"]) for r in runs):
        mine = [r for r in runs if (r["site"], r["budget"]) == (site, budget)]
        ours, even = (np.array([r[name] for r in mine]) for name in ("ours", "even"))
        ratio = ours / even
        found[f"{site}, {budget}"] = (
            f"ours {ours.mean():.3f} m, even {even.mean():.3f} m, ratio {ratio.mean():.2f} (worst {ratio.max():.2f})"
        )
    ratios = np.array([r["ours"] / r["even"] for r in runs])
    found["ratio"] = (
        f"{ratios.mean():.3f} on average of {len(ratios)} runs, standard deviation {ratios.std():.3f}, worst"
        f" {ratios.max():.3f}; above 1.02 in {int((ratios > 1.02).sum())}"
    )
    return found


def main() -> None:
    """Run what the command line asks for."""
    parser = make_parser(__doc__, PLANNING, seeds=[1, 2])
    parser.add_argument("--terrains", type=Path, help="folder of terrain files")
    parser.add_argument("--parts", default="0.1,0.3,1.0", help="budgets as parts of full coverage")
    parser.add_argument("--only", default="", help="sites, separated by commas")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    parts = [float(part) for part in given.parts.split(",")]
    only = named(parser, "--only", given.only, [*GENERATED, *([REAL] if given.terrains else [])])
    jobs = site_jobs(given.terrains, given.seeds, parts, only)
    runs = []
    with ProgressBar() as bar:
        task = bar.add_task("sites", total=len(jobs))
        for run in run_jobs(jobs, given.jobs, lambda job, step: bar.update(task, description=job.title)):
            runs.append(run)
            bar.advance(task)
    found = figures(runs)
    print("\n".join(f"{name}: {value}" for name, value in found.items()))
    write_section(
        given.write, PLANNING, "Surveys of whole sites", found, seeds=given.seeds, hidden={given.terrains: "FOLDER"}
    )


def _scenario(terrain: Terrain, name: str, vehicles: int, steps: int, seed: int) -> SurveyScenario:
    return SurveyScenario(replace(terrain, name=name), vehicles, steps, STEP_M, "continuous", seed=seed)


if __name__ == "__main__":
    main()
