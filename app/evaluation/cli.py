"""``bathyfleet evaluate``: planners against each other, without a network."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer
from pydantic import ValidationError
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from app.estimation import Sensor
from app.evaluation.explore.run import EXPLORERS, OSARSES, run_explore
from app.evaluation.explore.team_changes import TeamChanges, parse_changes
from app.evaluation.explore.world import COM_RANGE, ExploreScenario
from app.evaluation.runs.cluster import ClusterError
from app.evaluation.runs.jobs import Job, run_jobs
from app.evaluation.runs.jobs import Progress as StepProgress
from app.evaluation.runs.summary import summarise
from app.evaluation.survey.job import SurveyJob
from app.evaluation.survey.recorded import recorded_soundings
from app.evaluation.survey.symmetry import SYMMETRIES, turned, turned_soundings
from app.evaluation.survey.world import Sampling, Sounder, SurveyScenario
from app.exploration.communication.messages import MAX_ENTRIES
from app.exploration.core.objective import TERMS
from app.exploration.pcao.model import PcaoModel
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS
from simulator.terrain import Terrain, TerrainError
from simulator.terrain_files import load_terrain

evaluate_app = typer.Typer(help="Compare planners in closed loop, without a network.", no_args_is_help=True)

TerrainFile = Annotated[Path, typer.Option("--terrain", help="Sea floor: .npz, .asc, GeoTIFF, .xyz or .csv.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.")]
Seeds = Annotated[str | None, typer.Option(help="Several runs: FIRST:END (END excluded), or a list 1,5,9.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, nothing else, to standard output.")]
Regressors = Annotated[str, typer.Option(help="What CAO's estimator is linear in: map or polynomial.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes; with several seeds or planners, runs at a time.")]

Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster instead: tcp://HOST:PORT.")
]
ModelFile = Annotated[
    Path | None, typer.Option(help="What pcao flies with, a file of bathyfleet train [default: the one that ships]")
]

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
    seed: Seed = 0,
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
    changes = TeamChanges(_changes(lose, "--lose"), _changes(join, "--join"))
    runs = []
    trained = model_of(model)
    for name in names:
        options = _options(regressors, None if name == "osarses" else candidates, objective, contribution)
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
    seed: Seed = 0,
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
    how: Sampling = "step" if sampling == "step" else "continuous"
    if sounder not in ("single", "dvl", "swath"):
        raise typer.BadParameter(f"{sounder!r} is none of single, dvl, swath", param_hint="--sounder")
    beams: Sounder = "single" if sounder == "single" else "dvl" if sounder == "dvl" else "swath"
    turns = seed_list(0, symmetries, "--symmetries")
    if max(turns) >= SYMMETRIES:
        raise typer.BadParameter(f"{symmetries!r} goes beyond {SYMMETRIES - 1}, the last", param_hint="--symmetries")
    sea_floor = terrain_of(terrain)
    recorded = recorded_soundings(terrain)
    options = _options(regressors, candidates).model_copy(update={"model": model_of(model)})
    runs = [
        SurveyJob(
            SurveyScenario(
                turned(sea_floor, turn), vehicles, steps, max_step, how, seed=which, sounder=beams, symmetry=turn
            ),
            name,
            options,
            None if recorded is None else turned_soundings(recorded, sea_floor, turn),
        )
        for name in names
        for which in seed_list(seed, seeds)
        for turn in turns
    ]
    columns = ("planner", "seed", "symmetry", "rmse_m", "ratio", "gap_closed", "samples", "distance_m", "plan_ms_p99")
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
    chosen_seeds = seed_list(0, seeds)
    out.mkdir(parents=True, exist_ok=True)
    results = Results(out / "exploration.jsonl")
    open_ = [job for job in jobs_of(chosen, sea_floors, chosen_seeds, steps) if job.key not in results.runs]
    open_ = [] if no_run else open_
    with progress_bar() as bar:
        task = bar.add_task("tables", total=len(open_))
        for run in run_jobs(open_, jobs, lambda job, step: bar.update(task, description=job.title), scheduler):
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
    table = Table(*columns)
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
            raise typer.BadParameter(f"there is no {name!r}; choose from {', '.join(known)}", param_hint="--planner")
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


def _options(
    regressors: str, candidates: int | None, objective: str = "full", contribution: str = "vehicle"
) -> PlannerOptions:
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
