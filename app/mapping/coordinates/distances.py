"""Distances between places on the Earth, over a sphere: quick enough for every packet, right across 180 degrees."""

import math

import numpy as np

from app.arrays import FloatArray

EARTH_M = 6_371_000.0
"""The Earth's mean radius."""

METRES_PER_DEGREE = EARTH_M * math.pi / 180.0
"""Of latitude; good to 0.6 %."""


def horizontal_distance_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return how far two places (latitude, longitude, degrees) are from each other; good to 0.6 %, depth not counted.

    The haversine formula: true for neighbours and antipodes alike.
    """
    lat, other_lat = math.radians(a[0]), math.radians(b[0])
    half_north, half_east = 0.5 * (other_lat - lat), math.radians(0.5 * (b[1] - a[1]))
    part = math.sin(half_north) ** 2 + math.cos(lat) * math.cos(other_lat) * math.sin(half_east) ** 2
    return 2.0 * EARTH_M * math.asin(min(1.0, math.sqrt(part)))


def leg_lengths_m(lat_deg: FloatArray, lon_deg: FloatArray) -> FloatArray:
    """Return the distances (n - 1,) between each of a way's places (n,) and the next, as `horizontal_distance_m`."""
    lat = np.radians(lat_deg)
    half_north, half_east = 0.5 * np.diff(lat), np.radians(0.5 * np.diff(lon_deg))
    part = np.sin(half_north) ** 2 + np.cos(lat[:-1]) * np.cos(lat[1:]) * np.sin(half_east) ** 2
    return np.asarray(2.0 * EARTH_M * np.arcsin(np.sqrt(np.minimum(part, 1.0))))
