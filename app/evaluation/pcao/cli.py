"""``bathyfleet evaluate pcao``: PCAO18's tables and figures, beside the published ones."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from app.evaluation.runs.command import Scheduler, evaluate_app, flown, model_of, progress_bar, seed_list


@evaluate_app.command()
def pcao(
    out: Annotated[
        Path, typer.Option(help="Folder of report, pictures and results; an existing one is completed.")
    ] = Path("docs/results"),
    seeds: Annotated[str, typer.Option(help="FIRST:END (END excluded), or a list; trainings use those below 100.")] = (
        "100:130"
    ),
    terrains: Annotated[
        Path | None, typer.Option(help="Folder of real terrain files; generated ones are added.")
    ] = None,
    model: Annotated[Path | None, typer.Option(help="Model file.", show_default="the one that ships")] = None,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    landmarks: Annotated[int, typer.Option(min=10)] = 1100,
    iterations: Annotated[int, typer.Option(min=1, help="Controllers tried per search of figure 2.")] = 250,
    searches: Annotated[int, typer.Option(min=1, help="Searches per method of figure 2.")] = 2,
    team_runs: Annotated[int, typer.Option(min=1, help="Runs per team size and sea floor.")] = 5,
    jobs: Annotated[int | None, typer.Option(min=1, help="Runs at a time.", show_default="all cores")] = None,
    scheduler: Scheduler = None,
    only: Annotated[
        str | None, typer.Option(help="One or more of curves, tables, others, teams, se500, separated by commas.")
    ] = None,
    no_run: Annotated[bool, typer.Option("--no-run", help="Only report the results that are there.")] = False,
) -> None:
    """Rerun PCAO18's tables II to VI and figure 2 over many runs, beside its figures, and report."""
    from app.evaluation.pcao.plots import draw_learning, draw_time
    from app.evaluation.pcao.report import markdown
    from app.evaluation.pcao.simulation.world import LANDMARKS, STEPS
    from app.evaluation.pcao.speed import speed_lines
    from app.evaluation.pcao.study import PARTS, Study
    from app.evaluation.runs.facts import made
    from app.evaluation.runs.store import Results
    from app.exploration.pcao.model import default_model

    parts = list(PARTS) if only is None else [name.strip() for name in only.split(",")]
    for name in parts:
        if name not in PARTS:
            raise typer.BadParameter(f"there is no {name!r}; choose from {', '.join(PARTS)}", param_hint="--only")
    if terrains is not None and not terrains.is_dir():
        raise typer.BadParameter(f"{terrains} is not a folder", param_hint="--terrains")
    processes = jobs or os.cpu_count() or 1
    chosen = model_of(model) or default_model()
    study = Study(terrains, seed_list(None, seeds), chosen, steps, landmarks, iterations, searches, range(team_runs))
    out.mkdir(parents=True, exist_ok=True)
    results = Results(out / "pcao.jsonl")

    def make(wanted: Sequence[Any]) -> int:
        open_ = [] if no_run else [job for job in wanted if job.key not in results.runs]
        with progress_bar() as bar:
            task = bar.add_task("pcao", total=len(open_))
            for run in flown(open_, processes, lambda job, step: bar.update(task, description=job.title), scheduler):
                results.add(run)
                bar.advance(task)
        return len(open_)

    count = make(study.jobs([part for part in parts if part != "tables"]) if "curves" in parts else [])
    count += make(study.jobs(parts, results.runs))
    found = study.findings(results.runs)
    command = f"bathyfleet evaluate pcao --seeds {seeds} --iterations {iterations} --searches {searches}"
    command += f" --team-runs {team_runs}" + (" --terrains FOLDER" if terrains else "")
    command += "".join(
        [f" --steps {steps}" if steps != STEPS else "", f" --landmarks {landmarks}" if landmarks != LANDMARKS else ""]
    )
    command += "".join([f" --model {model.name}" if model else "", f" --only {only}" if only else ""])
    images = out / "images"
    images.mkdir(exist_ok=True)
    drawn = draw_time(images / "pcao-time.png", found) and draw_learning(images / "pcao-learning.png", found)
    text = markdown(found, chosen, made(command, processes), speed_lines(np.random.default_rng(0), chosen), drawn)
    (out / "pcao.md").write_text(text + "\n", encoding="utf-8")
    typer.echo(f"{out / 'pcao.md'}: {count} runs made, {len(results.runs)} kept")
