"""Where the local frame lies on the Earth: transverse Mercator about the mission's own origin."""

import math
import threading

import numpy as np
import pyproj
from numpy.typing import ArrayLike

from app.arrays import FloatArray

MAX_EXTENT_M = 200_000.0
"""Farther from the origin than this the flat frame is no longer meant to be used (scale error above 5e-4)."""


class LocalFrame:
    """East and north in metres about an origin, by transverse Mercator with scale 1 at the origin.

    Distances are true to 1e-6 within 9 km of the central meridian. One object may be used by several threads.

    Parameters
    ----------
    origin_lat_deg, origin_lon_deg
        The point that becomes (0, 0), WGS 84 degrees.

    Raises
    ------
    ValueError
        When the origin is not a finite latitude within [-90, 90] and longitude within [-180, 180].
    """

    axis_names = "east_m north_m"

    def __init__(self, origin_lat_deg: float, origin_lon_deg: float) -> None:
        if not -90.0 <= origin_lat_deg <= 90.0:
            raise ValueError(f"origin_lat_deg is {origin_lat_deg}; it must lie within [-90, 90]")
        if not -180.0 <= origin_lon_deg <= 180.0:
            raise ValueError(f"origin_lon_deg is {origin_lon_deg}; it must lie within [-180, 180]")
        self.origin_lat_deg = float(origin_lat_deg)
        self.origin_lon_deg = float(origin_lon_deg)
        self._crs = pyproj.CRS.from_proj4(
            f"+proj=tmerc +lat_0={self.origin_lat_deg!r} +lon_0={self.origin_lon_deg!r} +k=1 +x_0=0 +y_0=0"
            " +datum=WGS84 +units=m +no_defs"
        )
        self._threads = threading.local()

    def __repr__(self) -> str:
        return f"LocalFrame({self.origin_lat_deg!r}, {self.origin_lon_deg!r})"

    @property
    def crs(self) -> pyproj.CRS:
        """The frame's coordinate reference system, axes east and north."""
        return self._crs

    @property
    def statement(self) -> str:
        """What positions are in."""
        return f"transverse Mercator k=1, lat {self.origin_lat_deg!r} lon {self.origin_lon_deg!r}"

    @property
    def crs_wkt(self) -> str:
        """The frame's coordinate reference system as WKT 2."""
        return str(self._crs.to_wkt())

    @property
    def _transformer(self) -> pyproj.Transformer:
        # A Transformer must not be shared between threads, and making one costs milliseconds: one per thread.
        transformer = getattr(self._threads, "transformer", None)
        if transformer is None:
            transformer = pyproj.Transformer.from_crs("EPSG:4326", self._crs, always_xy=True)
            self._threads.transformer = transformer
        return transformer

    def to_local(self, lat_deg: ArrayLike | float, lon_deg: ArrayLike | float) -> tuple[FloatArray, FloatArray]:
        """Return ``(east_m, north_m)`` of WGS 84 positions, in the shape of the input (0-d for scalars).

        Raises
        ------
        ValueError
            When a position is not finite or lies farther than ``MAX_EXTENT_M`` from the origin.
        """
        if isinstance(lat_deg, float) and isinstance(lon_deg, float):
            # The same numbers in a quarter of the time: vehicles tell of single places all the time.
            x, y = self._transformer.transform(lon_deg, lat_deg)
            if math.hypot(x, y) <= MAX_EXTENT_M:
                return np.asarray(x, float), np.asarray(y, float)
        lat, lon = np.broadcast_arrays(np.asarray(lat_deg, float), np.asarray(lon_deg, float))
        east, north = self._transformer.transform(lon, lat)
        east, north = np.asarray(east, float), np.asarray(north, float)
        near = np.hypot(east, north) <= MAX_EXTENT_M
        if not np.all(near):
            i = np.unravel_index(int(np.argmin(near)), near.shape)
            raise ValueError(
                f"position ({lat[i]}, {lon[i]}) is not within {MAX_EXTENT_M / 1000:.0f} km of "
                f"({self.origin_lat_deg}, {self.origin_lon_deg}), where the map begins: "
                f"{self._advice(float(lat[i]), float(lon[i]))}"
            )
        return east, north

    def _advice(self, lat_deg: float, lon_deg: float) -> str:
        """Return in words what to give in place of a position that is far away."""
        if abs(lon_deg) <= 90.0:
            swapped = self._transformer.transform(lat_deg, lon_deg)
            if math.hypot(*swapped) <= MAX_EXTENT_M:
                return f"latitude and longitude look exchanged, give latitude {lon_deg} and longitude {lat_deg}"
        return "give a position near the map"

    def to_geographic(self, east_m: ArrayLike, north_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return ``(lat_deg, lon_deg)``, WGS 84, of local positions; the shapes are those of the input."""
        east, north = np.broadcast_arrays(np.asarray(east_m, float), np.asarray(north_m, float))
        lon, lat = self._transformer.transform(east, north, direction=pyproj.enums.TransformDirection.INVERSE)
        return np.asarray(lat, float), np.asarray(lon, float)

    def __reduce__(self) -> tuple[type["LocalFrame"], tuple[float, float]]:
        return type(self), (self.origin_lat_deg, self.origin_lon_deg)
