"""Which cells the pixels of Web Mercator tiles show."""

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.map_windows import geographic_bounds, window_cells
from app.mapping.coordinates.web_tiles import WORLD_M, WebTile, finest_zoom
from app.mapping.types import Grid

TO_DEGREES = pyproj.Transformer.from_crs("EPSG:3857", "EPSG:4326", always_xy=True)


@pytest.mark.slow
@given(
    lat=st.floats(-75.0, 80.0),
    lon=st.floats(-179.0, 179.0),
    cell_m=st.sampled_from([0.25, 1.0, 7.0, 40.0]),
    zoom=st.integers(9, 22),
    double=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_each_pixel_shows_the_cell_under_its_middle(
    lat: float, lon: float, cell_m: float, zoom: int, double: bool
) -> None:
    grid, frame, side = Grid(-20.0, 30.0, cell_m, 60, 90), LocalFrame(lat, lon), 512 if double else 256
    south, west, north, east = geographic_bounds(grid, frame)
    x, y = TO_DEGREES.transform((west + east) / 2, (south + north) / 2, direction="INVERSE")
    tile_m = WORLD_M / 2**zoom
    tile = WebTile(zoom, int((x + WORLD_M / 2) // tile_m), int((WORLD_M / 2 - y) // tile_m))
    left, bottom, right, top = tile.bounds_m
    assert left <= x <= right
    assert bottom <= y <= top
    middle = (np.arange(side) + 0.5) * tile_m / side
    lons, lats = TO_DEGREES.transform(*np.meshgrid(left + middle, top - middle))
    within = (abs(lats - lat) < 1.0) & (abs(lons - lon) < 1.0)
    at_east, at_north = np.full(lats.shape, np.inf), np.full(lats.shape, np.inf)
    at_east[within], at_north[within] = frame.to_local(lats[within], lons[within])
    col, row = np.floor((at_east - grid.west_m) / cell_m), np.floor((at_north - grid.south_m) / cell_m)
    on_grid = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)
    wanted = np.where(on_grid, np.where(on_grid, row, 0) * grid.cols + np.where(on_grid, col, 0), -1)
    found = np.full((side, side), -1)
    part = window_cells(tile.window(side), grid, frame)
    if part is not None:
        rows, cols = part.source.shape
        found[part.top : part.top + rows, part.left : part.left + cols] = part.source
    assert (found != wanted).mean() < 2e-3, "but for pixels on the edge of a cell"


def test_tiles_beside_the_grid_show_nothing() -> None:
    grid, frame = Grid(0, 0, 1.0, 50, 50), LocalFrame(41.0, -8.0)
    assert window_cells(WebTile(10, 0, 0).window(256), grid, frame) is None
    assert window_cells(WebTile(0, 0, 0).window(256), grid, frame) is not None


@pytest.mark.parametrize("place", [(25, 0, 0), (-1, 0, 0), (3, 8, 0), (3, 0, -1)])
def test_a_tile_that_there_is_not_is_refused(place: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="must be from 0"):
        WebTile(*place)


def test_the_finest_zoom_shows_cells_as_four_pixels() -> None:
    for cell_m in (0.1, 1.0, 30.0):
        zoom = finest_zoom(cell_m, 41.0)
        pixel_m = WORLD_M / 2**zoom / 256 * np.cos(np.radians(41.0))
        assert 4.0 <= cell_m / pixel_m < 8.0
