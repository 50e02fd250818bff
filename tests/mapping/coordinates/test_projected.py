"""Cells are taken to a projected system at their places, and no shoal is lost on the way."""

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import UTM, ProjectedFrame, named_frame, projected_cells
from app.mapping.types import BathymetricMap, Grid

LEIXOES = LocalFrame(41.1850, -8.7040)


def map_of(depth: np.ndarray, cell_m: float = 1.0) -> BathymetricMap:
    sounded = np.isfinite(depth)
    grid = Grid(-7.0, 3.0, cell_m, *depth.shape)
    return BathymetricMap(grid, depth, 0.0 * depth, sounded.astype(int), sounded, 0.0 * depth + 1.0, 5.0, "test")


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
    cells = projected_cells(bathymetry, named_frame(UTM, frame, 0.0, 0.0), keep)
    depth = cells.of(bathymetry.depth_m, np.nan)

    grid, found = bathymetry.grid, cells.grid
    east, north = np.meshgrid(grid.east_m, grid.north_m)
    to_zone = pyproj.Transformer.from_crs(frame.crs, cells.frame.epsg, always_xy=True)
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
        projected_cells(
            map_of(np.ones((3, 3))), ProjectedFrame(32631, LocalFrame(0.0, 0.0)), np.zeros((3, 3), dtype=bool)
        )


def test_a_cell_without_a_depth_hides_no_shoal() -> None:
    """As in maps of swaths, which keep what was missed."""
    depth = 10.0 + np.random.default_rng(0).standard_normal((23, 31))
    depth[::2, ::3] = np.nan
    bathymetry = map_of(depth)
    keep = np.ones(depth.shape, dtype=bool)
    frame = ProjectedFrame(3035, LEIXOES)
    cells = projected_cells(bathymetry, frame, keep)
    moved = cells.map(bathymetry)
    assert not moved.sounded[np.isnan(moved.depth_m)].any()

    east, north = (axis[np.isfinite(depth)] for axis in np.meshgrid(bathymetry.grid.east_m, bathymetry.grid.north_m))
    x, y = pyproj.Transformer.from_crs(LEIXOES.crs, 3035, always_xy=True).transform(east, north)
    at = moved.depth_m[(y - cells.grid.south_m).astype(int), (x - cells.grid.west_m).astype(int)]
    assert (at <= depth[np.isfinite(depth)]).all()


@pytest.mark.parametrize(
    ("name", "epsg"),
    [("utm", 32629), ("UTM", 32629), ("EPSG:25829", 25829), ("epsg:3763", 3763), ("EPSG:32628", 32628)],
)
def test_a_system_has_its_name(name: str, epsg: int) -> None:
    frame = named_frame(name, LEIXOES, 30.0, 40.0)
    assert (frame.epsg, frame.statement.rpartition(" ")[2]) == (epsg, f"(EPSG:{epsg})")
    x, y = frame.from_local(30.0, 40.0)
    expected = pyproj.Transformer.from_crs(4326, epsg).transform(*LEIXOES.to_geographic(30.0, 40.0))
    northing_first = frame.crs.axis_info[0].direction == "north"
    assert (float(x), float(y)) == pytest.approx(expected[::-1] if northing_first else expected, abs=1e-3)
    assert [float(v) for v in frame.to_geographic(x, y)] == pytest.approx(
        [float(v) for v in LEIXOES.to_geographic(30.0, 40.0)], abs=1e-9
    )


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("utm29", "'utm29' is neither utm nor EPSG: and a code"),
        ("EPSG:٣٢٦٢٩", "is neither utm nor"),
        ("EPSG:99999", "there is no EPSG:99999"),
        ("EPSG:4326", r"WGS 84 \(EPSG:4326\) is no projected system in metres"),
        ("EPSG:5861", "is no projected system in metres"),
        ("EPSG:5972", "is no projected system in metres"),
        ("EPSG:2263", r"ftUS.* is no projected system in metres"),
        ("EPSG:2048", "does not count to the east and to the north"),
        ("EPSG:3857", "was made for another place"),
        ("EPSG:32650", "made for another place|does not reach"),
        ("EPSG:25832", "was made for another place: Europe between 6°E and 12°E"),
        ("EPSG:32729", "was made for another place: .*southern hemisphere"),
        ("EPSG:27700", "was made for another place: United Kingdom"),
        ("EPSG:2193", "was made for another place: New Zealand"),
    ],
)
def test_what_is_no_system_for_the_place_is_refused(name: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        named_frame(name, LEIXOES, 30.0, 40.0)
