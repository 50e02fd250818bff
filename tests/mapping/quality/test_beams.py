"""Beams of crosslines beside the grid of the main lines, by their angle."""

import numpy as np
import pytest

from app.mapping.quality.beams import BeamCheck
from app.mapping.s44 import Order
from app.mapping.types import Grid

GRID = Grid(0.0, 0.0, 2.0, 20, 30)


def plane(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
    return np.asarray(10.0 + 0.1 * east_m - 0.05 * north_m)


def depths() -> np.ndarray:
    return plane(*np.meshgrid(GRID.east_m, GRID.north_m))


def test_a_slope_makes_no_difference_and_a_tilted_swath_shows_by_its_angle() -> None:
    rng = np.random.default_rng(4)
    east, north = rng.uniform(2, 58, 5000), rng.uniform(2, 38, 5000)
    angle = rng.uniform(-1.0, 1.0, 5000)
    off = 0.2 * np.tan(angle)
    check = BeamCheck(GRID, depths())
    for part in np.array_split(np.arange(5000), 7):
        check.add(east[part], north[part], plane(east, north)[part] + off[part], angle[part])
    for one in check.by_angle(Order.ORDER_1A):
        inside = (np.degrees(angle) >= one.from_deg) & (np.degrees(angle) < one.to_deg)
        assert one.count == inside.sum()
        assert one.mean_m == pytest.approx(off[inside].mean(), abs=1e-6)
        assert one.sd_m == pytest.approx(off[inside].std(ddof=1), abs=1e-6)
        assert one.to_deg - one.from_deg == 5.0
    overall = check.overall(Order.ORDER_1A)
    assert overall is not None
    assert (overall.count, overall.mean_m) == (5000, pytest.approx(off.mean(), abs=1e-6))
    assert overall.within_pct == 100.0
    strict = check.overall(Order.EXCLUSIVE)
    assert strict is not None
    assert 50.0 < strict.within_pct < 100.0


def test_only_what_lies_on_main_lines_is_compared() -> None:
    known = depths()
    known[:, 10:] = np.nan
    check = BeamCheck(GRID, known)
    check.add(np.array([5.0, 19.5, 30.0, -5.0, 500.0]), np.full(5, 11.0), np.full(5, 12.0), np.zeros(5))
    overall = check.overall(Order.ORDER_2)
    assert overall is not None
    assert overall.count == 2, "one between known cells, one in a known cell at their edge"


def test_without_beams_nothing_is_said() -> None:
    check = BeamCheck(GRID, np.full((20, 30), np.nan))
    check.add(np.array([5.0]), np.array([5.0]), np.array([9.0]), np.array([0.0]))
    assert check.overall(Order.ORDER_1A) is None
    assert check.by_angle(Order.ORDER_1A) == []
