"""Outlines of marked cells, and back."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from app.mapping.coordinates.outlines import outlines, touched


@given(arrays(np.bool_, st.tuples(st.integers(1, 7), st.integers(1, 7))), st.sampled_from([0.5, 1.0, 3.0]))
@settings(max_examples=60, deadline=None)
def test_outlines_enclose_the_marked_cells_and_nothing_else(marked: NDArray[np.bool_], cell_m: float) -> None:
    found = outlines(marked, 0.0, 0.0, cell_m)
    assert all(shape.is_valid for shape in found)
    assert np.isclose(sum(shape.area for shape in found), marked.sum() * cell_m**2)
    rows, cols = marked.shape
    east, north = np.meshgrid((np.arange(cols) + 0.5) * cell_m, (np.arange(rows) + 0.5) * cell_m)
    inside = shapely.contains_xy(shapely.union_all(found), east, north)
    np.testing.assert_array_equal(inside, marked)
    shrunk = [shape.buffer(-0.01 * cell_m) for shape in found]
    np.testing.assert_array_equal(touched(shrunk, rows, cols, cell_m), marked)


def test_a_shape_touches_the_cells_that_it_only_enters_and_none_beyond_the_grid() -> None:
    shape = shapely.box(-5.0, 1.9, 1.1, 2.1)
    expected = np.zeros((4, 3), dtype=bool)
    expected[1:3, :2] = True
    np.testing.assert_array_equal(touched([shape, shapely.Polygon()], 4, 3, 1.0), expected)


@pytest.mark.parametrize(("east", "north"), [(-40.0, 2.0), (40.0, 2.0), (2.0, -40.0), (2.0, 40.0), (40.0, -40.0)])
def test_a_shape_beyond_the_grid_touches_no_cell(east: float, north: float) -> None:
    assert not touched([shapely.box(east, north, east + 9.0, north + 9.0)], 4, 3, 1.0).any()
