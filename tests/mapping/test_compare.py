"""Differences between maps, by hand."""

import numpy as np
import pytest

from app.mapping.compare import difference, interval_coverage


def test_figures_of_a_known_difference() -> None:
    reference = np.zeros((2, 3))
    estimate = np.array([[1.0, -1.0, 2.0], [0.0, np.nan, 2.0]])
    result = difference(estimate, reference)
    assert result.cells == 5
    assert result.rmse_m == pytest.approx(np.sqrt(10 / 5))
    assert result.l2_norm == pytest.approx(np.sqrt(10))
    assert result.bias_m == pytest.approx(0.8)
    assert result.max_m == 2.0
    assert result.p95_m == pytest.approx(2.0)


def test_only_the_mask_counts() -> None:
    result = difference(np.array([[1.0, 5.0]]), np.zeros((1, 2)), np.array([[True, False]]))
    assert (result.cells, result.rmse_m) == (1, 1.0)


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match=r"\(2, 2\)"):
        difference(np.zeros((2, 2)), np.zeros((2, 3)))


def test_nothing_to_compare_is_an_error() -> None:
    with pytest.raises(ValueError, match="no cell"):
        difference(np.full((2, 2), np.nan), np.zeros((2, 2)))


def test_coverage_of_a_calibrated_estimate() -> None:
    rng = np.random.default_rng(0)
    sd = rng.uniform(0.1, 2.0, 40_000)
    truth = sd * rng.standard_normal(40_000)
    assert interval_coverage(np.zeros(40_000), sd, truth, 0.68) == pytest.approx(0.68, abs=0.01)
    assert interval_coverage(np.zeros(40_000), sd, truth, 0.95) == pytest.approx(0.95, abs=0.01)
