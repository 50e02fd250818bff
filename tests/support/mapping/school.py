"""Pings over a level bottom with a school of fish, which several pings meet, and one beam that met something shoal."""

from typing import Any

import numpy as np

from tests.support.missions.specs import lon_lat

SONAR_M, BOTTOM_M, FISH_M, SPIKE_M = 2.0, 12.0, 7.0, 4.0
ANGLES = np.radians(np.arange(-50.0, 51.0, 5.0))
PINGS = 40
SPIKE_PING, SPIKE_BEAM = 10, 15
FISH_AT = (18.0, 30.0, 26.0, 34.0)
"""West, south, east, north of the school, metres in the frame of missions of tests."""


def surveyed(vehicle: str, start_s: float, *, first: int = 0, pings: int = PINGS) -> list[dict[str, Any]]:
    """Pings along a line to the east, one a second and metre from the ``first`` one on, as vehicles post them."""
    items = []
    for number in range(first, first + pings):
        east = 5.0 + number
        lon, lat = lon_lat(east, 30.0)
        down = np.full(len(ANGLES), BOTTOM_M - SONAR_M)
        if FISH_AT[0] <= east <= FISH_AT[2]:
            # Heading east, starboard is south.
            north = 30.0 - (FISH_M - SONAR_M) * np.tan(ANGLES)
            down[(north >= FISH_AT[1]) & (north <= FISH_AT[3])] = FISH_M - SONAR_M
        if number == SPIKE_PING:
            down[SPIKE_BEAM] = SPIKE_M - SONAR_M
        beams = {"angles_deg": np.degrees(ANGLES).tolist(), "ranges_m": (down / np.cos(ANGLES)).tolist()}
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": SONAR_M, "heading_deg": 90.0}
        items.append({"vehicle": vehicle, "time_s": start_s + number, "beams": beams} | place)
    return items
