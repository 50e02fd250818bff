"""``bathyfleet evaluate survey``: the papers' field experiment."""

from typing import Annotated

import typer

from app.evaluation.runs.command import (
    Jobs,
    Json,
    ModelFile,
    Regressors,
    Scheduler,
    Seed,
    Seeds,
    TerrainFile,
    compare,
    evaluate_app,
    model_of,
    planner_options,
    planners_named,
    seed_list,
    terrain_of,
)
from app.evaluation.survey.job import SurveyJob
from app.evaluation.survey.recorded import recorded_soundings
from app.evaluation.survey.symmetry import SYMMETRIES, turned, turned_soundings
from app.evaluation.survey.world import SPEED_MPS, Sampling, Sounder, SurveyScenario
from app.exploration.planners import PLANNERS


@evaluate_app.command()
def survey(
    terrain: TerrainFile,
    planner: Annotated[str, typer.Option(help=f"One or more of {', '.join(sorted(PLANNERS))}.")] = "cao",
    vehicles: Annotated[int, typer.Option(min=1, max=20)] = 2,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    max_step: Annotated[float, typer.Option(min=0.1, help="Largest leg in metres.")] = 2.5,
    sampling: Annotated[str, typer.Option(help="step: one sounding per leg; continuous: 5 Hz along it.")] = "step",
    sounder: Annotated[
        str, typer.Option(help="single: a beam down; dvl: two more to the sides; swath: five across the way.")
    ] = "single",
    symmetries: Annotated[
        str,
        typer.Option(help="Turned and mirrored terrain as further runs: FIRST:END or a list out of 0 to 7; 0:8 all."),
    ] = "0",
    dynamics: Annotated[
        bool,
        typer.Option(
            "--dynamics",
            help="At sea: vehicles with turning circles, decisions that take time, each vehicle on its own time; the "
            "patterns fly for the same minutes.",
        ),
    ] = False,
    minutes: Annotated[
        float | None,
        typer.Option(min=0.1, help="How long a survey at sea lasts; by default what the steps take at 1.3 m/s."),
    ] = None,
    seed: Seed = None,
    seeds: Seeds = None,
    candidates: Annotated[int | None, typer.Option(min=4, help="Candidates per vehicle.")] = None,
    regressors: Regressors = "map",
    model: ModelFile = None,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Run the papers' field experiment: map a sea floor with a single beam, beside the usual practice (AURO15)."""
    names = planners_named(planner, tuple(sorted(PLANNERS)))
    if sampling not in ("step", "continuous"):
        raise typer.BadParameter(f"{sampling!r} is neither step nor continuous", param_hint="--sampling")
    if minutes is not None and not dynamics:
        raise typer.BadParameter("minutes are those of a survey at sea: give --dynamics, too", param_hint="--minutes")
    if dynamics and sounder != "single":
        raise typer.BadParameter("surveys at sea have a single beam", param_hint="--sounder")
    how: Sampling = "step" if sampling == "step" and not dynamics else "continuous"
    if sounder not in ("single", "dvl", "swath"):
        raise typer.BadParameter(f"{sounder!r} is none of single, dvl, swath", param_hint="--sounder")
    beams: Sounder = "single" if sounder == "single" else "dvl" if sounder == "dvl" else "swath"
    turns = seed_list(None, symmetries, "--symmetries")
    if max(turns) >= SYMMETRIES:
        raise typer.BadParameter(f"{symmetries!r} goes beyond {SYMMETRIES - 1}, the last", param_hint="--symmetries")
    sea_floor = terrain_of(terrain)
    recorded = recorded_soundings(terrain)
    options = planner_options(regressors, candidates).model_copy(update={"model": model_of(model, names)})
    runs = [
        SurveyJob(
            SurveyScenario(
                turned(sea_floor, turn), vehicles, steps, max_step, how, seed=which, sounder=beams, symmetry=turn
            ),
            name,
            options,
            None if recorded is None else turned_soundings(recorded, sea_floor, turn),
            (minutes or steps * max_step / SPEED_MPS / 60.0) if dynamics else None,
        )
        for name in names
        for which in seed_list(seed, seeds)
        for turn in turns
    ]
    columns = ("planner", "seed", "symmetry", "rmse_m", "ratio", "gap_closed", "samples", "distance_m", "plan_ms_p99")
    compare(runs, columns, jobs, scheduler, as_json=as_json)
