"""Points that are spread evenly over a rectangle, and stand in no rows."""

import numpy as np

from app.arrays import FloatArray

PLASTIC = 1.32471795724474602596
"""The real root of x^3 = x + 1: points at multiples of its inverse and that squared are evenly spread, and stand in no
rows that lines could lie along or between (Roberts, The unreasonable effectiveness of quasirandom sequences, 2018)."""


def spread_points(low: FloatArray, high: FloatArray, n: int) -> FloatArray:
    """Return ``n`` points (n, 2) in the rectangle from ``low`` (2,) to ``high`` (2,).

    The first ones of them are spread as evenly as all.
    """
    k = np.arange(1, n + 1)
    return np.asarray(low + (high - low) * np.column_stack([(0.5 + k / PLASTIC) % 1.0, (0.5 + k / PLASTIC**2) % 1.0]))
