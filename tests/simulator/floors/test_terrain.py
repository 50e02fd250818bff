import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.floors import seafloors
from simulator.floors.terrain import Terrain, TerrainError
from simulator.geodesy import LocalFrame


def slow_depth(terrain: Terrain, east: float, north: float) -> float:
    """Bilinear interpolation between cell centres, written out from its definition."""
    if not (0 <= east <= terrain.width_m and 0 <= north <= terrain.height_m):
        return math.nan
    xs = [(c + 0.5) * terrain.cell_m for c in range(terrain.cols)]
    ys = [(r + 0.5) * terrain.cell_m for r in range(terrain.rows)]
    east = min(max(east, xs[0]), xs[-1])
    north = min(max(north, ys[0]), ys[-1])
    c = max(k for k in range(terrain.cols - 1) if xs[k] <= east)
    r = max(k for k in range(terrain.rows - 1) if ys[k] <= north)
    u, v = (east - xs[c]) / terrain.cell_m, (north - ys[r]) / terrain.cell_m
    z = terrain.z_m
    south = z[r, c] * (1 - u) + z[r, c + 1] * u
    top = z[r + 1, c] * (1 - u) + z[r + 1, c + 1] * u
    return south * (1 - v) + top * v


RANDOM = Terrain(np.random.default_rng(3).uniform(2, 20, (7, 5)), 2.5)
inside = {"east": st.floats(0, RANDOM.width_m), "north": st.floats(0, RANDOM.height_m)}


@given(**inside)
def test_depth_is_the_bilinear_interpolation(east: float, north: float) -> None:
    assert RANDOM.depth_at(east, north) == pytest.approx(slow_depth(RANDOM, east, north))


@given(east=st.floats(-10, 30), north=st.floats(-10, 30))
def test_one_point_and_many_agree(east: float, north: float) -> None:
    many = float(RANDOM.depth_at(east, north))
    assert RANDOM.depth_at_point(east, north) == pytest.approx(many, nan_ok=True)


def test_cell_centres_give_the_cells_and_row_0_is_south() -> None:
    z = np.arange(12.0).reshape(3, 4) + 1
    terrain = Terrain(z, 2.0)
    east, north = np.meshgrid((np.arange(4) + 0.5) * 2, (np.arange(3) + 0.5) * 2)
    np.testing.assert_allclose(terrain.depth_at(east, north), z)
    assert terrain.depth_at(7.0, 1.0) == 4.0


@pytest.mark.parametrize("place", [(-0.1, 1), (1, -0.1), (12.6, 1), (1, 17.6)])
def test_outside_is_unknown(place: tuple[float, float]) -> None:
    assert math.isnan(RANDOM.depth_at(*place))
    assert math.isnan(RANDOM.depth_at_point(*place))


def test_unknown_cells_spread_only_as_far_as_they_take_part() -> None:
    z = np.full((4, 4), 5.0)
    z[1, 1] = np.nan
    terrain = Terrain(z, 1.0)
    assert math.isnan(terrain.depth_at(1.6, 1.6))
    assert terrain.depth_at(2.5, 2.5) == 5.0
    assert terrain.depth_at_point(2.5, 1.5) == 5.0


def test_depths_cannot_be_changed_from_outside() -> None:
    with pytest.raises(ValueError, match="read-only"):
        RANDOM.z_m[0, 0] = 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros(4), 1.0), "2-D"),
        ((np.full((3, 3), np.inf), 1.0), "infinite"),
        ((np.full((3, 3), np.nan), 1.0), "no known depth"),
        ((np.ones((3, 3)), 0.0), "cell_m is 0.0"),
        ((np.ones((3, 3)), 1.0, 41.0, None), "both or neither"),
        ((np.ones((3, 3)), 1.0, 99.0, 0.0), "origin_lat is 99.0"),
        ((np.ones((3, 3)), 1.0, 41.0, 999.0), "origin_lon is 999.0"),
    ],
)
def test_impossible_terrains_are_refused_with_the_reason(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(TerrainError, match=message):
        Terrain(*arguments)


@pytest.mark.parametrize("family", sorted(seafloors.FAMILIES))
class TestFamilies:
    def test_the_seed_decides(self, family: str) -> None:
        one, again, other = (seafloors.generate(family, seed) for seed in (1, 1, 2))
        np.testing.assert_array_equal(one.z_m, again.z_m)
        assert not np.array_equal(one.z_m, other.z_m)

    @pytest.mark.parametrize("seed", range(5))
    def test_depths_suit_an_auv(self, family: str, seed: int) -> None:
        terrain = seafloors.generate(family, seed)
        assert terrain.z_m.shape == (100, 100)
        assert terrain.min_depth_m >= seafloors.LEAST_DEPTH_M
        assert 5.0 < terrain.max_depth_m < 40.0

    def test_size_and_cell_are_as_asked(self, family: str) -> None:
        terrain = seafloors.generate(family, 0, width_m=60, height_m=30, cell_m=0.5, origin=(41.0, -8.0))
        assert (terrain.rows, terrain.cols) == (60, 120)
        assert (terrain.frame.lat_deg, terrain.frame.lon_deg) == (41.0, -8.0)


@pytest.mark.parametrize("seed", range(4))
def test_the_harbour_has_a_slope_an_edge_and_sharp_features(seed: int) -> None:
    z = seafloors.generate("harbour", seed).z_m
    gradient = np.hypot(*np.gradient(z))
    assert np.median(gradient) < 0.08, "most of it is gentle"
    assert np.quantile(gradient, 0.995) > 0.35, "the edge and the features are steep"
    assert 3.0 < np.quantile(z, 0.9) - np.quantile(z, 0.1) < 8.0


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [({"family": "moon"}, "canyon"), ({"cell_m": -1}, "cell_m is -1"), ({"width_m": 1}, "width_m is 1")],
)
def test_impossible_families_are_refused_with_the_choices(kwargs: dict[str, Any], message: str) -> None:
    with pytest.raises(TerrainError, match=message):
        seafloors.generate(**kwargs)


@given(east=st.floats(-5000, 5000), north=st.floats(-5000, 5000))
def test_the_local_frame_goes_there_and_back(east: float, north: float) -> None:
    frame = LocalFrame()
    assert frame.to_local(*frame.to_geodetic(east, north)) == pytest.approx((east, north), abs=1e-6)


def test_the_local_frame_measures_true_distances() -> None:
    import pyproj

    frame = LocalFrame(41.185, -8.705)
    lat, lon = frame.to_geodetic(300.0, -400.0)
    _, _, distance = pyproj.Geod(ellps="WGS84").inv(-8.705, 41.185, lon, lat)
    assert distance == pytest.approx(500.0, abs=1e-4)


@pytest.mark.parametrize("origin", [(91.0, 0.0), (0.0, 181.0), (math.nan, 0.0)])
def test_an_origin_off_the_earth_is_refused(origin: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="origin"):
        LocalFrame(*origin)
