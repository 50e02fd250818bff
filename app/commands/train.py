"""``bathyfleet train``: a PCAO controller, trained in simulation."""

import os
from pathlib import Path
from typing import Annotated

import typer

from app.commands.command import CommandError


def train(
    out: Annotated[Path, typer.Option(help="Model file to write (JSON). Beside it: FILE.training, the checkpoint.")],
    terrains: Annotated[
        list[str],
        typer.Option(
            help="Sea floors to train on: terrain files, folders of them, generated ones as FAMILY:SEED; separated by "
            "commas or blanks, or in several --terrains."
        ),
    ],
    more: Annotated[list[str] | None, typer.Argument(metavar="[TERRAINS]...", hidden=True)] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Controllers tried at least; cma tries 18 at a time.")] = 2000,
    method: Annotated[str, typer.Option(help="cma (CMA-ES), pcao (algorithm 1 of the paper) or random.")] = "cma",
    runs: Annotated[int, typer.Option(min=1, max=1000, help="Monte-Carlo runs per sea floor and controller.")] = 3,
    robots: Annotated[int, typer.Option(min=1, max=100)] = 3,
    landmarks: Annotated[int, typer.Option(min=10, max=100_000)] = 1100,
    steps: Annotated[int, typer.Option(min=1, max=100_000)] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Runs at a time.", show_default="all cores")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Train on a Dask cluster: tcp://HOST:PORT.")
    ] = None,
) -> None:
    """Train a PCAO controller that missions fly with. Killed, the same command goes on where it was."""
    from app import __version__
    from app.evaluation.pcao.simulation.task import TrainingTask
    from app.evaluation.pcao.simulation.world import SeaFloor
    from app.evaluation.pcao.terrains import sea_floors_of
    from app.evaluation.pcao.training.curves import draw_curve
    from app.evaluation.pcao.training.optimisers import METHODS, Optimiser
    from app.evaluation.pcao.training.scoring import DaskScorer, LocalScorer, Scorer
    from app.evaluation.pcao.training.training import Checkpoint, CheckpointError, Curve, make_optimiser, write_model
    from app.evaluation.pcao.training.training import train as run_training
    from app.evaluation.runs.cluster import ClusterError, RunCluster
    from app.evaluation.runs.command import progress_bar
    from app.exploration.pcao.model import Training
    from simulator.floors.terrain import TerrainError

    if method not in METHODS:
        raise typer.BadParameter(f"{method!r} is none of {', '.join(METHODS)}", param_hint="--method")
    try:
        sea_floors = sea_floors_of([*terrains, *(more or [])])
    except (TerrainError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="--terrains") from None
    task = TrainingTask(tuple(SeaFloor(t) for t in sea_floors), tuple(range(runs)), robots, landmarks, steps)
    names = [terrain.name for terrain in sea_floors]
    settings = {
        "method": method, "seed": seed, "terrains": names, "runs": runs, "robots": robots, "landmarks": landmarks,
        "steps": steps,
    }  # fmt: skip
    said = [part.strip() for several in [*terrains, *(more or [])] for part in several.split(",")]
    shown = ",".join(Path(part).name if Path(part).exists() else part for part in said)
    command = f"bathyfleet train --out FILE --terrains {shown}"
    command += f" --iterations {iterations} --method {method} --runs {runs} --seed {seed}"
    command += f" --robots {robots} --landmarks {landmarks} --steps {steps}"
    curve_file = out.with_suffix(".png")

    def keep(optimiser: Optimiser, curve: Curve) -> None:
        training = Training(
            command=command, bathyfleet=__version__, method=method, seed=seed, terrains=tuple(names),
            seeds=task.seeds, robots=robots, landmarks=landmarks, steps=steps, evaluations=len(curve.scores),
            score=optimiser.best_score,
        )  # fmt: skip
        write_model(out, optimiser, training)

    cluster = None
    try:
        checkpoint = Checkpoint(out.with_name(out.name + ".training"), settings)
        optimiser = make_optimiser(method, seed)
        scorer: Scorer = LocalScorer(task, jobs or os.cpu_count() or 1)
        if scheduler is not None:
            cluster = RunCluster(scheduler)
            scorer = DaskScorer(task, cluster)
        with progress_bar() as bar:
            task_id = bar.add_task("train", total=iterations)

            def progress(curve: Curve) -> None:
                best = f"train: E(P) {curve.best[-1]:.4g}" if curve.scores else "train"
                bar.update(task_id, description=best, completed=min(len(curve.scores), iterations))

            curve = run_training(optimiser, scorer, checkpoint, iterations, progress, keep)
    except (CheckpointError, ClusterError) as error:
        raise CommandError(str(error)) from None
    except ImportError as error:
        raise CommandError(f"--method cma needs the package cma: {error}", "pip install cma") from None
    finally:
        if cluster is not None:
            cluster.close()
    keep(optimiser, curve)
    draw_curve(curve_file, {method: curve.scores})
    typer.echo(f"{out}: E(P) = {optimiser.best_score:.4g} after {len(curve.scores)} controllers; {curve_file}")
