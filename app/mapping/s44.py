"""Vertical uncertainty beside what IHO S-44 (edition 6.1, table 1) allows.

An order of survey asks for more than vertical uncertainty: horizontal uncertainty, feature search and bathymetric
coverage, which a map of soundings alone cannot show. So nothing here claims an order; it says in how many cells the
estimated total vertical uncertainty (TVU) stays within an order's maximum.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.arrays import BoolArray, FloatArray

NORMAL_95 = 1.959963984540054
"""Half width of the central 95 % of a normal distribution, in standard deviations."""


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
    return NORMAL_95 * np.hypot(sd_m, common_sd_m) / max_tvu_m(depth_m, order)


@dataclass(frozen=True)
class Conformity:
    """In how many cells the TVU estimate stays within an order's maximum.

    Attributes
    ----------
    cells_pct, sounded_pct
        Share of all cells with a depth, and of the sounded ones among them (None without any).
    statement
        The one sentence that may be said about it.
    """

    order: Order
    cells_pct: float
    sounded_pct: float | None
    statement: str


def conformity(
    depth_m: FloatArray, sd_m: FloatArray, sounded: BoolArray, order: Order, *, common_sd_m: float = 0.0
) -> Conformity:
    """Count the cells whose TVU estimate an order allows. Raises ValueError when no cell has a depth."""
    fraction = tvu_fraction(depth_m, sd_m, order, common_sd_m=common_sd_m)
    known = np.isfinite(fraction)
    if not known.any():
        raise ValueError("no cell has a depth and a standard deviation")
    within = fraction <= 1.0
    share = 100.0 * float(np.mean(within[known]))
    among = known & sounded
    return Conformity(
        order,
        share,
        100.0 * float(np.mean(within[among])) if among.any() else None,
        f"TVU estimate meets {order.spoken} in {_floored(share)} % of cells",
    )


def _floored(percent: float) -> str:
    # Rounded down: 99.96 % of the cells is not all of them.
    return f"{np.floor(percent * 10.0) / 10.0:.1f}"
