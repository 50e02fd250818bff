"""Distances between places on the ellipsoid."""

from __future__ import annotations

import math

from imcpy.coordinates import WGS84

Place = tuple[float, float]
"""Latitude and longitude, degrees."""


def offset_m(a: Place, b: Place) -> tuple[float, float]:
    """North and east from one place to another near it."""
    north, east, _ = _displacement_m(a, b)
    return north, east


def distance_m(a: Place, b: Place) -> float:
    """Metres between two places at the surface, in a straight line."""
    return math.hypot(*_displacement_m(a, b))


def _displacement_m(a: Place, b: Place) -> tuple[float, float, float]:
    """North, east and down in the frame of ``a``; beyond the horizon places lie far down."""
    north, east, down = WGS84.displacement(
        math.radians(a[0]), math.radians(a[1]), 0.0, math.radians(b[0]), math.radians(b[1]), 0.0
    )
    return float(north), float(east), float(down)
