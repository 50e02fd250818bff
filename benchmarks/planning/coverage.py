"""Full coverage with a swath sonar on many floors, by teams of one to four.

    python -m benchmarks.planning.coverage [--terrains FOLDER] [--set own|large|unseen] [--vehicles 1 2 3 4]
        [--only NAME,...] [--seeds 0] [--jobs 2] [--write]

*own* are the floors of a folder and generated slopes of 5 to 40 m, *large* those whose names begin so; *unseen*
generated floors, one of each family and seed: those of seeds 0 and 1 were looked at while the planner was made, no
others. Every row is one floor and team: what is ensonified, holidays, nodes that are dense enough, kilometres and the
minutes until the last vehicle is done, kilometres over those of fixed lines (``fixed``, spaced for the shoalest depth,
known beforehand; with their minutes) and of the same survey with every depth known (``known``). ``varies`` is the
deepest over the shoalest depth of the middle 98 % of the area. With ``--write`` the page is written after every row.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress as ProgressBar

from app.estimation.swath import SwathSonar
from app.evaluation.coverage.run import CoverageJob
from app.evaluation.coverage.world import MIN_ALTITUDE_M, CoverageScenario, cell_by_depth_m
from app.evaluation.runs.jobs import run_jobs
from benchmarks.common.names import named
from benchmarks.common.report import COVERAGE, make_parser, write_section
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

SLOPES = {"slope_5_40_300": (300, 300, 5.0, 40.0, 0.0), "slope_5_40_turned": (250, 200, 5.0, 40.0, 0.7)}
UNSEEN_SIDE_M = (220.0, 160.0)
UNSEEN_SEED = 4711
VARIES = 2.0


def slope(cols: int, rows: int, shoal_m: float, deep_m: float, direction_rad: float) -> Terrain:
    """Return an inclined plane."""
    north, east = np.mgrid[0:rows, 0:cols] + 0.5
    at = east * math.cos(direction_rad) + north * math.sin(direction_rad)
    return Terrain(shoal_m + (deep_m - shoal_m) * (at - at.min()) / np.ptp(at), 1.0)


def floors(options: argparse.Namespace) -> Iterator[tuple[str, Terrain]]:
    """Yield the floors by name."""
    if options.set == "unseen":
        for k, family in enumerate(sorted(FAMILIES)):
            for seed in options.seeds:
                width, height = UNSEEN_SIDE_M if k % 2 else UNSEEN_SIDE_M[::-1]
                yield f"{family} {seed}", generate(family, UNSEEN_SEED + 17 * seed + k, width_m=width, height_m=height)
        return
    large = options.set == "large"
    for name, facts in SLOPES.items() if not large else ():
        yield name, slope(*facts)
    if options.terrains is not None:
        for file in sorted(options.terrains.glob("*.npz")):
            if file.stem.startswith("large") == large:
                yield file.stem, load_terrain(file)


def jobs_of(options: argparse.Namespace, parser: argparse.ArgumentParser) -> dict[tuple[str, int], CoverageJob]:
    """Return a job for each floor and team."""
    found, every = {}, dict(floors(options))
    for name in named(parser, "--only", options.only, every) or every:
        terrain = every[name]
        for vehicles in options.vehicles:
            scenario = CoverageScenario(
                terrain, vehicles, SwathSonar(), cell_by_depth_m(terrain), seed=options.seeds[0]
            )
            found[name, vehicles] = CoverageJob(scenario)
    return found


def varies(job: CoverageJob) -> float:
    """Return the deepest over the shoalest depth below the vehicles' least height, extremes left out."""
    depth = job.scenario.true_depth_m()[job.scenario.wanted()]
    low, high = np.quantile(depth, [0.01, 0.99])
    return float(high / max(low, MIN_ALTITUDE_M))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print it."""
    parser = make_parser(__doc__, COVERAGE, seeds=(0,))
    parser.add_argument("--terrains", type=Path, help="folder of .npz floors")
    parser.add_argument("--set", choices=["own", "large", "unseen"], default="own")
    parser.add_argument("--vehicles", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument("--only", help="names of floors, separated by commas")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(arguments)
    jobs = jobs_of(options, parser)
    rows: dict[str, Any] = {}
    found: list[tuple[float, dict[str, Any]]] = []
    with ProgressBar() as bar:
        task = bar.add_task("", total=len(jobs))
        for (name, vehicles), job, run in zip(
            jobs, jobs.values(), run_jobs(list(jobs.values()), options.jobs), strict=True
        ):
            found.append((varies(job), run))
            rows[f"{name}, {vehicles}"] = row(*found[-1])
            print(f"{name}, {vehicles}:", rows[f"{name}, {vehicles}"], flush=True)
            bar.update(task, advance=1, description=name)
            write_section(options.write, COVERAGE, f"Floors: {options.set}", rows | summary(found), seeds=options.seeds)
    for name, line in summary(found).items():
        print(f"{name}:", line)


def row(depths: float, run: dict[str, Any]) -> str:
    """Return what is shown of a run."""
    return (
        f"varies {depths:.1f}, ensonified {run['ensonified_pct']:.2f} %, holidays {run['holidays']}, "
        f"dense {run['density_ok_pct']:.1f} %, {run['km']:.2f} km in {run['minutes']:.0f} min, "
        f"fixed {run['ratio_fixed']:.2f} in {run['fixed']['minutes']:.0f} min, known {run['ratio_known']:.2f}"
    )


def summary(found: list[tuple[float, dict[str, Any]]]) -> dict[str, str]:
    """Return the worst and the mean of all, and of floors whose depth varies by a factor of two and of the others."""

    def ratios(runs: list[dict[str, Any]]) -> str:
        fixed, known = (np.array([run[name] for run in runs]) for name in ("ratio_fixed", "ratio_known"))
        return (
            f"fixed: mean {fixed.mean():.3f}, worst {fixed.max():.3f}; "
            f"known: mean {known.mean():.3f}, worst {known.max():.3f}"
        )

    runs = [run for _, run in found]
    groups = {
        "varied": [run for depths, run in found if depths >= VARIES],
        "even": [run for depths, run in found if depths < VARIES],
    }
    return {
        "all": f"ensonified at least {min(run['ensonified_pct'] for run in runs):.2f} %, "
        f"holidays {sum(run['holidays'] for run in runs)}, dense at least "
        f"{min(run['density_ok_pct'] for run in runs):.1f} %"
    } | {name: ratios(group) for name, group in groups.items() if group}


if __name__ == "__main__":
    main()
