"""``bathyfleet evaluate generalize``: every task on unseen floors."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from rich.console import Console
from rich.table import Column, Table

from app.evaluation.generalize.tasks import TASKS, FloorJob
from app.evaluation.runs.command import Json, Scheduler, evaluate_app, flown, progress_bar, seed_list
from app.evaluation.runs.store import Results
from simulator.floors.unseen_floors import UNSEEN, floor_names

FLOORS = 56
COLUMNS = ("task", "floors", "mean", "ci95", "greatest", "kept", "worst")


@evaluate_app.command()
def generalize(
    tasks: Annotated[str, typer.Option(help=f"One or more of {', '.join(TASKS)}, separated by commas.")] = (
        ",".join(TASKS)
    ),
    seeds: Annotated[
        str, typer.Option(help="Of the floors: even (development), odd (reported), FIRST:END, or a list 1,5,9.")
    ] = "even",
    floors: Annotated[int, typer.Option(min=1, max=10_000, help="Unseen floors per task, families in turn.")] = FLOORS,
    processes: Annotated[int, typer.Option(min=1, help="Runs at a time.")] = 1,
    scheduler: Scheduler = None,
    quick: Annotated[bool, typer.Option("--quick", help="A small version, to see that everything works.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of runs, report and pictures; runs kept there are not repeated.", show_default=False),
    ] = None,
    no_run: Annotated[bool, typer.Option("--no-run", help="With --out: only report the runs that are there.")] = False,
    as_json: Json = False,
) -> None:
    """Fly every task over sea floors that nobody developed on, beside its yardstick, and look at the worst five."""
    from app.evaluation.generalize.summary import summary_of

    chosen = _tasks(tasks)
    if no_run and out is None:
        raise typer.BadParameter("goes with --out only", param_hint="--no-run")
    places = list(floor_names(_seeds(seeds, floors), floors))
    if len(places) < floors:
        raise typer.BadParameter(
            f"{seeds!r} gives {len(places)} floors of {len(UNSEEN)} families, not {floors}: name more seeds",
            param_hint="--seeds",
        )
    jobs = [FloorJob(name, family, seed, "quick" if quick else "full") for name in chosen for family, seed in places]
    kept = _run(jobs, out, processes, scheduler, no_run=no_run)
    by_task = {name: [kept[job.key] for job in jobs if job.task == name and job.key in kept] for name in chosen}
    told = {name: summary_of(TASKS[name], runs) for name, runs in by_task.items() if runs}
    if out is not None:
        command = f"bathyfleet evaluate generalize --tasks {','.join(chosen)} --seeds {seeds} --floors {floors}"
        command += f" --processes {processes}" + (" --quick" if quick else "") + " --out FOLDER"
        _write(out, by_task, command, processes, len(jobs) - sum(map(len, by_task.values())))
    if as_json:
        typer.echo(orjson.dumps(told).decode())
        return
    table = Table(*(Column(name, overflow="fold") for name in COLUMNS))
    for name, of in told.items():
        figures = (f"{of[column]:.3g}" for column in ("mean", "ci95", "greatest"))
        table.add_row(name, str(of["floors"]), *figures, f"{of['kept']} of {of['floors']}", of["worst"][0]["floor"])
    Console().print(table)


def _tasks(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in TASKS:
            raise typer.BadParameter(f"there is no {name!r}; choose from {', '.join(TASKS)}", param_hint="--tasks")
    if not names:
        raise typer.BadParameter(f"names no task; choose from {', '.join(TASKS)}", param_hint="--tasks")
    return list(dict.fromkeys(names))


def _seeds(text: str, floors: int) -> Sequence[int]:
    """Return the seeds that the option names; of all even or odd ones as many as the floors need."""
    if text in ("even", "odd"):
        count = -(-floors // len(UNSEEN))
        return list(itertools.islice(itertools.count(0 if text == "even" else 1, 2), count))
    return seed_list(None, text)


def _run(
    jobs: Sequence[FloorJob], out: Path | None, processes: int, scheduler: str | None, *, no_run: bool
) -> dict[str, dict[str, Any]]:
    """Return the runs by their keys: those that were kept in ``out``, and those that are made now."""
    results = None
    kept: dict[str, dict[str, Any]] = {}
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        results = Results(out / "generalization.jsonl")
        kept = results.runs
    open_ = [] if no_run else [job for job in jobs if job.key not in kept]
    with progress_bar() as bar:
        task = bar.add_task("generalize", total=len(open_))
        for run in flown(open_, processes, lambda job, step: bar.update(task, description=job.title), scheduler):
            if results is None:
                kept[run["key"]] = run
            else:
                results.add(run)
            bar.advance(task)
    return kept


def _write(out: Path, runs: dict[str, list[dict[str, Any]]], command: str, processes: int, lacking: int) -> None:
    """Write the report, and a picture for each task."""
    from app.evaluation.generalize.plots import draw_worst
    from app.evaluation.generalize.report import markdown
    from app.evaluation.runs.facts import made

    pictures = {}
    for name, of in runs.items():
        if of:
            pictures[name] = f"images/generalization-{name}.png"
            draw_worst(name, TASKS[name], of, out / pictures[name])
    text = markdown(runs, made(command, processes), lacking, pictures)
    (out / "generalization.md").write_text(text + "\n", encoding="utf-8")
