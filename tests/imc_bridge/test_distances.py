"""Distances between vehicles and places, against the geodesics of the ellipsoid."""

import pyproj
import pytest

from imc_bridge.distances import distance_m, offset_m

GEOD = pyproj.Geod(ellps="WGS84")


@pytest.mark.parametrize("lat_deg", [-89.9, -17.0, 0.0, 41.0, 75.0])
@pytest.mark.parametrize("lon_deg", [-8.7, 180.0, -179.9999])
@pytest.mark.parametrize("away_m", [1.5, 800.0, 20_000.0])
def test_distances_are_those_of_the_ellipsoid_also_across_180_degrees(
    lat_deg: float, lon_deg: float, away_m: float
) -> None:
    for bearing_deg in range(0, 360, 45):
        other_lon_deg, other_lat_deg, _ = GEOD.fwd(lon_deg, lat_deg, bearing_deg, away_m)
        assert distance_m((lat_deg, lon_deg), (other_lat_deg, other_lon_deg)) == pytest.approx(away_m, rel=1e-6)


def test_a_place_on_the_other_side_of_the_earth_is_not_near() -> None:
    assert distance_m((0.0, 0.0), (0.0, 180.0)) > 12_000_000.0


def test_offsets_are_north_then_east() -> None:
    north_m, east_m = offset_m((0.0, 180.0), (0.001, -179.998))
    assert north_m == pytest.approx(110.574, abs=0.01)
    assert east_m == pytest.approx(222.639, abs=0.01)
