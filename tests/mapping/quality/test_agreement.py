"""Differences are summed up as they are defined, beside what S-44 allows."""

import numpy as np
import pytest

from app.mapping.quality.agreement import agreement, histogram, outlying
from app.mapping.s44 import Order


def test_differences_are_summed_up() -> None:
    off = np.array([-0.1, 0.0, 0.2, 0.9])
    depth = np.full(4, 10.0)
    found = agreement(off, depth, Order.ORDER_1A)
    assert found is not None
    assert (found.count, found.max_m) == (4, 0.9)
    assert (found.mean_m, found.median_m) == pytest.approx((0.25, 0.1))
    assert found.sd_m == pytest.approx(np.std(off, ddof=1))
    assert found.rms_m == pytest.approx(np.sqrt((0.01 + 0.04 + 0.81) / 4))
    assert found.within_pct == 75.0, "0.52 m are allowed in 10 m"
    deeper = agreement(off, np.full(4, 70.0), Order.ORDER_1A)
    assert deeper is not None
    assert deeper.within_pct == 100.0, "1.04 m are allowed in 70 m"


def test_nothing_and_a_single_difference() -> None:
    assert agreement(np.zeros(0), np.zeros(0), Order.SPECIAL) is None
    single = agreement(np.array([0.3]), np.array([10.0]), Order.SPECIAL)
    assert single is not None
    assert single.sd_m is None
    assert not outlying(np.zeros(0), np.zeros(0), Order.SPECIAL).any()
    assert sum(histogram(np.zeros(0)).counts) == 0


def test_outliers_are_beyond_the_order_or_far_from_the_others() -> None:
    off = np.concatenate([np.random.default_rng(1).normal(0.0, 0.05, 200), [0.3, 0.8]])
    depth = np.full(202, 10.0)
    assert outlying(off, depth, Order.ORDER_1A)[-2:].all()
    assert outlying(off, depth, Order.ORDER_1A)[:-2].mean() < 0.02
    biased = np.full(50, 0.7)
    assert outlying(biased, np.full(50, 10.0), Order.ORDER_1A).all(), "all alike, and all too large"
    assert not outlying(np.full(50, 0.1), np.full(50, 10.0), Order.ORDER_1A).any()


def test_a_histogram_holds_all_with_zero_in_its_middle() -> None:
    off = np.random.default_rng(2).normal(0.02, 0.1, 1000)
    found = histogram(off)
    assert sum(found.counts) == 1000
    assert len(found.edges_m) == len(found.counts) + 1
    assert found.edges_m[0] == -found.edges_m[-1]
    middle = len(found.counts) // 2
    assert found.edges_m[middle] < 0.0 < found.edges_m[middle + 1]
