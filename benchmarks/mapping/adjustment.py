"""What adjusting drifting tracks does to positions and map, on many floors.

    python -m benchmarks.mapping.adjustment [--terrains FOLDER] [--set own|unseen] [--seeds 0 1 2] [--drifts 3 6 10]
        [--single-beam] [--jobs 2] [--write]
    python -m benchmarks.mapping.adjustment --hour [--seeds 0 1 2] [--write]

The surveys of ``bathyfleet evaluate adjust``, two vehicles each. *own* are the floors of a folder, of which some were
looked at while the adjustment was made; *unseen* generated floors, one of each family, none of which was. Every row
is one floor: means of all seeds and drifts and in brackets the worst, after over before, where before is by reckoned
positions; how often ties were used (else fixes alone); and how many of the errors that are left lie within their 95
%. ``relief`` is the RMS of the floor about a plane: floors of less than 0.3 m are summed up as flat.

``--hour`` tells how long it takes to adjust what four vehicles with swath sonars measured in an hour, one after the
other.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress as ProgressBar

from app.evaluation.adjust.run import AdjustJob
from app.evaluation.adjust.world import DriftScenario
from app.evaluation.runs.jobs import run_jobs
from benchmarks.common.report import ADJUSTMENT, make_parser, write_section
from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

UNSEEN_SEED, UNSEEN_SIDE_M = 9203, 100.0
HOUR_SIDE_M, HOUR_FAMILY, HOUR_VEHICLES = 290.0, "rugged", 4
FLAT_M = 0.3
RATIOS = ("position_error_ratio", "rmse_ratio", "ties_rms_ratio")
NAMES = dict(zip(RATIOS, ("position", "map", "held-out ties"), strict=True))


def floors(options: argparse.Namespace) -> Iterator[tuple[str, Terrain]]:
    """Yield the floors by name."""
    if options.set == "unseen":
        for k, family in enumerate(sorted(FAMILIES)):
            yield family, generate(family, UNSEEN_SEED + k, width_m=UNSEEN_SIDE_M, height_m=UNSEEN_SIDE_M)
    elif options.terrains is not None:
        for file in sorted(options.terrains.glob("*.npz")):
            yield file.stem, load_terrain(file)


def relief_m(scenario: DriftScenario) -> float:
    """Return the RMS of the depths of what is surveyed about the plane that fits best."""
    west, south, east, north = scenario.rectangle_m
    at_east, at_north = np.meshgrid(np.arange(west + 0.5, east), np.arange(south + 0.5, north))
    depth = scenario.terrain.depth_at(at_east, at_north).ravel()
    plane = np.column_stack([at_east.ravel(), at_north.ravel(), np.ones(depth.size)])
    known = np.isfinite(depth)
    fit, *_ = np.linalg.lstsq(plane[known], depth[known])
    return float(np.sqrt(np.mean((depth[known] - plane[known] @ fit) ** 2)))


def row(runs: Sequence[dict[str, Any]]) -> str:
    """Return what is shown of several runs."""
    parts = []
    for name in RATIOS:
        values = [run[name] for run in runs if run[name] is not None]
        parts.append(f"{NAMES[name]} {np.mean(values):.2f} ({max(values):.2f})" if values else f"{NAMES[name]} -")
    by_ties = sum(run["by_ties"] for run in runs)
    within = np.mean([run["within_95_pct"] for run in runs])
    return f"{', '.join(parts)}, by ties {by_ties} of {len(runs)}, within {within:.0f} %"


def hour(seeds: Sequence[int], file: Path | None) -> None:
    """Print how long adjusting an hour's tracks takes."""
    rows = {}
    for seed in seeds:
        terrain = generate(HOUR_FAMILY, UNSEEN_SEED + seed, width_m=HOUR_SIDE_M, height_m=HOUR_SIDE_M)
        scenario = DriftScenario(terrain, 6.0, vehicles=HOUR_VEHICLES, seed=seed, largest_m=HOUR_SIDE_M)
        [run] = run_jobs([AdjustJob(scenario)], 1)
        by = "ties" if run["by_ties"] else "fixes"
        rows[f"seed {seed}"] = f"{run['minutes']:.0f} minutes each: {run['seconds']:.1f} s, by {by}"
        print(rows[f"seed {seed}"])
    write_section(file, ADJUSTMENT, "How long an hour of four vehicles takes", rows, seeds=seeds)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print it."""
    parser = make_parser(__doc__, ADJUSTMENT, seeds=(0, 1, 2))
    parser.add_argument("--terrains", type=Path, help="folder of .npz floors")
    parser.add_argument("--set", choices=["own", "unseen"], default="own")
    parser.add_argument("--drifts", type=float, nargs="+", default=[6.0], help="metres, RMS, at the end of a dive")
    parser.add_argument("--single-beam", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--hour", action="store_true", help="how long an hour's tracks take")
    options = parser.parse_args(arguments)
    if options.hour:
        hour(options.seeds, options.write)
        return
    if options.set == "own" and options.terrains is None:
        parser.error("--set own needs --terrains FOLDER")
    jobs = {
        (name, drift, seed): AdjustJob(DriftScenario(terrain, drift, swath=not options.single_beam, seed=seed))
        for name, terrain in floors(options)
        for drift in options.drifts
        for seed in options.seeds
    }
    runs: dict[str, list[dict[str, Any]]] = {}
    relief: dict[str, float] = {}
    with ProgressBar() as bar:
        task = bar.add_task("", total=len(jobs))
        for (name, *_), job, run in zip(jobs, jobs.values(), run_jobs(list(jobs.values()), options.jobs), strict=True):
            runs.setdefault(name, []).append(run)
            relief.setdefault(name, relief_m(job.scenario))
            bar.update(task, advance=1, description=name)
    rows = {name: f"relief {relief[name]:.1f} m, {row(found)}" for name, found in runs.items()}
    for group, least_m, most_m in (("with relief", FLAT_M, math.inf), ("flat", 0.0, FLAT_M)):
        those = [run for name, found in runs.items() if least_m <= relief[name] < most_m for run in found]
        if those:
            rows[f"all {group}"] = row(those)
    for name, text in rows.items():
        print(f"{name}: {text}")
    drifts = " and ".join(f"{drift:g}" for drift in options.drifts)
    sonar = "single beams" if options.single_beam else "swath sonars"
    title = f"Floors: {options.set}, {sonar}, drift {drifts} m"
    write_section(options.write, ADJUSTMENT, title, rows, seeds=options.seeds, hidden={options.terrains: "FOLDER"})


if __name__ == "__main__":
    main()
