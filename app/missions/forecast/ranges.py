"""How figures that differ from floor to floor are told."""

from collections.abc import Sequence

import numpy as np

from app.missions.views.base import View

LOW, HIGH = 0.1, 0.9
LEAST_FLOORS = 9
"""Of fewer floors one in five missions lies beyond the lowest and the highest figure at least: nothing is wider."""


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
