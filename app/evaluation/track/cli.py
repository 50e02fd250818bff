"""``bathyfleet evaluate track``: moving targets and fading localization."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from app.estimation import Fading
from app.evaluation.runs.command import (
    Jobs,
    Json,
    NoRun,
    Scheduler,
    Seed,
    Seeds,
    check_report,
    compare,
    evaluate_app,
    flown,
    planners_named,
    progress_bar,
    seed_list,
    terrain_of,
)
from app.evaluation.track.run import TRACKERS
from app.evaluation.track.world import TrackScenario
from app.exploration.planner.options import PlannerOptions
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain

SETUPS = ("med13", "ngcuv12")
CELLS = 100.0
GENERATED = ("rugged", 1)
COLUMNS = (
    "planner", "seed", "remaining_pct", "target_tracked_pct", "localization_ok_pct", "resurfacings",
    "needless_resurfacings", "sum_of_error", "plan_ms_median",
)  # fmt: skip


@evaluate_app.command()
def track(
    context: typer.Context,
    setup: Annotated[
        str, typer.Option(help="med13: landmarks on a sea floor; ngcuv12: in the water, localization fades.")
    ] = "med13",
    terrain: Annotated[
        Path | None, typer.Option(help="Sea floor for med13; default: a generated one.", show_default=False)
    ] = None,
    planner: Annotated[
        str, typer.Option(help=f"One or more of {', '.join(TRACKERS)}, separated by commas.")
    ] = "rollout",
    robots: Annotated[int, typer.Option(min=1, max=20)] = 3,
    landmarks: Annotated[
        int | None, typer.Option(min=1, help="Default: 1000, with ngcuv12 300.", show_default=False)
    ] = None,
    targets: Annotated[int, typer.Option(min=0, max=20)] = 2,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    seed: Seed = None,
    seeds: Seeds = None,
    accuracy: Annotated[
        float, typer.Option(min=0.001, help="Standard deviation below which landmarks and targets belong to A.")
    ] = 0.1,
    com_range: Annotated[
        float | None, typer.Option(min=0.01, help="Communication range; unlimited by default.", show_default=False)
    ] = None,
    own_fix: Annotated[
        bool, typer.Option("--own-fix", help="ngcuv12: a fix relocalizes one vehicle, others by ranges to it.")
    ] = False,
    rollouts: Annotated[int, typer.Option(min=0, help="Changes to the team's plan that a rollout step tries.")] = 100,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
    write: Annotated[
        Path | None,
        typer.Option(
            help="Make the report of both papers' experiments in this folder; runs kept there are not repeated.",
            show_default=False,
        ),
    ] = None,
    only: Annotated[
        str | None, typer.Option(help="With --write: one or more experiments, separated by commas.")
    ] = None,
    no_run: NoRun = False,
) -> None:
    """Run MED13's and NGCUV12's scenarios: moving targets, fading localization, landmarks in three dimensions."""
    if setup not in SETUPS:
        raise typer.BadParameter(f"{setup!r} is none of {', '.join(SETUPS)}", param_hint="--setup")
    check_report(context, write, only, no_run=no_run, heeded=("terrain", "steps", "rollouts"))
    if terrain is not None and setup == "ngcuv12":
        raise typer.BadParameter("ngcuv12 has no sea floor; leave it out", param_hint="--terrain")
    if own_fix and setup != "ngcuv12":
        raise typer.BadParameter("med13's vehicles know where they are; use --setup ngcuv12", param_hint="--own-fix")
    family, number = GENERATED
    generated = generate(family, number, width_m=CELLS, height_m=CELLS)
    sea_floor = generated if terrain is None else replace(terrain_of(terrain), name=terrain.stem)
    chosen = seed_list(seed, seeds)
    if write is not None:
        report = _Report(write, steps, rollouts, jobs, scheduler, only, no_run)
        said = seeds or str(chosen[0])
        command = f"bathyfleet evaluate track --write FOLDER --seeds {said} --steps {steps} --rollouts {rollouts}"
        command += f" --jobs {jobs}" + (" --terrain FILE" if terrain else "") + (f" --only {only}" if only else "")
        report.make(sea_floor, chosen, command)
        return
    from app.evaluation.track.setups import TrackJob

    fading = Fading() if setup == "ngcuv12" else None
    scenario = TrackScenario(
        None if fading else sea_floor,
        robots,
        landmarks or (300 if fading else 1000),
        targets,
        steps,
        accuracy=accuracy,
        target_accuracy=accuracy,
        com_range=np.inf if com_range is None else com_range,
        fading=fading,
        shared_fix=not own_fix,
    )
    runs = [
        TrackJob(setup, name, replace(scenario, seed=which), PlannerOptions(rollouts=rollouts))
        for name in planners_named(planner, TRACKERS)
        for which in chosen
    ]
    compare(runs, COLUMNS, jobs, scheduler, as_json=as_json)


@dataclass(frozen=True)
class _Report:
    """The report of both papers' experiments in the folder ``out``; runs kept there are not repeated."""

    out: Path
    steps: int
    rollouts: int
    jobs: int
    scheduler: str | None
    only: str | None
    no_run: bool

    def make(self, sea_floor: Terrain, seeds: list[int], command: str) -> None:
        """Fly what is missing and write it all down; ``command`` is how it was asked for."""
        from app.evaluation.runs.facts import made
        from app.evaluation.runs.jobs import Job
        from app.evaluation.runs.store import Results
        from app.evaluation.track.consistency import consistency
        from app.evaluation.track.plots import draw
        from app.evaluation.track.report import markdown
        from app.evaluation.track.setups import experiments, report_jobs

        known = experiments(self.steps)
        names = [e.name for e in known] if self.only is None else [name.strip() for name in self.only.split(",")]
        for name in names:
            if name not in [e.name for e in known]:
                there = ", ".join(e.name for e in known)
                raise typer.BadParameter(f"there is no {name!r}; choose from {there}", param_hint="--only")
        chosen = [e for e in known if e.name in names]
        self.out.mkdir(parents=True, exist_ok=True)
        results = Results(self.out / "tracking.jsonl")
        wanted = list(report_jobs(chosen, sea_floor, seeds, self.rollouts))
        open_ = [] if self.no_run else [job for job in wanted if job.key not in results.runs]
        with progress_bar() as bar:
            task = bar.add_task("track", total=len(open_))

            def tell(job: Job, _step: int) -> None:
                bar.update(task, description=job.title)

            for run in flown(open_, self.jobs, tell, self.scheduler):
                results.add(run)
                bar.advance(task)
        facts = {**made(command, self.jobs), "sea floor": sea_floor.name}
        drawn = draw(wanted, results.runs, chosen, self.out / "images")
        pictures = {name: f"images/{file}" for name, file in drawn.items()}
        text = markdown(wanted, results.runs, chosen, facts, consistency(), pictures)
        (self.out / "tracking.md").write_text(text + "\n", encoding="utf-8")
        typer.echo(f"{self.out / 'tracking.md'}: {len(open_)} runs made, {len(results.runs)} kept")
