"""Means and their spread over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

ROUNDING_PCT = 1e-9
"""Shares in percent are told apart by no less: 11 of 1100 are 1 %, whatever floating-point numbers make of it."""


@dataclass(frozen=True)
class Spread:
    """Mean, half width of its 95 % confidence interval, least and greatest value."""

    mean: float
    ci95: float
    min: float
    max: float


def spread(values: Sequence[float]) -> Spread:
    """Return the spread of at least one value; a single one has no interval (0)."""
    x = np.asarray(values, dtype=np.float64)
    half = 0.0
    if len(x) > 1:
        half = float(student.ppf(0.975, len(x) - 1) * x.std(ddof=1) / np.sqrt(len(x)))
    return Spread(float(x.mean()), half, float(x.min()), float(x.max()))


def mean_text(values: Sequence[float], digits: int) -> str:
    """Return the mean and the half width of its interval as a table shows them; a dash without values."""
    if not values:
        return "–"
    s = spread(values)
    return f"{s.mean:.{digits}f}" + (f" ± {s.ci95:.{digits}f}" if len(values) > 1 else "")


def first_step(history_pct: Sequence[float], most_pct: float = 1.0) -> int | None:
    """Return the step, counted from 1, after which no more than ``most_pct`` is left; None where that never happens."""
    reached = np.flatnonzero(np.asarray(history_pct, dtype=np.float64) <= most_pct + ROUNDING_PCT)
    return int(reached[0]) + 1 if len(reached) else None


def summarise(runs: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, dict[str, float]]]:
    """Return planner -> metric -> spread, for every metric that is a number in at least one run of the planner.

    Runs that have no planner are all together, as ``all``.
    """
    result: dict[str, dict[str, dict[str, float]]] = {}
    for planner in dict.fromkeys(_group(run) for run in runs):
        mine = [run for run in runs if _group(run) == planner]
        metrics: dict[str, dict[str, float]] = {}
        for key in mine[0]:
            numbers = [run[key] for run in mine if _is_number(run[key])]
            if numbers and key != "seed":
                metrics[key] = asdict(spread(numbers))
        result[planner] = metrics
    return result


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _group(run: Mapping[str, Any]) -> str:
    return str(run.get("planner", "all"))
