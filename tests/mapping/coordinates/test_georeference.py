"""The local frame agrees with geodesics and survives threads."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame

LEIXOES = LocalFrame(41.1850, -8.7040)


@settings(deadline=None)
@given(
    lat=st.floats(-80, 80),
    lon=st.floats(-180, 180),
    bearing_deg=st.floats(0, 360),
    distance_m=st.floats(0, 5000),
)
def test_distance_and_direction_agree_with_the_geodesic(
    lat: float, lon: float, bearing_deg: float, distance_m: float
) -> None:
    to_lon, to_lat, _ = pyproj.Geod(ellps="WGS84").fwd(lon, lat, bearing_deg, distance_m)
    east, north = LocalFrame(lat, lon).to_local(to_lat, to_lon)
    assert np.hypot(east, north) == pytest.approx(distance_m, rel=1e-6, abs=2e-4)  # PROJ knows degrees to 1e-9
    assert east == pytest.approx(distance_m * np.sin(np.radians(bearing_deg)), abs=2e-3 * distance_m + 2e-4)


@settings(deadline=None)
@given(east=st.floats(-5e4, 5e4), north=st.floats(-5e4, 5e4))
def test_there_and_back_is_the_identity(east: float, north: float) -> None:
    back = LEIXOES.to_local(*LEIXOES.to_geographic(east, north))
    assert back == (pytest.approx(east, abs=1e-4), pytest.approx(north, abs=1e-4))


def test_arrays_keep_their_shape() -> None:
    east, north = LEIXOES.to_local(np.full((3, 2), 41.186), -8.704)
    assert east.shape == north.shape == (3, 2)
    np.testing.assert_allclose(north, 111.08, atol=0.1)


def test_threads_share_a_frame() -> None:
    lat = np.linspace(41.18, 41.19, 2000)
    expected = LEIXOES.to_local(lat, -8.70)
    with ThreadPoolExecutor(4) as pool:
        for result in pool.map(lambda _: LEIXOES.to_local(lat, -8.70), range(32)):
            np.testing.assert_array_equal(result, expected)


def test_a_frame_can_be_pickled() -> None:
    copy = pickle.loads(pickle.dumps(LEIXOES))  # noqa: S301
    assert copy.to_local(41.19, -8.70) == LEIXOES.to_local(41.19, -8.70)


def test_the_wkt_describes_the_same_projection() -> None:
    other = pyproj.Transformer.from_crs("EPSG:4326", LEIXOES.crs_wkt, always_xy=True)
    np.testing.assert_allclose(other.transform(-8.71, 41.20), LEIXOES.to_local(41.20, -8.71), atol=1e-6)


@pytest.mark.parametrize(
    ("lat", "lon", "named"),
    [(91.0, 0.0, "origin_lat_deg"), (float("nan"), 0.0, "origin_lat_deg"), (0.0, 181.0, "origin_lon_deg")],
)
def test_an_impossible_origin_is_named(lat: float, lon: float, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        LocalFrame(lat, lon)


@pytest.mark.parametrize("lat_lon", [(10.0, -8.7), (float("nan"), -8.7)])
def test_positions_far_away_are_refused(lat_lon: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="200 km"):
        LEIXOES.to_local(*lat_lon)
