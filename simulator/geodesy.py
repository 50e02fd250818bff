"""The local frame: metres east and north of a geographic origin."""

from __future__ import annotations

import math

import numpy as np
import pyproj
from numpy.typing import ArrayLike

from simulator.arrays import FloatArray

LEIXOES_LAT_DEG = 41.185
LEIXOES_LON_DEG = -8.705


class LocalFrame:
    """Transverse Mercator plane touching the ellipsoid at an origin (WGS84, scale 1 at the origin).

    Distances are true to better than 1 mm per km within 50 km of the origin.

    Parameters
    ----------
    lat_deg, lon_deg
        The origin, usually the south-west corner of a terrain.

    Raises
    ------
    ValueError
        When the origin is not a place on Earth.
    """

    def __init__(self, lat_deg: float = LEIXOES_LAT_DEG, lon_deg: float = LEIXOES_LON_DEG) -> None:
        if not (math.isfinite(lat_deg) and -90.0 <= lat_deg <= 90.0):
            raise ValueError(f"origin latitude {lat_deg} is not within -90 to 90 degrees")
        if not (math.isfinite(lon_deg) and -180.0 <= lon_deg <= 180.0):
            raise ValueError(f"origin longitude {lon_deg} is not within -180 to 180 degrees")
        self.lat_deg = float(lat_deg)
        self.lon_deg = float(lon_deg)
        self._proj = pyproj.Proj(self.definition)

    @property
    def definition(self) -> str:
        """The PROJ string of the frame."""
        return f"+proj=tmerc +lat_0={self.lat_deg!r} +lon_0={self.lon_deg!r} +k=1 +x_0=0 +y_0=0 +ellps=WGS84"

    def to_local(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """East and north (m) of one geographic position (degrees)."""
        east, north = self._proj(lon_deg, lat_deg)
        return float(east), float(north)

    def to_geodetic(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Latitude and longitude (degrees) of one local position."""
        lon, lat = self._proj(east_m, north_m, inverse=True)
        return float(lat), float(lon)

    def to_local_many(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """East and north (m), each of the inputs' shape."""
        east, north = self._proj(np.asarray(lon_deg, dtype=float), np.asarray(lat_deg, dtype=float))
        return np.asarray(east, dtype=float), np.asarray(north, dtype=float)
