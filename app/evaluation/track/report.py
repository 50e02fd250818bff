"""The tracking report in Markdown: one table per experiment, means with 95 % intervals, published figures beside."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from app.evaluation.runs.summary import mean_text
from app.evaluation.track.consistency import Consistency
from app.evaluation.track.setups import HISTORY_EVERY, Experiment, TrackReportJob

Run = Mapping[str, Any]

CRITERIA = {
    "sum_of_error": "(sum of) ERROR",
    "sum_of_cost": "(sum of) cost",
    "final_cost": "final cost",
    "remaining": "remaining items",
}
"""MED13's four criteria."""

COLUMNS = (
    ("remaining_pct", "remaining, %", 2),
    ("target_tracked_pct", "targets in A after t = 100, %", 1),
    ("target_error", "target error", 3),
    ("localization_ok_pct", "localization good, %", 1),
    ("resurfacings", "risings", 1),
    ("needless_resurfacings", "of them needless", 2),
    ("wrongly_accurate_pct", "wrongly in A, %", 2),
    ("accurate_nees", "NEES of A (3)", 1),
    ("broken_constraints", "limits broken", 1),
)
PUBLISHED = {
    "med13-7542": "Published (one run): 3.09 % remaining at t = 500, 32.2 % (2432 of 7542) at t = 96; better than "
    "random in all four criteria in each of 10 experiments.",
    "med13-1000": "Published: better than random in all four criteria in each of 10 experiments.",
    "ngcuv12": "Published: figures 3 to 5 without numbers (the error norm falls; a vehicle surfaces when localization "
    "is poor; vehicles go back to a target that is lost).",
    "figure1": "Published: the error norm falls until t = 79, then diverges.",
}


def markdown(
    jobs: Sequence[TrackReportJob],
    runs: Mapping[str, Run],
    chosen: Sequence[Experiment],
    facts: Mapping[str, str],
    filters: Sequence[Consistency],
    pictures: Mapping[str, str],
) -> str:
    """Return the whole report; what has not been run is left out and counted."""
    lines = ["# Tracking: moving targets and fading localization", ""]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lacking = sum(job.key not in runs for job in jobs)
    lines += [f"- **incomplete**: {lacking} of {len(jobs)} runs are still missing"] if lacking else []
    lines += [
        "",
        "Means ± half their 95 % interval (Student) over the seeds that each table names. What was chosen where the "
        "papers are silent stands in [tracking](../tracking.md).",
        "",
    ]
    for experiment in chosen:
        of = {p: _of(jobs, runs, experiment.name, p) for p in experiment.planners}
        lines += [f"## {experiment.title}", "", experiment.text, ""]
        if experiment.name in PUBLISHED:
            lines += [PUBLISHED[experiment.name], ""]
        if experiment.name in pictures:
            lines += [f"![{experiment.title}]({pictures[experiment.name]})", ""]
        lines += _table(of)
        lines += _criteria(of)
        lines += _errors(of)
    return "\n".join([*lines, *_consistency(filters)])


def _of(jobs: Sequence[TrackReportJob], runs: Mapping[str, Run], setup: str, planner: str) -> list[Run]:
    keys = [job.key for job in jobs if job.setup == setup and job.planner == planner]
    return [runs[key] for key in keys if key in runs]


def _table(of: Mapping[str, Sequence[Run]]) -> list[str]:
    there = [c for c in COLUMNS if any(run.get(c[0]) is not None for rows in of.values() for run in rows)]
    lines = ["| planner | seeds | " + " | ".join(title for _, title, _ in there) + " |"]
    lines.append("|" + " --- |" * (2 + len(there)))
    for planner, rows in of.items():
        cells = [
            mean_text([run[name] for run in rows if run.get(name) is not None], digits) for name, _, digits in there
        ]
        lines.append(f"| {planner} | {len(rows)} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _criteria(of: Mapping[str, Sequence[Run]]) -> list[str]:
    """Return how often each planner beat random in MED13's four criteria, seed by seed."""
    random = {run["seed"]: run for run in of.get("random", ())}
    ours = {planner: rows for planner, rows in of.items() if planner != "random" and rows}
    if not random or not ours:
        return []
    lines = ["Seeds in which a planner was better than random, and the mean of each criterion over random's:", ""]
    lines.append("| criterion | " + " | ".join(ours) + " |")
    lines.append("|" + " --- |" * (1 + len(ours)))
    for name, title in CRITERIA.items():
        cells = []
        for rows in ours.values():
            pairs = [(run[name], random[run["seed"]][name]) for run in rows if run["seed"] in random]
            better = sum(a < b for a, b in pairs)
            ratio = np.mean([a for a, _ in pairs]) / max(np.mean([b for _, b in pairs]), 1e-12) if pairs else np.nan
            cells.append(f"{better} of {len(pairs)}, {ratio:.2f}")
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _errors(of: Mapping[str, Sequence[Run]]) -> list[str]:
    """Return the norm of the landmarks' error over time."""
    rows_of = {planner: rows for planner, rows in of.items() if rows}
    if not rows_of:
        return []
    length = min(len(run["error"]) for rows in rows_of.values() for run in rows)
    at = sorted({0, *(round(part * (length - 1)) for part in (0.1, 0.2, 0.4, 0.6, 0.8, 1.0))})
    lines = ["| norm of the landmarks' error at t | " + " | ".join(str(HISTORY_EVERY * (k + 1)) for k in at) + " |"]
    lines.append("|" + " --- |" * (1 + len(at)))
    for planner, rows in rows_of.items():
        lines.append(f"| {planner} | " + " | ".join(mean_text([run["error"][k] for run in rows], 2) for k in at) + " |")
    return [*lines, ""]


def _consistency(filters: Sequence[Consistency]) -> list[str]:
    lines = [
        "## Consistency of the filters",
        "",
        "Mean normalised squared error at the end of a run, over independent runs; the interval holds it with 95 % "
        "probability when the filter is right.",
        "",
        "| filter | dimensions | runs | mean | interval | within |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {c.what} | {c.dimensions} | {c.runs} | {c.mean:.2f} | {c.low:.2f} to {c.high:.2f} | "
        f"{'yes' if c.within else '**no**'} |"
        for c in filters
    ]
    return lines
