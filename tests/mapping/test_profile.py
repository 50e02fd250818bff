"""Maps cut along lines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.profile import beside, layer_along, line_through, profile_along
from app.mapping.types import BathymetricMap, Grid

GRID = Grid(west_m=-10.0, south_m=5.0, cell_m=2.0, rows=12, cols=15)


def plane(east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    return np.asarray(20.0 + 0.3 * east_m - 0.2 * north_m)


def sloping(unknown: tuple[int, int] | None = None) -> BathymetricMap:
    """A plane, of which one cell may not be known; the western half was sounded and is surer."""
    east, north = np.meshgrid(GRID.east_m, GRID.north_m)
    depth, sd = plane(east, north), np.where(east < 5.0, 0.1, 0.4)
    if unknown is not None:
        depth[unknown] = sd[unknown] = np.nan
    shape = depth.shape
    sounded = east < 5.0
    return BathymetricMap(GRID, depth, sd, sounded.astype(int), sounded, np.ones(shape), 5.0, "plane")


CORNERS = np.array([[-8.0, 7.0], [12.0, 7.0], [12.0, 25.0]])


@given(spacing_m=st.floats(0.05, 50.0))
def test_a_line_has_its_ends_and_equal_steps_no_longer_than_asked(spacing_m: float) -> None:
    line = line_through(CORNERS, spacing_m)
    assert line.length_m == pytest.approx(38.0)
    assert np.allclose(line.points_m[[0, -1]], CORNERS[[0, -1]])
    steps = np.diff(line.along_m)
    assert np.allclose(steps, steps[0])
    assert steps[0] <= spacing_m * (1 + 1e-6)


def test_a_line_needs_two_places_and_a_spacing() -> None:
    with pytest.raises(ValueError, match="two different corners"):
        line_through(np.array([[1.0, 2.0], [1.0, 2.0]]), 1.0)
    with pytest.raises(ValueError, match="must be positive"):
        line_through(CORNERS, 0.0)
    again = np.repeat(CORNERS, 2, axis=0)
    assert np.array_equal(line_through(again, 1.0).points_m, line_through(CORNERS, 1.0).points_m)


def test_a_plane_is_cut_exactly_and_its_deviation_is_never_smaller_than_a_cells() -> None:
    line = line_through(CORNERS, 0.7)
    found = profile_along(sloping(), line)
    assert np.allclose(found.depth_m, plane(*line.points_m.T))
    nearest = layer_along(GRID, sloping().sd_m, line)
    assert (found.sd_m >= nearest).all()
    assert np.array_equal(found.sounded, nearest == 0.1)


def test_nothing_is_said_outside_and_where_nothing_is_known() -> None:
    line = line_through(np.array([[-20.0, 12.0], [40.0, 12.0]]), 1.0)
    found = profile_along(sloping(unknown=(3, 8)), line)
    east = line.points_m[:, 0]
    outside = (east < -10.0) | (east >= 20.0)
    hole = (east >= 6.0) & (east < 8.0)
    assert np.array_equal(np.isnan(found.depth_m), outside | hole)
    assert np.array_equal(np.isnan(found.sd_m), outside | hole)
    assert not found.sounded[outside].any()
    assert np.array_equal(np.isnan(layer_along(GRID, sloping(unknown=(3, 8)).depth_m, line)), outside | hole)


def test_soundings_beside_a_line_are_told_by_how_far_along_and_to_which_side() -> None:
    line = line_through(CORNERS, 1.0)
    places = np.array([[0.0, 8.0], [0.0, 6.5], [13.0, 10.0], [0.0, 9.5], [-9.0, 7.0], [12.0, 26.0], [12.5, 6.5]])
    found = beside(line, places, 1.2)
    assert found.rows.tolist() == [0, 1, 6, 2]
    assert found.along_m == pytest.approx([8.0, 8.0, 20.0, 23.0])
    # East-bound: north is to port; at the corner by the distance from it.
    assert found.across_m == pytest.approx([-1.0, 0.5, np.hypot(0.5, 0.5), 1.0])
