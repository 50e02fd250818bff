"""``bathyfleet evaluate rescue``: search of a partly known site within a time window."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress as ProgressBar

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
    seed_list,
)
from app.evaluation.search.report import VARIANTS, report_jobs, search_report
from app.evaluation.search.run import SearchJob
from app.evaluation.search.world import SearchScenario
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import SEARCHERS
from simulator.obstacles.car_parks import SCENARIOS, car_park, harbour_basin
from simulator.obstacles.obstacles import ObstacleWorld

HARBOUR = "harbour"
CLOCKS = ("way", "steps")
COLUMNS = (
    "planner", "seed", "goal_area_pct", "map_pct", "returned_in_time", "collisions", "trapped", "plan_ms_median",
)  # fmt: skip


@evaluate_app.command("rescue")
def search(
    context: typer.Context,
    scenario: Annotated[str, typer.Option(help="Car park 1, 2 or 3, or harbour.")] = "1",
    rc: Annotated[float, typer.Option(min=1.0, help="Radius of the goal area in metres.")] = 50.0,
    planner: Annotated[
        str, typer.Option(help=f"One or more of {', '.join(sorted(SEARCHERS))}, separated by commas.")
    ] = "rollout",
    robots: Annotated[int, typer.Option(min=1, max=10)] = 1,
    window: Annotated[float, typer.Option(min=10.0, help="Time window, as metres of way (or steps of 1 m).")] = 3000.0,
    clock: Annotated[
        str, typer.Option(help="What uses up the window: way, or steps of whatever length (as in the paper).")
    ] = "way",
    seed: Seed = None,
    seeds: Seeds = None,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
    write: Annotated[
        Path | None,
        typer.Option(
            help="Make ACCESS13's tables in this folder; runs kept there are not repeated.", show_default=False
        ),
    ] = None,
    only: Annotated[
        str | None, typer.Option(help=f"With --write: one or more of {', '.join(VARIANTS)}, separated by commas.")
    ] = None,
    no_run: NoRun = False,
) -> None:
    """Run ACCESS13's searches: explore a goal area and the rest of a partly known site, and be back in time."""
    if clock not in CLOCKS:
        raise typer.BadParameter(f"{clock!r} is none of {', '.join(CLOCKS)}", param_hint="--clock")
    check_report(context, write, only, no_run=no_run)
    chosen = seed_list(seed, seeds)
    if write is not None:
        _report(write, chosen, seeds or str(chosen[0]), jobs, scheduler, only, no_run=no_run)
        return
    runs = [
        SearchJob(
            SearchScenario(
                _world(scenario, which), rc, window, robots, clock="steps" if clock == "steps" else "way", seed=which
            ),
            name,
            PlannerOptions(),
        )
        for name in planners_named(planner, tuple(SEARCHERS))
        for which in chosen
    ]
    compare(runs, COLUMNS, jobs, scheduler, as_json=as_json)


def _world(scenario: str, seed: int) -> ObstacleWorld:
    if scenario == HARBOUR:
        return harbour_basin(seed)
    if scenario not in map(str, SCENARIOS):
        there = ", ".join([*map(str, SCENARIOS), HARBOUR])
        raise typer.BadParameter(f"{scenario!r} is none of {there}", param_hint="--scenario")
    return car_park(int(scenario), seed)


def _report(
    out: Path, seeds: list[int], said: str, jobs: int, scheduler: str | None, only: str | None, *, no_run: bool
) -> None:
    from app.evaluation.runs.facts import made
    from app.evaluation.runs.store import Results

    names = list(VARIANTS) if only is None else [name.strip() for name in only.split(",")]
    for name in names:
        if name not in VARIANTS:
            there = ", ".join(VARIANTS)
            raise typer.BadParameter(f"there is no {name!r}; choose from {there}", param_hint="--only")
    out.mkdir(parents=True, exist_ok=True)
    results = Results(out / "rescue.jsonl")
    wanted = report_jobs(names, seeds)
    open_: list[Any] = [] if no_run else [job for job in wanted if job.key not in results.runs]
    with ProgressBar(disable=not open_) as bar:
        task = bar.add_task("searches", total=len(open_))
        for run in flown(open_, jobs, lambda job, step: bar.update(task, description=job.title), scheduler):
            results.add(run)
            bar.advance(task)
    command = f"bathyfleet evaluate rescue --write FOLDER --seeds {said} --jobs {jobs}"
    facts = made(command + (f" --only {only}" if only else ""), jobs)
    (out / "rescue.md").write_text(search_report(list(results.runs.values()), facts), encoding="utf-8")
    typer.echo(f"{out / 'rescue.md'}: {len(open_)} runs made, {len(results.runs)} kept", err=True)
