"""Distances over the sphere, against the geodesics of the ellipsoid."""

from itertools import pairwise

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.coordinates.distances import horizontal_distance_m, leg_lengths_m

GEOD = pyproj.Geod(ellps="WGS84")
SPHERE = 0.006
"""By which part a sphere is wrong at most."""

PLACES = st.tuples(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0))


def geodesic_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    _, _, distance_m = GEOD.inv(a[1], a[0], b[1], b[0])
    return float(distance_m)


@pytest.mark.parametrize("lat_deg", [0.0, -17.0, 65.0, 89.0])
def test_places_on_both_sides_of_180_degrees_are_metres_apart(lat_deg: float) -> None:
    a, b = (lat_deg, 179.9999), (lat_deg + 1e-4, -179.9999)
    assert horizontal_distance_m(a, b) == pytest.approx(geodesic_m(a, b), rel=SPHERE)
    assert horizontal_distance_m(a, b) < 30.0


@given(PLACES, PLACES)
def test_distances_are_those_of_the_ellipsoid_to_six_thousandths(
    a: tuple[float, float], b: tuple[float, float]
) -> None:
    assert horizontal_distance_m(a, b) == pytest.approx(geodesic_m(a, b), rel=SPHERE, abs=1e-6)
    assert horizontal_distance_m(a, b) == horizontal_distance_m(b, a)


@pytest.mark.parametrize("lat_deg", [-89.9, -60.0, 0.0, 41.0, 75.0, 89.9])
def test_metres_are_told_apart_everywhere(lat_deg: float) -> None:
    here = (lat_deg, -8.7)
    for bearing_deg in range(0, 360, 30):
        lon_deg, other_lat_deg, _ = GEOD.fwd(here[1], lat_deg, bearing_deg, 1.5)
        assert horizontal_distance_m(here, (other_lat_deg, lon_deg)) == pytest.approx(1.5, rel=SPHERE)


def test_legs_of_a_way_are_as_long_as_the_distances_between_its_places() -> None:
    rng = np.random.default_rng(3)
    lat_deg = np.cumsum(rng.normal(0.0, 1e-4, 200)) + 71.0
    lon_deg = (np.cumsum(rng.normal(0.0, 1e-3, 200)) + 360.0) % 360.0 - 180.0
    places = list(zip(lat_deg.tolist(), lon_deg.tolist(), strict=True))
    legs_m = leg_lengths_m(lat_deg, lon_deg)
    one_by_one = [horizontal_distance_m(a, b) for a, b in pairwise(places)]
    np.testing.assert_allclose(legs_m, one_by_one, rtol=1e-9)
    assert legs_m.max() < 500.0
