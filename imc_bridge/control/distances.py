"""Distances between places on the ellipsoid."""

from __future__ import annotations

import math

from imcpy.coordinates import WGS84

Place = tuple[float, float]
"""Latitude and longitude, degrees."""


def offset_m(a: Place, b: Place) -> tuple[float, float]:
    """North and east from one place to another."""
    north, east, _ = WGS84.displacement(
        math.radians(a[0]), math.radians(a[1]), 0.0, math.radians(b[0]), math.radians(b[1]), 0.0
    )
    return float(north), float(east)


def distance_m(a: Place, b: Place) -> float:
    """Metres between two places."""
    return math.hypot(*offset_m(a, b))
