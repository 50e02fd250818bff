"""The compiled median is numpy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.mapping.gross_errors.median import median


@settings(deadline=None)  # the first call compiles
@given(values=arrays(float, st.integers(1, 60), elements=st.floats(-1e6, 1e6)))
def test_it_is_numpys(values: np.ndarray) -> None:
    before = values.copy()
    assert median(values) == pytest.approx(np.median(values), rel=1e-12, abs=1e-9)
    np.testing.assert_array_equal(values, before)


@settings(deadline=None)  # the first call compiles
@given(values=st.lists(st.sampled_from([0.0, 1.0, 2.0]), min_size=1, max_size=40))
def test_many_equal_values_end_too(values: list[float]) -> None:
    assert median(np.array(values)) == np.median(values)


def test_long_runs_are_sorted_or_not() -> None:
    for values in (np.arange(1000.0), np.arange(1001.0)[::-1].copy(), np.zeros(1000)):
        assert median(values) == np.median(values)
