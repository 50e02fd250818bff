"""Lines over a floor with slopes and ripples, by which the mounting of a sonar is told."""

import math
from typing import Any

import numpy as np

from simulator.floors.terrain import Terrain
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.swath import EXACT, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from tests.support.mapping.tracks import flown, lawnmower
from tests.support.missions.specs import lon_lat

REAL: dict[str, Any] = {"roll_deg": 1.2, "pitch_deg": -2.5, "heading_deg": 3.0, "offset_m": [1.5, 0.5, 0.2]}
ALOFT_M = 20.0
"""The floor reaches so far beyond the area."""


SIDE_M = 60.0
"""Of the area."""


def hills() -> Terrain:
    at = np.arange(0.25, SIDE_M + 2 * ALOFT_M, 0.5) - ALOFT_M
    east, north = np.meshgrid(at, at)
    depth = 12.0 + 0.05 * east + 0.8 * np.sin(north / 4.0) * np.cos(east / 5.0) + 0.3 * np.sin(east / 2.0 + north)
    lon, lat = lon_lat(-ALOFT_M, -ALOFT_M)
    return Terrain(depth, 0.5, lat, lon)


def calibration(vehicle: str, start_s: float) -> list[dict[str, Any]]:
    """Pings of lines there and back, of which neighbours overlap by more than half."""
    terrain, real = hills(), SonarMounting(**REAL)
    sounder = SwathSounder(SwathSonar(aperture_deg=110.0, beams=61), EXACT, np.random.default_rng(0), real)
    corners = [(east + 10.0, north + 5.0) for east, north in lawnmower(40.0, 50.0, 8.0)]
    way = flown(corners, spacing_m=0.5, start_s=start_s)
    course = np.arctan2(np.gradient(way[:, 1]), np.gradient(way[:, 2]))
    items = []
    for row, heading in zip(way.tolist(), course.tolist(), strict=True):
        ranges = sounder.ping(terrain, Motion(row[1] + ALOFT_M, row[2] + ALOFT_M, 2.0, heading))
        lon, lat = lon_lat(row[1], row[2])
        beams = {
            "angles_deg": np.degrees(sounder.angles_rad).tolist(),
            "ranges_m": [None if math.isnan(one) else one for one in ranges.tolist()],
        }
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "heading_deg": math.degrees(heading) % 360.0}
        items.append({"vehicle": vehicle, "time_s": row[0], "beams": beams} | place)
    return items
