"""``bathyfleet evaluate``: planners against each other, without a network."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from app.evaluation.cube_world import COM_RANGE, ExploreScenario
from app.evaluation.explore import EXPLORERS, run_explore
from app.evaluation.recorded import recorded_soundings
from app.evaluation.summary import summarise
from app.evaluation.survey import run_survey
from app.evaluation.survey_world import Sampling, SurveyScenario
from app.exploration.options import PlannerOptions
from app.exploration.planners import PLANNERS, warm_up
from simulator.terrain import Terrain, TerrainError
from simulator.terrain_files import load_terrain

evaluate_app = typer.Typer(help="Compare planners in closed loop, without a network.", no_args_is_help=True)

Run = Callable[[str, int, Callable[[int], None]], dict[str, Any]]

TerrainFile = Annotated[Path, typer.Option("--terrain", help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.")]
Seeds = Annotated[str | None, typer.Option(help="Several runs: FIRST:END (END excluded), or a list 1,5,9.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")]
Regressors = Annotated[str, typer.Option(help="What CAO's estimator is linear in: map or polynomial.")]


@evaluate_app.command()
def explore(
    terrain: TerrainFile,
    planner: Annotated[str, typer.Option(help=f"One or more of {', '.join(EXPLORERS)}, separated by commas.")] = "cao",
    robots: Annotated[int, typer.Option(min=1, max=100)] = 3,
    landmarks: Annotated[int, typer.Option(min=1, help="Number of landmarks, spread at random.")] = 1100,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    seed: Seed = 0,
    seeds: Seeds = None,
    candidates: Annotated[
        int | None, typer.Option(min=0, help="Candidates per vehicle; for osarses the number of real tries.")
    ] = None,
    com_range: Annotated[float, typer.Option(min=0.01, help="Communication range.")] = COM_RANGE,
    regressors: Regressors = "map",
    as_json: Json = False,
) -> None:
    """Run the papers' scenario: landmarks in the cube [-1, 1]^3 (AURO15 section 6)."""
    names = _planners(planner, EXPLORERS)
    sea_floor = _terrain(terrain)

    def run(name: str, which: int, progress: Callable[[int], None]) -> dict[str, Any]:
        options = _options(regressors, None if name == "osarses" else candidates)
        if name == "osarses":
            options = options.model_copy(update={"tries": candidates or 0})
        scenario = ExploreScenario(sea_floor, robots, landmarks, steps, which, com_range)
        return asdict(run_explore(scenario, name, options, progress))

    columns = ("planner", "seed", "remaining_pct", "t99", "distance", "plan_ms_median", "wall_s")
    _compare(run, names, _seed_list(seed, seeds), steps, columns, as_json=as_json)


@evaluate_app.command()
def survey(
    terrain: TerrainFile,
    planner: Annotated[str, typer.Option(help=f"One or more of {', '.join(sorted(PLANNERS))}.")] = "cao",
    vehicles: Annotated[int, typer.Option(min=1, max=20)] = 2,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    max_step: Annotated[float, typer.Option(min=0.1, help="Largest leg in metres.")] = 2.5,
    sampling: Annotated[str, typer.Option(help="step: one sounding per leg; continuous: 5 Hz along it.")] = "step",
    seed: Seed = 0,
    seeds: Seeds = None,
    candidates: Annotated[int | None, typer.Option(min=4, help="Candidates per vehicle.")] = None,
    regressors: Regressors = "map",
    as_json: Json = False,
) -> None:
    """Run the papers' field experiment: map a sea floor with a single beam, beside the usual practice (AURO15)."""
    names = _planners(planner, tuple(sorted(PLANNERS)))
    if sampling not in ("step", "continuous"):
        raise typer.BadParameter(f"{sampling!r} is neither step nor continuous", param_hint="--sampling")
    how: Sampling = "step" if sampling == "step" else "continuous"
    sea_floor = _terrain(terrain)
    recorded = recorded_soundings(terrain)
    options = _options(regressors, candidates)

    def run(name: str, which: int, progress: Callable[[int], None]) -> dict[str, Any]:
        scenario = SurveyScenario(sea_floor, vehicles, steps, max_step, how, seed=which)
        result = asdict(run_survey(scenario, name, options, progress, recorded))
        if recorded is None:
            del result["recorded_track"], result["ratio_recorded"]
        return result

    columns = ("planner", "seed", "rmse_m", "ratio", "samples", "distance_m", "plan_ms_median")
    _compare(run, names, _seed_list(seed, seeds), steps, columns, as_json=as_json)


def _compare(
    run: Run, planners: list[str], seeds: list[int], steps: int, columns: tuple[str, ...], *, as_json: bool
) -> None:
    console = Console(stderr=True)
    warm_up()
    runs: list[dict[str, Any]] = []
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        for name in planners:
            for which in seeds:
                task = bar.add_task(f"{name}, seed {which}", total=steps)
                runs.append(run(name, which, lambda step, task=task: bar.update(task, completed=step)))  # type: ignore[misc]
                bar.remove_task(task)
    if as_json:
        single = len(runs) == 1
        document = runs[0] if single else {"runs": runs, "summary": summarise(runs)}
        typer.echo(orjson.dumps(document).decode())
        return
    table = Table(*columns)
    for row in runs:
        table.add_row(*(f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in columns))
    Console().print(table)


def _planners(text: str, known: tuple[str, ...]) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"there is no {name!r}; choose from {', '.join(known)}", param_hint="--planner")
    if not names:
        raise typer.BadParameter(f"names no planner; choose from {', '.join(known)}", param_hint="--planner")
    return names


def _seed_list(seed: int, seeds: str | None) -> list[int]:
    if seeds is None:
        return [seed]
    try:
        first, colon, end = seeds.partition(":")
        chosen = list(range(int(first), int(end))) if colon else [int(part) for part in seeds.split(",")]
    except ValueError:
        raise typer.BadParameter(
            f"{seeds!r} is neither FIRST:END nor a list like 1,5,9", param_hint="--seeds"
        ) from None
    if not chosen or min(chosen) < 0:
        raise typer.BadParameter(f"{seeds!r} holds no seed, or a negative one", param_hint="--seeds")
    return chosen


def _options(regressors: str, candidates: int | None) -> PlannerOptions:
    if regressors not in ("map", "polynomial"):
        raise typer.BadParameter(f"{regressors!r} is neither map nor polynomial", param_hint="--regressors")
    settings: dict[str, Any] = {"regressors": regressors}
    if candidates is not None:
        settings["candidates"] = max(4, candidates)
    return PlannerOptions(**settings)


def _terrain(path: Path) -> Terrain:
    try:
        return load_terrain(path)
    except (TerrainError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="--terrain") from error
