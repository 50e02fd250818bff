"""``bathyfleet evaluate explore`` and ``tables``: the papers' scenario."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from app.estimation import Sensor
from app.evaluation.explore.run import EXPLORERS, OSARSES, run_explore
from app.evaluation.explore.team_changes import TeamSchedule, parse_changes
from app.evaluation.explore.world import COM_RANGE, ExploreScenario
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
    flown,
    model_of,
    planner_options,
    planners_named,
    progress_bar,
    seed_list,
    terrain_of,
)
from app.evaluation.runs.jobs import Progress as StepProgress
from app.exploration.communication.messages import MAX_ENTRIES
from app.exploration.core.objective import TERMS
from app.exploration.planner.options import PlannerOptions
from simulator.floors.terrain import TerrainError

EVERY_CELL = "all"


@dataclass(frozen=True)
class ExploreJob:
    """One run of ``explore``."""

    scenario: ExploreScenario
    planner: str
    options: PlannerOptions

    @property
    def title(self) -> str:
        """What it is, for the progress bar."""
        return f"{self.planner}, seed {self.scenario.seed}"

    @property
    def steps(self) -> int:
        """Its length."""
        return self.scenario.steps

    @property
    def sensor(self) -> Sensor:
        """What its vehicles measure with."""
        return self.scenario.sensor

    def run(self, progress: StepProgress) -> dict[str, Any]:
        """Run it."""
        return asdict(run_explore(self.scenario, self.planner, self.options, progress))


@evaluate_app.command()
def explore(
    terrain: TerrainFile,
    planner: Annotated[
        str, typer.Option(help=f"One or more of {', '.join(EXPLORERS)}, separated by commas.")
    ] = "rollout",
    robots: Annotated[int, typer.Option(min=1, max=100)] = 3,
    landmarks: Annotated[
        str, typer.Option(help="Number of landmarks, spread at random; all: one per cell of the terrain file.")
    ] = "1100",
    steps: Annotated[int, typer.Option(min=1)] = 500,
    seed: Seed = None,
    seeds: Seeds = None,
    candidates: Annotated[
        int | None, typer.Option(min=0, help="Candidates per vehicle; for osarses the number of real tries.")
    ] = None,
    com_range: Annotated[float, typer.Option(min=0.01, help="Communication range.")] = COM_RANGE,
    keep_out: Annotated[
        float, typer.Option(metavar="FRACTION", help="Part of the area covered by keep-out rectangles.")
    ] = 0.0,
    lose: Annotated[
        str | None, typer.Option(metavar="K@T,...", help="Vehicle K is lost when step T begins; 1 is the first.")
    ] = None,
    join: Annotated[
        str | None,
        typer.Option(
            metavar="K@T,...", help="K vehicles join when step T begins, half to 0.8 of the range from another."
        ),
    ] = None,
    line_of_sight: Annotated[
        bool, typer.Option("--line-of-sight", help="The true sea floor hides what lies behind it.")
    ] = False,
    capacity: Annotated[
        int | None,
        typer.Option(min=1, max=MAX_ENTRIES, help="Landmark entries per message each way; unlimited by default."),
    ] = None,
    message_loss: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="FRACTION", help="Messages lost; needs --capacity.")
    ] = 0.0,
    regressors: Regressors = "map",
    objective: Annotated[str, typer.Option(help=f"What is measured after a step: {', '.join(TERMS)}.")] = "full",
    contribution: Annotated[
        str, typer.Option(help="CAO learns from the whole team's J or each vehicle's.")
    ] = "vehicle",
    model: ModelFile = None,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Run the papers' scenario: landmarks in the cube [-1, 1]^3 (AURO15 section 6)."""
    names = planners_named(planner, EXPLORERS)
    if capacity is not None and OSARSES in names:
        raise typer.BadParameter(
            "osarses tries its moves on everything that is known; leave it out", param_hint="--capacity"
        )
    sea_floor = terrain_of(terrain)
    count = _landmark_count(landmarks)
    changes = TeamSchedule(_changes(lose, "--lose"), _changes(join, "--join"))
    runs = []
    trained = model_of(model, names)
    for name in names:
        options = planner_options(regressors, None if name == "osarses" else candidates, objective, contribution)
        options = options.model_copy(update={"model": trained if name == "pcao" else None})
        if name == "osarses":
            options = options.model_copy(update={"tries": candidates or 0})
        for which in seed_list(seed, seeds):
            try:
                scenario = ExploreScenario(
                    sea_floor,
                    robots,
                    count,
                    steps,
                    which,
                    com_range,
                    keep_out_fraction=keep_out,
                    changes=changes,
                    line_of_sight=line_of_sight,
                    capacity=capacity,
                    message_loss=message_loss,
                )
            except ValueError as error:
                raise typer.BadParameter(str(error)) from None
            runs.append(ExploreJob(scenario, name, options))

    columns = ("planner", "seed", "remaining_pct", "t99", "broken_constraints", "plan_ms_median")
    compare(runs, columns, jobs, scheduler, as_json=as_json)


