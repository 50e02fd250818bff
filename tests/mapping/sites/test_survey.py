"""What a survey alone found, and the same on a site's grid."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.sites import Survey, resample, survey_of
from app.mapping.types import BathymetricMap, Grid

FRAME = LocalFrame(41.185, -8.705)
GRID = Grid(0.0, 0.0, 1.0, 30, 40)


def floor(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(12.0 + 0.05 * east - 0.08 * north)


def survey(frame: LocalFrame = FRAME, grid: Grid = GRID) -> Survey:
    """Of the floor above, which is given in ``FRAME``."""
    north, east = np.meshgrid(grid.north_m, grid.east_m, indexing="ij")
    depth = floor(*FRAME.to_local(*frame.to_geographic(east, north)))
    return Survey(grid, depth, np.full(depth.shape, 0.2), np.ones(depth.shape, bool), 5.0, 0.1, 7.0)


def test_the_same_grid_is_the_same_survey() -> None:
    one = survey()
    assert resample(one, FRAME, GRID, LocalFrame(41.185, -8.705)) is one


@pytest.mark.parametrize("cell_m", [0.5, 1.0, 3.0])
def test_depths_are_where_they_are_on_the_earth_whatever_the_cell(cell_m: float) -> None:
    other = LocalFrame(41.1849, -8.7053)
    grid = Grid(10.0, -5.0, cell_m, round(40 / cell_m), round(60 / cell_m))
    found = resample(survey(), FRAME, grid, other)
    north, east = np.meshgrid(grid.north_m, grid.east_m, indexing="ij")
    at = FRAME.to_local(*other.to_geographic(east, north))
    inside = (np.abs(at[0] - 20.0) < 20.0 - cell_m) & (np.abs(at[1] - 15.0) < 15.0 - cell_m)
    outside = (np.abs(at[0] - 20.0) > 20.0 + cell_m) | (np.abs(at[1] - 15.0) > 15.0 + cell_m)
    np.testing.assert_allclose(found.depth_m[inside], floor(*at)[inside], atol=1e-3)
    np.testing.assert_allclose(found.sd_m[inside], 0.2)
    assert found.sounded[inside].all()
    assert np.isnan(found.depth_m[outside]).all()
    assert not found.sounded[outside].any()
    assert (found.time_s, found.shared_sd_m, found.correlation_length_m) == (5.0, 0.1, 7.0)


def test_holes_stay_holes_and_edges_are_not_eaten() -> None:
    one = survey()
    one.depth_m[10:15, 10:20] = np.nan
    one.sd_m[10:15, 10:20] = np.nan
    shifted = Grid(0.25, 0.25, 1.0, 29, 39)
    found = resample(one, FRAME, shifted, FRAME)
    np.testing.assert_array_equal(np.isfinite(found.depth_m), np.isfinite(one.depth_m)[:29, :39])
    coarse = resample(one, FRAME, Grid(0.0, 0.0, 5.0, 6, 8), FRAME)
    assert np.isnan(coarse.depth_m).sum() == 2


def test_what_no_sounding_supports_is_not_found() -> None:
    shape = (2, 3)
    own = BathymetricMap(
        grid=Grid(0.0, 0.0, 1.0, *shape),
        depth_m=np.full(shape, 5.0),
        sd_m=np.full(shape, 0.3),
        count=np.array([[2, 0, 0], [0, 0, 0]]),
        sounded=np.array([[True, False, False], [False, False, False]]),
        roughness=np.ones(shape),
        correlation_length_m=4.0,
        model="m",
        bound_sd_m=np.array([[0.3, 0.4, np.inf], [0.5, np.inf, np.inf]]),
    )
    found = survey_of(own, 9.0, 0.1)
    assert found.known.tolist() == [[True, True, False], [True, False, False]]
    assert found.sounded.tolist() == own.sounded.tolist()
    assert np.isnan(found.sd_m[~found.known]).all()
