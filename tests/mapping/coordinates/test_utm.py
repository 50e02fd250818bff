"""Cells are taken to a UTM zone at their places, and no shoal is lost on the way."""

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.utm import utm_cells, utm_epsg
from app.mapping.types import BathymetricMap, Grid


def map_of(depth: np.ndarray, cell_m: float = 1.0) -> BathymetricMap:
    sounded = np.isfinite(depth)
    grid = Grid(-7.0, 3.0, cell_m, *depth.shape)
    return BathymetricMap(grid, depth, 0.0 * depth, sounded.astype(int), sounded, 0.0 * depth + 1.0, 5.0, "test")


@pytest.mark.parametrize(
    ("lat", "lon", "epsg"),
    [
        (41.2, -8.7, 32629),
        (-33.9, 18.4, 32734),
        (10.0, 180.0, 32601),
        (10.0, -180.0, 32601),
        (85.0, 3.0, 5041),
        (-81.0, 3.0, 5042),
        # Norway's zone 32 reaches west to 3 degrees, and Svalbard has zones of 9 and 12 degrees: 31V, 32V, 31X to 37X.
        (60.4, 5.2, 32632),
        (60.4, 2.9, 32631),
        (55.9, 5.2, 32631),
        (64.0, 5.2, 32631),
        (78.2, 8.5, 32631),
        (78.2, 9.5, 32633),
        (78.2, 15.6, 32633),
        (78.2, 21.5, 32635),
        (78.2, 33.5, 32637),
        (78.2, 42.5, 32638),
        (71.9, 9.5, 32632),
        (-78.2, 9.5, 32732),
    ],
)
def test_a_place_has_its_zone(lat: float, lon: float, epsg: int) -> None:
    assert utm_epsg(lat, lon) == epsg


@pytest.mark.slow
@given(
    lat=st.floats(-79.0, 83.0),
    lon=st.floats(-180.0, 180.0),
    cell_m=st.sampled_from([0.5, 1.0, 2.5]),
    seed=st.integers(0, 99),
)
def test_every_cell_arrives_within_a_cell_of_its_place_or_gives_way_to_a_shoaler_one(
    lat: float, lon: float, cell_m: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    bathymetry = map_of(10.0 + rng.standard_normal((23, 31)), cell_m)
    keep = rng.random((23, 31)) < 0.7
    frame = LocalFrame(lat, lon)
    cells = utm_cells(bathymetry, frame, keep)
    depth = cells.of(bathymetry.depth_m, np.nan)

    grid, found = bathymetry.grid, cells.grid
    east, north = np.meshgrid(grid.east_m, grid.north_m)
    to_zone = pyproj.Transformer.from_crs(frame.crs, cells.epsg, always_xy=True)
    x, y = to_zone.transform(east[keep], north[keep])
    at = depth[((y - found.south_m) // cell_m).astype(int), ((x - found.west_m) // cell_m).astype(int)]
    assert (at <= bathymetry.depth_m[keep]).all(), "as deep as the map's cell whose centre it holds, or shoaler"

    row, col = np.nonzero(cells.filled)
    source = cells.source[cells.filled]
    assert keep.ravel()[source].all()
    away = np.hypot(
        found.east_m[col] - to_zone.transform(east.ravel()[source], north.ravel()[source])[0],
        found.north_m[row] - to_zone.transform(east.ravel()[source], north.ravel()[source])[1],
    )
    assert away.max() <= np.sqrt(0.5) * cell_m * 1.01
    assert np.isnan(depth[~cells.filled]).all()


def test_nothing_to_keep_is_refused() -> None:
    with pytest.raises(ValueError, match="no cell"):
        utm_cells(map_of(np.ones((3, 3))), LocalFrame(0.0, 0.0), np.zeros((3, 3), dtype=bool))
