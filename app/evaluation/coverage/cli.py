"""``bathyfleet evaluate coverage``: full coverage with a swath sonar."""

import math
from typing import Annotated

import typer

from app.estimation.swath import SwathSonar
from app.evaluation.coverage.run import CoverageJob
from app.evaluation.coverage.world import CoverageScenario, cell_by_depth_m
from app.evaluation.runs.command import (
    Jobs,
    Json,
    Scheduler,
    Seed,
    Seeds,
    TerrainFile,
    compare,
    evaluate_app,
    seed_list,
    terrain_of,
)

COLUMNS = (
    "seed",
    "ensonified_pct",
    "holidays",
    "density_ok_pct",
    "km",
    "minutes",
    "ratio_fixed",
    "ratio_known",
    "ratio_dune_rows",
    "ratio_edges",
)


@evaluate_app.command()
def coverage(
    terrain: TerrainFile,
    vehicles: Annotated[int, typer.Option(min=1, max=20)] = 1,
    sonar: Annotated[float, typer.Option(min=10.0, max=170.0, help="Aperture of the sonar, degrees.")] = 120.0,
    beams: Annotated[int, typer.Option(min=2, max=4096)] = 256,
    rate: Annotated[float, typer.Option(min=0.1, max=50.0, help="Pings a second.")] = 5.0,
    sonar_range: Annotated[float, typer.Option("--range", min=1.0, help="Largest slant range, metres.")] = 100.0,
    cell: Annotated[
        float | None,
        typer.Option(min=0.05, help="Side of a node, metres.", show_default="a twentieth of the median depth"),
    ] = None,
    seed: Seed = None,
    seeds: Seeds = None,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Cover a sea floor with a swath sonar, beside fixed lines, DUNE's rows, lines from edges, and known depths.

    Fixed lines are as far apart as the shoalest depth lets them be, known beforehand. Kilometres and minutes are those
    of all vehicles with their turns, and of the last one.
    """
    sea_floor = terrain_of(terrain)
    swath = SwathSonar(math.radians(sonar), beams, rate, sonar_range)
    cell_m = cell or cell_by_depth_m(sea_floor)
    runs = [
        CoverageJob(CoverageScenario(sea_floor, vehicles, swath, cell_m, seed=which))
        for which in seed_list(seed, seeds)
    ]
    compare(runs, COLUMNS, jobs, scheduler, as_json=as_json)
