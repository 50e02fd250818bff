"""How figures that differ from floor to floor are told."""

from collections.abc import Sequence

import numpy as np

from app.missions.views.base import View

LOW, HIGH = 0.1, 0.9

WAY_SD = 0.035
"""Standard deviation, as a share, of how much longer or shorter ways come out than they are flown ahead: vehicles wait
for others, turn wider and drift."""

DEVIATION_SD = 0.15
"""The same of a map's mean deviation: fewer soundings are flown ahead than at sea, over larger cells."""

COVERAGE_SD_PCT = 0.2
"""Standard deviation, in percentage points, of how much more or less of an area is covered than is flown ahead: a
forecast's cells are larger than a mission's."""

DRAWS = (0.0, 0.67, -0.67, -1.38, 0.21, -0.21, 1.38, 0.43, -0.43, 0.97, -0.97)
"""Eleven evenly likely draws of a normal figure, in an order that follows no other."""


class ForecastRange(View):
    """From where to where a figure went, over floors of different roughness: 10 % were below, 10 % above."""

    low: float
    high: float


def range_of(values: Sequence[float]) -> ForecastRange:
    """Return from where to where figures of several floors go.

    One more figure of the same kind lies below, and above, in a tenth of all cases: of n figures the k-th one is in
    the mean exceeded by all but k / (n + 1) of others like it (Weibull's plotting position).
    """
    low, high = (float(x) for x in np.quantile(values, [LOW, HIGH], method="weibull"))
    return ForecastRange(low=low, high=high)


def with_unforeseen(values: Sequence[float], sd: float) -> list[float]:
    """Return figures of flights ahead with what they do not know of; ``sd`` is the deviation of that as a share."""
    return [value * (1.0 + sd * DRAWS[k % len(DRAWS)]) for k, value in enumerate(values)]


def coverages_with_unforeseen(values_pct: Sequence[float]) -> list[float]:
    """Return coverages of flights ahead, percent, with what they do not know of; one of nothing stays nothing."""
    drawn = [value + COVERAGE_SD_PCT * DRAWS[k % len(DRAWS)] for k, value in enumerate(values_pct)]
    return [
        min(max(after, 0.0), 100.0) if before > 0.0 else 0.0 for before, after in zip(values_pct, drawn, strict=True)
    ]
