"""Uncertainty beside what IHO S-44 (edition 6.1, table 1) allows.

An order of survey asks for more than small uncertainty: feature search and bathymetric coverage, which a map of
soundings alone cannot show. So nothing here claims an order; it says in how many cells the estimated total vertical and
horizontal uncertainties (TVU, THU) stay within an order's maxima.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.arrays import BoolArray, FloatArray

NORMAL_95 = 1.959963984540054
"""Half width of the central 95 % of a normal distribution, in standard deviations."""
ROUND_95 = 2.447746830680816
"""Radius of the circle that holds 95 % of places with the same deviation in both coordinates, in these."""


class Order(StrEnum):
    """An order of survey."""

    EXCLUSIVE = "exclusive"
    SPECIAL = "special"
    ORDER_1A = "1a"
    ORDER_1B = "1b"
    ORDER_2 = "2"

    @property
    def spoken(self) -> str:
        """Return its name as S-44 writes it."""
        return f"Order {self.value}" if self.value[0].isdigit() else f"{self.value.capitalize()} Order"


COEFFICIENTS = {
    Order.EXCLUSIVE: (0.15, 0.0075),
    Order.SPECIAL: (0.25, 0.0075),
    Order.ORDER_1A: (0.5, 0.013),
    Order.ORDER_1B: (0.5, 0.013),
    Order.ORDER_2: (1.0, 0.023),
}
"""Per order a (metres) and b of the largest allowed TVU, sqrt(a^2 + (b d)^2)."""


HORIZONTAL = {
    Order.EXCLUSIVE: (1.0, 0.0),
    Order.SPECIAL: (2.0, 0.0),
    Order.ORDER_1A: (5.0, 0.05),
    Order.ORDER_1B: (5.0, 0.05),
    Order.ORDER_2: (20.0, 0.1),
}
"""Per order metres and the part of the depth that the largest allowed THU is the sum of."""


def strictest_sd_m(order: Order) -> float:
    """Return the standard deviation that meets an order's largest TVU at every depth: that of none, to a millimetre."""
    return math.floor(1000 * COEFFICIENTS[order][0] / NORMAL_95) / 1000


def max_thu_m(depth_m: FloatArray, order: Order) -> FloatArray:
    """Return the largest THU that an order allows at each depth, 95 % confidence level, in the input's shape."""
    least, part = HORIZONTAL[order]
    return least + part * np.maximum(depth_m, 0.0)


def tvu_m(sd_m: FloatArray, common_sd_m: float = 0.0) -> FloatArray:
    """Return the estimated TVU of depths; ``common_sd_m`` is the deviation of what all soundings share."""
    return NORMAL_95 * np.hypot(sd_m, common_sd_m)


def thu_m(horizontal_sd_m: FloatArray) -> FloatArray:
    """Return the estimated THU of places with this deviation of each coordinate."""
    return ROUND_95 * horizontal_sd_m


def max_tvu_m(depth_m: FloatArray, order: Order) -> FloatArray:
    """Return the largest TVU that an order allows at each depth, 95 % confidence level, in the input's shape."""
    a, b = COEFFICIENTS[order]
    return np.hypot(a, b * depth_m)


def tvu_fraction(depth_m: FloatArray, sd_m: FloatArray, order: Order, *, common_sd_m: float = 0.0) -> FloatArray:
    """Return estimated TVU over allowed TVU per cell; at most 1 meets the order's maximum, NaN stays.

    Parameters
    ----------
    common_sd_m
        Standard deviation of what all soundings share, as an uncertain water level.
    """
    return tvu_m(sd_m, common_sd_m) / max_tvu_m(depth_m, order)


@dataclass(frozen=True)
class Conformity:
    """In how many cells the estimates stay within an order's maxima.

    Attributes
    ----------
    cells_pct, sounded_pct
        TVU: share of all cells with a depth, and of the sounded ones among them (None without any).
    horizontal_pct
        THU: share of the cells for which it is known; None where it is for none.
    statement
        The one sentence that may be said about it.
    """

    order: Order
    cells_pct: float
    sounded_pct: float | None
    horizontal_pct: float | None
    statement: str


def conformity(
    depth_m: FloatArray,
    sd_m: FloatArray,
    sounded: BoolArray,
    order: Order,
    *,
    common_sd_m: float = 0.0,
    horizontal_sd_m: FloatArray | None = None,
) -> Conformity:
    """Count the cells whose estimates an order allows. Raises ValueError when no cell has a depth."""
    fraction = tvu_fraction(depth_m, sd_m, order, common_sd_m=common_sd_m)
    known = np.isfinite(fraction)
    if not known.any():
        raise ValueError("no cell has a depth and a standard deviation")
    within = fraction <= 1.0
    share = 100.0 * float(np.mean(within[known]))
    among = known & sounded
    statement = f"TVU estimate meets {order.spoken} in {_floored(share)} % of cells"
    horizontal = None
    if horizontal_sd_m is not None:
        placed = known & np.isfinite(horizontal_sd_m)
        if placed.any():
            met = thu_m(horizontal_sd_m[placed]) <= max_thu_m(depth_m[placed], order)
            horizontal = 100.0 * float(met.mean())
            statement += f", THU estimate in {_floored(horizontal)} %"
    return Conformity(
        order,
        share,
        100.0 * float(np.mean(within[among])) if among.any() else None,
        horizontal,
        statement,
    )


def _floored(percent: float) -> str:
    # Rounded down: 99.96 % of the cells is not all of them.
    return f"{np.floor(percent * 10.0) / 10.0:.1f}"
