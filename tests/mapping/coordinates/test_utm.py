"""Which UTM zone a place lies in."""

import pytest

from app.mapping.coordinates.utm import utm_epsg


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
