"""Differences of depths that should be the same, summed up beside what IHO S-44 allows.

A difference is compared with an order's largest TVU itself. That is stricter than for two independent depths, of which
each may be off by that much: their difference could then be larger by the square root of two.
"""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.mapping.s44 import Order, max_tvu_m

OUTLYING_SD, LEAST_SD_M = 3.0, 0.01
"""A difference is an outlier so many robust standard deviations from the median; these are at least so many metres."""

SD_OF_MAD = 1.4826
"""Standard deviation of a normal distribution whose median absolute deviation is one."""

BINS = 41
"""Of a histogram: odd, so that zero is in the middle of one."""


@dataclass(frozen=True)
class Agreement:
    """What n differences say, in metres.

    Attributes
    ----------
    sd_m
        Standard deviation of a sample; None for a single difference.
    p95_m, max_m
        95 % quantile and largest of the absolute differences.
    within_pct
        Share that is not larger than the order's largest TVU.
    """

    count: int
    mean_m: float
    median_m: float
    sd_m: float | None
    rms_m: float
    p95_m: float
    max_m: float
    within_pct: float


@dataclass(frozen=True)
class Histogram:
    """Counts (b,) of differences between edges (b + 1,) in metres; those beyond the ends are in the outer bins."""

    edges_m: FloatArray
    counts: tuple[int, ...]


def within(difference_m: FloatArray, depth_m: FloatArray, order: Order) -> BoolArray:
    """Return which differences (n,) at these depths (n,) an order's largest TVU allows."""
    return np.asarray(np.abs(difference_m) <= max_tvu_m(depth_m, order))


def agreement(difference_m: FloatArray, depth_m: FloatArray, order: Order) -> Agreement | None:
    """Sum differences (n,) at depths (n,) up; None without any."""
    count = len(difference_m)
    if not count:
        return None
    size = np.abs(difference_m)
    return Agreement(
        count=count,
        mean_m=float(difference_m.mean()),
        median_m=float(np.median(difference_m)),
        sd_m=float(difference_m.std(ddof=1)) if count > 1 else None,
        rms_m=float(np.sqrt(np.mean(difference_m**2))),
        p95_m=float(np.quantile(size, 0.95)),
        max_m=float(size.max()),
        within_pct=100.0 * float(within(difference_m, depth_m, order).mean()),
    )


def outlying(difference_m: FloatArray, depth_m: FloatArray, order: Order) -> BoolArray:
    """Return which differences (n,) are larger than an order allows, or far from all others."""
    if not len(difference_m):
        return np.zeros(0, dtype=bool)
    off = np.abs(difference_m - np.median(difference_m))
    sd_m = max(SD_OF_MAD * float(np.median(off)), LEAST_SD_M)
    return np.asarray(~within(difference_m, depth_m, order) | (off > OUTLYING_SD * sd_m))


def histogram(difference_m: FloatArray) -> Histogram:
    """Count differences (n,) in bins of equal width about zero that hold 99 % of them, the rest in the outer ones."""
    reach = float(np.quantile(np.abs(difference_m), 0.99)) if len(difference_m) else 0.0
    half = max(reach, LEAST_SD_M)
    edges = np.linspace(-half, half, BINS + 1)
    counts, _ = np.histogram(np.clip(difference_m, -half, half), edges)
    return Histogram(edges, tuple(counts.tolist()))
