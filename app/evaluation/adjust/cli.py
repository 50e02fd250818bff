"""``bathyfleet evaluate adjust``: what the adjustment of drifting tracks does to positions and map."""

from typing import Annotated

import typer

from app.evaluation.adjust.run import AdjustJob
from app.evaluation.adjust.world import DriftScenario
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

COLUMNS = ("seed", "position_error_ratio", "rmse_ratio", "ties_rms_ratio", "by_ties", "within_95_pct", "seconds")


@evaluate_app.command()
def adjust(
    terrain: TerrainFile,
    drift: Annotated[float, typer.Option(min=0.1, max=100.0, help="Error at the end of a dive, RMS, metres.")] = 6.0,
    vehicles: Annotated[int, typer.Option(min=1, max=20)] = 2,
    single_beam: Annotated[bool, typer.Option("--single-beam", help="Single beams in place of swath sonars.")] = False,
    seed: Seed = None,
    seeds: Seeds = None,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Survey a sea floor with vehicles whose positions drift, and adjust their tracks by ties and fixes.

    Ratios are those of errors after the adjustment over those before: of positions under way, of the map against the
    sea floor, and of sections' depths against those of others, of sections that were held out.
    """
    sea_floor = terrain_of(terrain)
    runs = [
        AdjustJob(DriftScenario(sea_floor, drift, vehicles, not single_beam, which)) for which in seed_list(seed, seeds)
    ]
    compare(runs, COLUMNS, jobs, scheduler, as_json=as_json)
