"""What the runs of a task say together: means with intervals, paired differences, the worst floors."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.evaluation.generalize.tasks import TableTask
from app.evaluation.runs.summary import ROUNDING_PCT, spread

WORST = 5

DONE_PCT = 1.0
"""Explorations that leave no more have come to 99 %."""

Run = Mapping[str, Any]


def figure_of(task: TableTask, run: Run) -> float:
    """Return the figure that the table tells of a run: the ratio to a yardstick that was flown, or what is left."""
    return float(run["ours"] / run["yardstick"]) if task.relative else float(run["ours"])


def worst_of(task: TableTask, runs: Sequence[Run]) -> list[Run]:
    """Return the worst runs, the worst first."""
    return sorted(runs, key=lambda run: -figure_of(task, run))[:WORST]


def with_yardstick_done(runs: Sequence[Run]) -> list[Run]:
    """Return the runs in which the yardstick got there, too: where it does not its figure is how long it had."""
    return [run for run in runs if run["facts"].get("left_by_yardstick_pct", 0.0) <= DONE_PCT + ROUNDING_PCT]


def summary_of(task: TableTask, runs: Sequence[Run]) -> dict[str, Any]:
    """Return the object of the command's JSON for a task that has runs.

    ``mean`` and ``ci95`` (half the width of the interval) are of the ratio or of what is left; ``difference`` is that
    of our figure and the yardstick's, floor by floor; ``kept`` counts the floors within what is asked;
    ``yardstick_done`` is of the floors on which the yardstick got there, None where that are all or none.
    """
    figures = [figure_of(task, run) for run in runs]
    whole = spread(figures)
    paired = spread([run["ours"] - run["yardstick"] for run in runs])
    families = dict.fromkeys(sorted(run["family"] for run in runs))
    done = with_yardstick_done(runs)
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
        "yardstick_done": _means(task, done) if 0 < len(done) < len(runs) else None,
        "worst": [
            {"floor": run["floor"], "figure": figure_of(task, run), "ours": run["ours"],
             "yardstick": run["yardstick"], **run["facts"]}
            for run in worst_of(task, runs)
        ],
    }  # fmt: skip


def _means(task: TableTask, runs: Sequence[Run]) -> dict[str, Any]:
    whole, paired = spread([figure_of(task, run) for run in runs]), spread([r["ours"] - r["yardstick"] for r in runs])
    return {
        "floors": len(runs),
        "mean": whole.mean,
        "ci95": whole.ci95,
        "difference": {"mean": paired.mean, "ci95": paired.ci95},
    }
