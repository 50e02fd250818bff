"""What the commands of ``bathyfleet evaluate`` share: options, progress, and how their runs are shown."""

from collections.abc import Callable, Collection, Iterator, Sequence
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

evaluate_app = typer.Typer(
    help="Compare planners in closed loop, without a network.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

TerrainFile = Annotated[Path, typer.Option("--terrain", help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of everything random.", show_default="0")]
Seeds = Annotated[str | None, typer.Option(help="Several runs: FIRST:END (END excluded), or a list 1,5,9.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")]
Regressors = Annotated[str, typer.Option(help="What CAO's estimator is linear in: map or polynomial.")]
NoRun = Annotated[bool, typer.Option("--no-run", help="With --write: only report the runs that are there.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes; with several seeds or planners, runs at a time.")]

Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster instead: tcp://HOST:PORT.")
]
ModelFile = Annotated[
    Path | None,
    typer.Option(help="What pcao flies with, a file of bathyfleet train.", show_default="the one that ships"),
]


WITH_REPORT = frozenset({"write", "seed", "seeds", "jobs", "scheduler", "only", "no_run"})
"""Options that a report of ``--write`` heeds in every command; what it flies is laid down by its experiments."""


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


def flown(
    jobs: Sequence[Job], processes: int, tell: Callable[[Job, int], None], scheduler: str | None
) -> Iterator[dict[str, Any]]:
    """Yield every job's result as ``run_jobs`` does; a cluster that cannot be used is the option's fault."""
    try:
        yield from run_jobs(jobs, processes, tell, scheduler)
    except ClusterError as error:
        raise typer.BadParameter(str(error), param_hint="--scheduler") from None


def compare(
    jobs: Sequence[Job], columns: tuple[str, ...], processes: int, scheduler: str | None = None, *, as_json: bool
) -> None:
    """Run everything and print a table, or one JSON object."""
    runs: list[dict[str, Any]] = []
    with progress_bar() as bar:
        task = bar.add_task("", total=sum(job.steps for job in jobs))

        def show(job: Job, step: int) -> None:
            bar.update(task, description=job.title, completed=sum(j.steps for j in jobs[: len(runs)]) + step)

        for run in flown(jobs, processes, show, scheduler):
            runs.append(run)  # noqa: PERF402 - ``show`` counts them
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


def model_of(path: Path | None, planners: Collection[str] = ("pcao",)) -> PcaoModel | None:
    """Return the trained controller in a file for those of the planners that fly with it; None without one."""
    if path is None:
        return None
    if "pcao" not in planners:
        raise typer.BadParameter(
            f"only pcao flies with a model, not {', '.join(planners)}: add --planner pcao", param_hint="--model"
        )
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
    """Return the planners that an option names, each once."""
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{missing(name)}; choose from {', '.join(known)}", param_hint="--planner")
    if not names:
        raise typer.BadParameter(f"names no planner; choose from {', '.join(known)}", param_hint="--planner")
    return names


def seed_list(seed: int | None, seeds: str | None, option: str = "--seeds") -> list[int]:
    """Return the seeds that the options name, each once: a run that is counted twice makes intervals too narrow."""
    if seeds is None:
        return [seed or 0]
    if seed is not None:
        raise typer.BadParameter(f"{option} names the seeds: leave out one of the two", param_hint="--seed")
    try:
        first, colon, end = seeds.partition(":")
        chosen = list(range(int(first), int(end))) if colon else [int(part) for part in seeds.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{seeds!r} is neither FIRST:END nor a list like 1,5,9", param_hint=option) from None
    if not chosen or min(chosen) < 0:
        raise typer.BadParameter(f"{seeds!r} holds no number, or a negative one", param_hint=option)
    return list(dict.fromkeys(chosen))


def check_report(
    context: typer.Context, write: Path | None, only: str | None, *, no_run: bool, heeded: Collection[str] = ()
) -> None:
    """Refuse what is said of a report that is not asked for, and beside one what it would not heed."""
    if write is None:
        if only is not None or no_run:
            raise typer.BadParameter("goes with --write only", param_hint="--only" if only is not None else "--no-run")
        return
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        if option.name in WITH_REPORT | set(heeded) or source is None or source.name != "COMMANDLINE":
            continue
        raise typer.BadParameter(
            "the report of --write flies its own experiments (--only chooses among them): leave it out",
            param_hint=option.opts[0],
        )


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
