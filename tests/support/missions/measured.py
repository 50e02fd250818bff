"""Soundings as a polling vehicle sends them, two of them wrong."""

from app.missions.soundings.measurement import Measurement
from app.missions.views.measurements.soundings import SoundingState
from tests.support.missions.harbour import CLOCK_S
from tests.support.missions.specs import lon_lat

NOT_USED = (SoundingState.REJECTED, SoundingState.DOUBTED, SoundingState.WITHDRAWN)


def measured(count: int = 80, wrong: int | None = 40) -> list[Measurement]:
    """Soundings to and fro over a slope of 8 to 11 m; one of them hit a fish, one was taken far away."""
    items = []
    for i in range(count):
        east, north = 1.5 + 28 * (i % 10) / 10, 1.5 + 28 * (i // 10) / 8
        lon, lat = lon_lat(east, north)
        range_m = 6.0 + 0.1 * east if i != wrong else 2.5
        items.append(
            Measurement(vehicle="a", time_s=CLOCK_S + 10 * i, lat_deg=lat, lon_deg=lon, depth_m=2, range_m=range_m)
        )
    lon, lat = lon_lat(70, 10)
    away = CLOCK_S + 10 * count + 100
    items.append(Measurement(vehicle="a", time_s=away, lat_deg=lat, lon_deg=lon, depth_m=2, range_m=9))
    return items
