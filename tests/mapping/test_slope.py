"""Slopes are those of planes, whichever of their cells are known."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import correlate

from app.mapping.slope import gradient
from app.mapping.types import Grid


@given(
    east=st.floats(-2.0, 2.0),
    north=st.floats(-2.0, 2.0),
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.15, 1.0),
    cell_m=st.floats(0.2, 8.0),
)
def test_the_slope_of_a_plane_is_told_by_whichever_cells_are_known(
    east: float, north: float, seed: int, share: float, cell_m: float
) -> None:
    grid = Grid(3.0, -5.0, cell_m, 25, 31)
    depth = 30.0 + east * grid.east_m + north * grid.north_m[:, None]
    depth[np.random.default_rng(seed).random(depth.shape) > share] = np.nan
    known = np.isfinite(depth).astype(float)
    enough = correlate(known, np.ones((7, 7)), mode="constant") >= 6
    found = gradient(depth, cell_m)[enough]
    assert np.allclose(found, np.hypot(east, north), rtol=0.01, atol=1e-6)


def test_the_scatter_of_soundings_on_a_level_floor_is_hardly_a_slope() -> None:
    depth = 10.0 + 0.1 * np.random.default_rng(0).standard_normal((200, 200))
    found = gradient(depth, 1.0, np.full_like(depth, 0.1))
    assert np.sqrt((found**2).mean()) < 0.01
    assert not gradient(np.full((3, 1), np.nan), 1.0).any()