@evaluate_app.command()
def tables(
    out: Annotated[
        Path, typer.Option(help="Folder of report, pictures and results; an existing one is completed.")
    ] = Path("docs/results"),
    seeds: Annotated[str, typer.Option(help="FIRST:END (END excluded), or a list 1,5,9.")] = "0:10",
    terrains: Annotated[
        Path | None, typer.Option(help="Folder of real terrain files; generated ones are added.")
    ] = None,
    steps: Annotated[int, typer.Option(min=1)] = 500,
    jobs: Jobs = 1,
    scheduler: Scheduler = None,
    only: Annotated[str | None, typer.Option(help="One or more tables, separated by commas.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A small version: few tries, few landmarks.")] = False,
    no_run: Annotated[bool, typer.Option("--no-run", help="Only report the results that are there.")] = False,
) -> None:
    """Rerun the papers' tables and figures over many seeds, beside our planners and the lawnmower, and report."""
    from app.evaluation.explore.plots import draw
    from app.evaluation.explore.report import Report, markdown
    from app.evaluation.explore.setups import jobs_of, sections
    from app.evaluation.explore.terrains import report_terrains
    from app.evaluation.runs.facts import made
    from app.evaluation.runs.store import Results

    known = sections(steps, quick=quick)
    names = [section.name for section in known] if only is None else [name.strip() for name in only.split(",")]
    for name in names:
        if name not in [section.name for section in known]:
            there = ", ".join(section.name for section in known)
            raise typer.BadParameter(f"there is no {name!r}; choose from {there}", param_hint="--only")
    if terrains is not None and not terrains.is_dir():
        raise typer.BadParameter(f"{terrains} is not a folder", param_hint="--terrains")
    chosen = [section for section in known if section.name in names]
    try:
        sea_floors, missing = report_terrains(terrains)
    except (TerrainError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="--terrains") from error
    chosen_seeds = seed_list(None, seeds)
    out.mkdir(parents=True, exist_ok=True)
    results = Results(out / "exploration.jsonl")
    open_ = [job for job in jobs_of(chosen, sea_floors, chosen_seeds, steps) if job.key not in results.runs]
    open_ = [] if no_run else open_
    with progress_bar() as bar:
        task = bar.add_task("tables", total=len(open_))
        for run in flown(open_, jobs, lambda job, step: bar.update(task, description=job.title), scheduler):
            results.add(run)
            bar.advance(task)

    command = f"bathyfleet evaluate tables --seeds {seeds} --steps {steps} --jobs {jobs}"
    command += "".join([" --terrains FOLDER" if terrains else "", f" --only {only}" if only else ""])
    report = Report(
        results.runs,
        chosen,
        [terrain.name for terrain in sea_floors],
        missing,
        chosen_seeds,
        steps,
        made(command + (" --quick" if quick else ""), jobs),
        {},
    )
    pictures = {name: f"images/{file}" for name, file in draw(report, out / "images").items()}
    (out / "exploration.md").write_text(markdown(replace(report, pictures=pictures)) + "\n", encoding="utf-8")
    typer.echo(f"{out / 'exploration.md'}: {len(open_)} runs made, {len(results.runs)} kept")


def _landmark_count(text: str) -> int | None:
    if text == EVERY_CELL:
        return None
    if not text.isdecimal() or int(text) < 1:
        raise typer.BadParameter(
            f"{text!r} is neither a number of at least 1 nor {EVERY_CELL!r}", param_hint="--landmarks"
        )
    return int(text)


def _changes(text: str | None, option: str) -> tuple[tuple[int, int], ...]:
    try:
        return parse_changes(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=option) from None
