"""Which cells the pixels of windows in any system of coordinates show."""

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.map_windows import MapWindow, geographic_bounds, window_cells, window_pixel_cells
from app.mapping.coordinates.utm import utm_epsg
from app.mapping.types import Grid


def shown(window: MapWindow, grid: Grid, frame: LocalFrame) -> np.ndarray:
    """The number of the cell under each pixel, -1 without one."""
    found = np.full((window.height_px, window.width_px), -1)
    part = window_cells(window, grid, frame)
    if part is not None:
        rows, cols = part.source.shape
        found[part.top : part.top + rows, part.left : part.left + cols] = part.source
    return found


@given(
    lat=st.floats(-75.0, 80.0),
    lon=st.floats(-179.0, 179.0),
    cell_m=st.sampled_from([0.5, 3.0, 40.0]),
    system=st.sampled_from(["degrees", "mercator", "utm"]),
    size=st.tuples(st.integers(1, 150), st.integers(1, 150)),
    pixel=st.floats(0.05, 2.0),
    corner=st.tuples(st.floats(-0.2, 1.0), st.floats(-0.2, 1.0)),
)
@settings(max_examples=40, deadline=None)
def test_each_pixel_shows_the_cell_under_its_middle(
    lat: float,
    lon: float,
    cell_m: float,
    system: str,
    size: tuple[int, int],
    pixel: float,
    corner: tuple[float, float],
) -> None:
    """``pixel``: its width in cells, of which wider ones show coarser cells. ``corner``: where the window begins."""
    grid, frame = Grid(-20.0, 30.0, cell_m, 60, 90), LocalFrame(lat, lon)
    south, west, north, east = geographic_bounds(grid, frame)
    epsg = {"degrees": 4326, "mercator": 3857, "utm": utm_epsg((south + north) / 2, (west + east) / 2)}[system]
    transform = pyproj.Transformer.from_crs("OGC:CRS84", f"EPSG:{epsg}", always_xy=True)
    left, bottom, right, top = transform.transform_bounds(west, south, east, north)
    begin_x, begin_y = left + corner[0] * (right - left), bottom + corner[1] * (top - bottom)
    (width, height), unit_x, unit_y = size, pixel * (right - left) / grid.cols, pixel * (top - bottom) / grid.rows
    window = MapWindow(epsg, begin_x, begin_y, begin_x + width * unit_x, begin_y + height * unit_y, width, height)
    x = window.west + (np.arange(width) + 0.5) * (window.east - window.west) / width
    y = window.north - (np.arange(height) + 0.5) * (window.north - window.south) / height
    lons, lats = transform.transform(*np.meshgrid(x, y), direction="INVERSE")
    at_east, at_north = frame.to_local(lats, lons)
    col, row = np.floor((at_east - grid.west_m) / cell_m), np.floor((at_north - grid.south_m) / cell_m)
    on_grid = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)
    wanted = np.where(on_grid, row * grid.cols + col, -1)
    found = shown(window, grid, frame)
    assert (found != wanted).sum() <= 1 + 2e-3 * found.size, "but for pixels on the edge of a cell"
    assert window.place(0, 0) == pytest.approx((lats[0, 0], lons[0, 0]), abs=1e-9)


def test_parts_show_what_the_whole_shows() -> None:
    grid, frame = Grid(0.0, 0.0, 2.0, 80, 120), LocalFrame(41.0, -8.0)
    south, west, north, east = geographic_bounds(grid, frame)
    window = MapWindow(4326, west - 1e-4, south - 1e-4, east + 1e-4, north + 1e-4, 700, 600)
    parts = [window.part(0, 250), window.part(250, 250), window.part(500, 100)]
    together = np.vstack([shown(part, grid, frame) for part in parts])
    whole = shown(window, grid, frame)
    assert whole.shape == together.shape
    assert (whole == together).mean() > 0.999


def test_windows_beside_the_grid_and_beyond_the_earth_show_nothing() -> None:
    grid, frame = Grid(0.0, 0.0, 2.0, 80, 120), LocalFrame(41.0, -8.0)
    for epsg, ends in ((4326, (10.0, 50.0, 11.0, 51.0)), (32629, (-1e9, 5e8, 1e9, 1e9)), (3857, (5e8, 5e8, 1e9, 1e9))):
        assert window_cells(MapWindow(epsg, *ends, 100, 100), grid, frame) is None
    # Japan's zone knows no place at Portugal's coast.
    assert window_cells(MapWindow(32654, 0.0, 0.0, 1e6, 1e7, 100, 100), grid, frame) is None


def test_a_pixel_is_as_wide_as_its_ground() -> None:
    metre = 1.0 / 6_378_137.0 * 180.0 / np.pi
    for epsg, unit in ((3857, 1.0 / np.cos(np.radians(60.0))), (32629, 1.0)):
        window = MapWindow(epsg, 0.0, 0.0, 300.0 * unit, 200.0 * unit, 30, 20)
        assert window_pixel_cells(window, 2.0, 60.0) == pytest.approx(5.0)
    window = MapWindow(4326, 0.0, 60.0, 2.0 * 300.0 * metre, 60.0 + 200.0 * metre, 30, 20)
    assert window_pixel_cells(window, 2.0, 60.0) == pytest.approx(5.0)
