"""Coordinate reference systems that features can be had in (OGC API – Features, Part 2)."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyproj

from app.api.http.problems import ProblemError
from app.mapping.coordinates.utm import utm_epsg

CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
_EPSG = "http://www.opengis.net/def/crs/EPSG/0/"
WGS84, WEB_MERCATOR = f"{_EPSG}4326", f"{_EPSG}3857"

Box = tuple[float, float, float, float]
"""West, south, east and north, degrees of WGS 84."""

DEGREE_DIGITS, METRE_DIGITS = 8, 3
"""Decimals: about a millimetre."""

WHOLE_EARTH_DEG = 180.0


def offered(rings: Sequence[Sequence[tuple[float, float]]]) -> list[str]:
    """Return the systems for missions of these areas: their UTM zone is among them where all lie in one."""
    return [CRS84, WGS84, WEB_MERCATOR, *(f"{_EPSG}{zone}" for zone in common_zone(rings))]


def common_zone(rings: Sequence[Sequence[tuple[float, float]]]) -> list[int]:
    """Return the EPSG code of the UTM zone that areas lie in; none where that is more than one."""
    zones = {utm_epsg(lat, lon) for lon, lat in (np.mean(ring, axis=0).tolist() for ring in rings)}
    return list(zones) if len(zones) == 1 else []


def transformed(geometry: dict[str, Any], crs: str) -> dict[str, Any]:
    """Return a GeoJSON geometry in another system, its coordinates in the order of that system's axes."""
    if crs == CRS84:
        return geometry
    return geometry | {"coordinates": _moved(geometry["coordinates"], crs)}


def _moved(coordinates: Any, crs: str) -> Any:
    if isinstance(coordinates[0], list | tuple) and isinstance(coordinates[0][0], list | tuple):
        return [_moved(part, crs) for part in coordinates]
    places = np.atleast_2d(np.asarray(coordinates, dtype=np.float64))
    first, second = _to(crs).transform(places[:, 0], places[:, 1])
    moved = np.round(np.column_stack([first, second]), DEGREE_DIGITS if crs == WGS84 else METRE_DIGITS).tolist()
    return moved if isinstance(coordinates[0], list | tuple) else moved[0]


def boxes_of(numbers: Sequence[float], crs: str) -> list[Box]:
    """Return a bounding box in degrees, two of them where it lies across the antimeridian.

    Raises
    ------
    ProblemError
        When it is none.
    """
    if len(numbers) == 6:
        numbers = [numbers[i] for i in (0, 1, 3, 4)]
    first_low, second_low, first_high, second_high = numbers
    if crs == WGS84:  # latitude first
        first_low, second_low, first_high, second_high = second_low, first_low, second_high, first_high
    if second_low > second_high or (first_low > first_high and crs not in (CRS84, WGS84)):
        raise ProblemError(
            "invalid-parameter",
            "bbox ends before it begins",
            remedy="Give the lower corner first, then the upper one, in the order of the axes of bbox-crs",
        )
    if crs not in (CRS84, WGS84):
        ends = _from(crs).transform_bounds(first_low, second_low, first_high, second_high)
        if not all(map(math.isfinite, ends)):
            raise ProblemError("invalid-parameter", "bbox lies beyond bbox-crs", remedy="Give metres of that system")
        first_low, second_low, first_high, second_high = ends
    if first_low <= first_high:
        return [(first_low, second_low, first_high, second_high)]
    return [
        (first_low, second_low, WHOLE_EARTH_DEG, second_high),
        (-WHOLE_EARTH_DEG, second_low, first_high, second_high),
    ]


@lru_cache(maxsize=64)
def _to(crs: str) -> pyproj.Transformer:
    return pyproj.Transformer.from_crs("OGC:CRS84", f"EPSG:{crs.removeprefix(_EPSG)}")


@lru_cache(maxsize=64)
def _from(crs: str) -> pyproj.Transformer:
    return pyproj.Transformer.from_crs(f"EPSG:{crs.removeprefix(_EPSG)}", "OGC:CRS84", always_xy=True)
