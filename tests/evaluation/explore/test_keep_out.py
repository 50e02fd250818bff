from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import box
from shapely.geometry import Polygon
from shapely.ops import unary_union

from app.evaluation.explore.keep_out import PASSAGE, draw_keep_out

START = np.array([[-0.9, -0.9], [-0.7, -0.7]])


@given(seed=st.integers(0, 10_000), fraction=st.floats(0.01, 0.2))
@settings(max_examples=60, deadline=None)
def test_zones_cover_the_fraction_and_leave_passages_everywhere(seed: int, fraction: Any) -> None:
    half = np.ones(2)
    zones = [Polygon(z) for z in draw_keep_out(half, fraction, START, np.random.default_rng(seed))]
    area, start = box(-1, -1, 1, 1), box(*START.ravel())
    covered = unary_union(zones)
    assert 3 <= len(zones) <= 4
    assert covered.area == pytest.approx(fraction * area.area)
    assert area.buffer(1e-9).contains(covered)
    assert covered.distance(start) >= PASSAGE - 1e-9
    assert all(a.distance(b) >= PASSAGE - 1e-9 for k, a in enumerate(zones) for b in zones[:k])
    # A disc as wide as the passages can be moved from anywhere to anywhere.
    free = area.difference(covered.buffer(PASSAGE / 2 - 1e-6)).buffer(-1e-6)
    assert free.geom_type == "Polygon"


def test_the_same_seed_draws_the_same_zones_and_another_one_others() -> None:
    first, again, other = (draw_keep_out(np.ones(2), 0.15, START, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first[0], other[0])


def test_a_narrow_area_keeps_passages_too_or_is_refused_in_words() -> None:
    start = np.array([[-0.9, -0.69], [-0.7, -0.49]])
    zones = draw_keep_out(np.array([1.0, 0.74]), 0.1, start, np.random.default_rng(0))
    assert sum(Polygon(z).area for z in zones) == pytest.approx(0.1 * 4 * 0.74)
    with pytest.raises(ValueError, match="choose a smaller fraction"):
        draw_keep_out(np.array([1.0, 0.2]), 0.3, np.array([[-0.9, -0.2], [-0.7, 0.0]]), np.random.default_rng(0))


def test_no_fraction_no_zones() -> None:
    assert draw_keep_out(np.ones(2), 0.0, START, np.random.default_rng(0)) == ()
