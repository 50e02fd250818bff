"""Slope, TVU and the flag of sounded cells."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.layers import slope_deg
from app.mapping.s44 import COEFFICIENTS, Order, conformity, max_tvu_m, tvu_fraction


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.1, 50))
def test_the_slope_of_a_plane_is_its_inclination_up_to_the_edges(a: float, b: float, cell: float) -> None:
    row, col = np.mgrid[0:5, 0:6]
    plane = 10.0 + cell * (a * col + b * row)
    np.testing.assert_allclose(slope_deg(plane, cell), math.degrees(math.atan(math.hypot(a, b))), atol=1e-5)


def test_the_slope_beside_a_hole_comes_from_the_other_side() -> None:
    row, col = np.mgrid[0:5, 0:5]
    plane = 1.0 * col + 2.0 * row
    plane[2, 2] = np.nan
    slope = slope_deg(plane, 1.0)
    assert np.isnan(slope[2, 2])
    known = np.isfinite(plane)
    np.testing.assert_allclose(slope[known], math.degrees(math.atan(math.hypot(1, 2))))


def test_a_cell_without_neighbours_has_no_slope() -> None:
    lonely = np.full((3, 3), np.nan)
    lonely[1, 1] = 5.0
    assert np.isnan(slope_deg(lonely, 1.0)).all()


@pytest.mark.parametrize(
    ("order", "depth_m", "allowed_m"),
    [
        (Order.EXCLUSIVE, 0.0, 0.15),
        (Order.SPECIAL, 40.0, math.sqrt(0.25**2 + 0.3**2)),
        (Order.ORDER_1A, 100.0, math.sqrt(0.5**2 + 1.3**2)),
        (Order.ORDER_2, 100.0, math.sqrt(1.0 + 2.3**2)),
    ],
)
def test_the_largest_tvu_is_that_of_s44(order: Order, depth_m: float, allowed_m: float) -> None:
    assert max_tvu_m(np.array([depth_m]), order)[0] == pytest.approx(allowed_m)


def test_orders_become_laxer() -> None:
    depth = np.linspace(0, 200, 9)
    for strict, lax in zip(list(COEFFICIENTS)[:-1], list(COEFFICIENTS)[1:], strict=True):
        assert (max_tvu_m(depth, strict) <= max_tvu_m(depth, lax)).all()


def test_what_all_soundings_share_counts_in_the_tvu() -> None:
    depth, sd = np.array([0.0]), np.array([0.3])
    assert tvu_fraction(depth, sd, Order.ORDER_1A, common_sd_m=0.4)[0] == pytest.approx(1.95996 * 0.5 / 0.5, rel=1e-4)


def test_the_statement_never_rounds_up_and_claims_no_order() -> None:
    depth = np.full((40, 50), 10.0)
    sd = np.full_like(depth, 0.1)
    sd[0, 0] = 5.0
    sounded = np.zeros(depth.shape, bool)
    found = conformity(depth, sd, sounded, Order.ORDER_1A)
    assert found.cells_pct == pytest.approx(99.95)
    assert found.sounded_pct is None
    assert found.statement == "TVU estimate meets Order 1a in 99.9 % of cells"
    sounded[0, :2] = True
    assert conformity(depth, sd, sounded, Order.ORDER_1A).sounded_pct == 50.0


def test_a_map_without_depth_meets_nothing() -> None:
    nothing = np.full((2, 2), np.nan)
    with pytest.raises(ValueError, match="no cell"):
        conformity(nothing, nothing, np.zeros((2, 2), bool), Order.ORDER_2)
