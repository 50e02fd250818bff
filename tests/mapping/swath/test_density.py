"""Soundings in cells: the same as counting one by one, whatever comes in whatever pieces."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.swath.density import DensityGrid
from app.mapping.types import Grid

GRID = Grid(10.0, -5.0, 2.0, 4, 6)
MASK = np.ones((4, 6), dtype=bool)
SOUNDING = st.tuples(st.floats(5.0, 30.0), st.floats(-10.0, 10.0), st.floats(1.0, 50.0), st.floats(0.05, 2.0))


@given(st.lists(SOUNDING, max_size=60), st.integers(1, 20))
def test_cells_hold_what_counting_one_by_one_finds(soundings: list[tuple[float, ...]], piece: int) -> None:
    density = DensityGrid(GRID, MASK)
    inside: list[bool] = []
    for first in range(0, len(soundings), piece):
        part = np.array(soundings[first : first + piece])
        inside += density.add(*part.T).tolist()
    cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for (east, north, depth, sd), is_inside in zip(soundings, inside, strict=True):
        i, j = int(np.floor((north + 5.0) / 2.0)), int(np.floor((east - 10.0) / 2.0))
        assert is_inside == (0 <= i < 4 and 0 <= j < 6)
        if is_inside:
            cells.setdefault((i, j), []).append((depth, sd))
    for i in range(4):
        for j in range(6):
            found = cells.get((i, j), [])
            assert density.count[i, j] == len(found)
            if not found:
                assert np.isnan(density.depth_m[i, j])
                assert np.isnan(density.sd_m[i, j])
                continue
            depth, sd = np.array(found).T
            weight = 1.0 / sd**2
            mean = (weight * depth).sum() / weight.sum()
            assert np.isclose(density.depth_m[i, j], mean)
            assert np.isclose(density.sd_m[i, j], 1.0 / np.sqrt(weight.sum()))
            spread = np.sqrt((weight * (depth - mean) ** 2).sum() / weight.sum())
            assert np.isclose(density.spread_m[i, j], spread, atol=1e-4)


def test_shares_are_of_the_area_alone() -> None:
    mask = MASK.copy()
    mask[0] = False
    density = DensityGrid(GRID, mask)
    east, north = np.meshgrid(GRID.east_m, GRID.north_m[:3])
    for _ in range(5):
        density.add(east.ravel(), north.ravel(), np.full(18, 9.0), np.ones(18))
    assert np.isclose(density.ensonified_pct(), 100.0 * 2 / 3)
    assert np.isclose(density.dense_pct(5), 100.0 * 2 / 3)
    assert density.dense_pct(6) == 0.0


def test_a_copy_goes_its_own_way() -> None:
    density = DensityGrid(GRID, MASK)
    other = density.copy()
    other.add(np.array([11.0]), np.array([-4.0]), np.array([3.0]), np.array([1.0]))
    assert (density.count.sum(), other.count.sum()) == (0, 1)
