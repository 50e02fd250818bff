"""Two vehicles over one bottom whose lines cross, and what they ping while their positions drift."""

from typing import Any

import numpy as np

from app.arrays import FloatArray
from tests.support.mapping.tracks import flown, lawnmower
from tests.support.missions.specs import lon_lat

SIDE_M = 60.0
START_S = 1_795_225_140.0
OFF_M = 4.0
"""How far the second vehicle has drifted when its dive ends."""
ANGLES = np.radians(np.arange(-60.0, 61.0, 8.0))


def bottom_m(east: FloatArray, north: FloatArray) -> FloatArray:
    return np.asarray(6.0 + 0.8 * np.sin(east / 4.0) * np.cos(north / 5.0) + 0.5 * np.sin((east + 2.0 * north) / 7.0))


def pinged_while_drifting(vehicle: str, way: FloatArray, off_m: FloatArray) -> list[dict[str, Any]]:
    """Pings along a true way (n, 5) of a vehicle that takes itself to be somewhere else by (n, 2)."""
    heading = np.arctan2(np.gradient(way[:, 1]), np.gradient(way[:, 2]))
    items = []
    for (time_s, east, north, *_), course, off in zip(way, heading, off_m, strict=True):
        down = np.full(len(ANGLES), 4.0)
        for _ in range(30):
            aside = down * np.tan(ANGLES)
            down = bottom_m(east + aside * np.cos(course), north - aside * np.sin(course)) - 2.0
        lon, lat = lon_lat(east + off[0], north + off[1])
        beams = {"angles_deg": np.degrees(ANGLES).tolist(), "ranges_m": (down / np.cos(ANGLES)).tolist()}
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "heading_deg": float(np.degrees(course)) % 360.0}
        items.append({"vehicle": vehicle, "time_s": time_s, "beams": beams} | place)
    return items


def ways() -> tuple[FloatArray, FloatArray]:
    first = flown([(east + 4, north + 2) for east, north in lawnmower(52, 56, 10)], spacing_m=1.5, start_s=START_S)
    second = flown([(north + 2, east + 5) for east, north in lawnmower(50, 56, 10)], spacing_m=1.5, start_s=START_S)
    return first, second


def drift_of(way: FloatArray) -> FloatArray:
    """How far off a vehicle takes itself to be along a way (n, 5), (n, 2): ever farther, to the south-east."""
    return np.linspace(0.0, 1.0, len(way))[:, None] * np.array([OFF_M, -0.5 * OFF_M])
