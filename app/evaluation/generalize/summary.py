"""What the runs of a task say together: means with intervals, paired differences, the worst floors."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.evaluation.generalize.tasks import Task
from app.evaluation.runs.summary import spread

WORST = 5

Run = Mapping[str, Any]


def figure_of(task: Task, run: Run) -> float:
    """Return the figure that the table tells of a run: the ratio to a yardstick that was flown, or what is left."""
    return float(run["ours"] / run["yardstick"]) if task.relative else float(run["ours"])


def worst_of(task: Task, runs: Sequence[Run]) -> list[Run]:
    """Return the worst runs, the worst first."""
    return sorted(runs, key=lambda run: -figure_of(task, run))[:WORST]


def summary_of(task: Task, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the object of the command's JSON for a task that has runs.

    ``mean`` and ``ci95`` (half the width of the interval) are of the ratio or of what is left; ``difference`` is that
    of our figure and the yardstick's, floor by floor; ``kept`` counts the floors within what is asked.
    """
    figures = [figure_of(task, run) for run in runs]
    whole = spread(figures)
    paired = spread([run["ours"] - run["yardstick"] for run in runs])
    families = dict.fromkeys(sorted(run["family"] for run in runs))
    return {
        "floors": len(runs),
        "mean": whole.mean,
        "ci95": whole.ci95,
        "least": whole.min,
        "greatest": whole.max,
        "kept": sum(bool(run["kept"]) for run in runs),
        "difference": {"mean": paired.mean, "ci95": paired.ci95},
        "families": {
            family: spread([figure_of(task, run) for run in runs if run["family"] == family]).mean
            for family in families
        },
        "worst": [
            {"floor": run["floor"], "figure": figure_of(task, run), "ours": run["ours"],
             "yardstick": run["yardstick"], **run["facts"]}
            for run in worst_of(task, runs)
        ],
    }  # fmt: skip
