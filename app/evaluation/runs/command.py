"""What the commands of ``bathyfleet evaluate`` share: options, progress, and how their runs are shown."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from pydantic import ValidationError
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table

from app.evaluation.runs.cluster import ClusterError
from app.evaluation.runs.jobs import Job, run_jobs
from app.evaluation.runs.summary import summarise
from app.exploration.core.objective import TERMS
from app.exploration.pcao.model import PcaoModel
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import missing
from simulator.floors.terrain import Terrain, TerrainError
from simulator.floors.terrain_files import load_terrain

evaluate_app = typer.Typer(help="Compare planners in closed loop, without a network.", no_args_is_help=True)

TerrainFile = Annotated[Path, typer.Option("--terrain", help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.")]
Seeds = Annotated[str | None, typer.Option(help="Several runs: FIRST:END (END excluded), or a list 1,5,9.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")]
Regressors = Annotated[str, typer.Option(help="What CAO's estimator is linear in: map or polynomial.")]
NoRun = Annotated[bool, typer.Option("--no-run", help="With --write: only report the runs that are there.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes; with several seeds or planners, runs at a time.")]

Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster instead: tcp://HOST:PORT.")
]
ModelFile = Annotated[
    Path | None, typer.Option(help="What pcao flies with, a file of bathyfleet train [default: the one that ships]")
]


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show progress where a person looks on."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        yield bar


def compare(
    jobs: Sequence[Job], columns: tuple[str, ...], processes: int, scheduler: str | None = None, *, as_json: bool
) -> None:
    """Run everything and print a table, or one JSON object."""
    runs: list[dict[str, Any]] = []
    with progress_bar() as bar:
        task = bar.add_task("", total=sum(job.steps for job in jobs))

        def show(job: Job, step: int) -> None:
            bar.update(task, description=job.title, completed=sum(j.steps for j in jobs[: len(runs)]) + step)

        try:
            for run in run_jobs(jobs, processes, show, scheduler):
                runs.append(run)  # noqa: PERF402 - ``show`` counts them
        except ClusterError as error:
            raise typer.BadParameter(str(error), param_hint="--scheduler") from None
    if as_json:
        single = len(runs) == 1
        document = runs[0] if single else {"runs": runs, "summary": summarise(runs)}
        typer.echo(orjson.dumps(document).decode())
        return
    # Where there is little room a name takes more lines: cut off, several would read the same.
    table = Table(*(Column(name, overflow="fold") for name in columns))
    for row in runs:
        table.add_row(*(f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in columns))
    Console().print(table)


def model_of(path: Path | None) -> PcaoModel | None:
    """Return the trained controller in a file; None without one."""
    if path is None:
        return None
    try:
        return PcaoModel.model_validate_json(path.read_bytes())
    except OSError as error:
        raise typer.BadParameter(f"{path} cannot be read: {error.strerror}", param_hint="--model") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        said = f"{where}: {first['msg']}" if where else first["msg"]
        raise typer.BadParameter(f"{path} is no model file: {said}", param_hint="--model") from None


def planners_named(text: str, known: tuple[str, ...]) -> list[str]:
    """Return the planners that an option names."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{missing(name)}; choose from {', '.join(known)}", param_hint="--planner")
    if not names:
        raise typer.BadParameter(f"names no planner; choose from {', '.join(known)}", param_hint="--planner")
    return names


def seed_list(seed: int, seeds: str | None, option: str = "--seeds") -> list[int]:
    """Return the seeds that the options name."""
    if seeds is None:
        return [seed]
    try:
        first, colon, end = seeds.partition(":")
        chosen = list(range(int(first), int(end))) if colon else [int(part) for part in seeds.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{seeds!r} is neither FIRST:END nor a list like 1,5,9", param_hint=option) from None
    if not chosen or min(chosen) < 0:
        raise typer.BadParameter(f"{seeds!r} holds no number, or a negative one", param_hint=option)
    return chosen


def check_report(write: Path | None, only: str | None, *, no_run: bool) -> None:
    """Refuse what is said of a report that is not asked for."""
    if (only is not None or no_run) and write is None:
        raise typer.BadParameter("goes with --write only", param_hint="--only" if only is not None else "--no-run")


def planner_options(
    regressors: str, candidates: int | None, objective: str = "full", contribution: str = "vehicle"
) -> PlannerOptions:
    """Return the planner's options that were given."""
    for name, value, known in (
        ("regressors", regressors, ("map", "polynomial")),
        ("objective", objective, TERMS),
        ("contribution", contribution, ("team", "vehicle")),
    ):
        if value not in known:
            raise typer.BadParameter(f"{value!r} is none of {', '.join(known)}", param_hint=f"--{name}")
    settings: dict[str, Any] = {"regressors": regressors, "objective": objective, "contribution": contribution}
    if candidates is not None:
        settings["candidates"] = max(4, candidates)
    return PlannerOptions(**settings)


def terrain_of(path: Path) -> Terrain:
    """Return the sea floor in a file."""
    try:
        return load_terrain(path)
    except (TerrainError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="--terrain") from error
