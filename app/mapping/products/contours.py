"""Depth contours, and as GeoJSON (KML: see ``kml``, DXF: ``dxf``)."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from contourpy import LineType, contour_generator

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame, ProjectedFrame
from app.mapping.types import BathymetricMap

MAX_LEVELS = 500
USUAL_LEVELS = 10
INTERVALS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)


@dataclass(frozen=True)
class Contour:
    """The lines of one depth, each of points: longitude and latitude, or metres to the east and to the north."""

    depth_m: float
    lines: list[list[tuple[float, float]]]


def usual_interval_m(depth_m: FloatArray) -> float:
    """Return the interval that makes about ten contours of a map's depths, of which one at least is known."""
    span = float(np.nanmax(depth_m) - np.nanmin(depth_m))
    return next((interval for interval in INTERVALS_M if span / interval <= USUAL_LEVELS), INTERVALS_M[-1])


def find_contours(bathymetry: BathymetricMap, frame: LocalFrame, interval_m: float) -> list[Contour]:
    """Return the contours at the multiples of ``interval_m`` within the map, shallow ones first, in degrees.

    Raises
    ------
    ValueError
        When the interval is not positive, or so small that more than ``MAX_LEVELS`` contours would result.
    """
    contours = []
    for depth_m, found in _traced(bathymetry, interval_m):
        lines = []
        for line in found:
            lat, lon = frame.to_geographic(line[:, 0], line[:, 1])
            lines.append(list(zip(np.round(lon, 8).tolist(), np.round(lat, 8).tolist(), strict=True)))
        contours.append(Contour(depth_m, lines))
    return contours


def contours_in_metres(bathymetry: BathymetricMap, frame: Frame, interval_m: float) -> list[Contour]:
    """Return the contours of a map of a mission's own frame in that one or another; see :func:`find_contours`."""
    contours = []
    for depth_m, found in _traced(bathymetry, interval_m):
        lines = []
        for line in found:
            x, y = frame.from_local(*line.T) if isinstance(frame, ProjectedFrame) else line.T
            lines.append(list(zip(x.tolist(), y.tolist(), strict=True)))
        contours.append(Contour(depth_m, lines))
    return contours


def _traced(bathymetry: BathymetricMap, interval_m: float) -> Iterator[tuple[float, list[FloatArray]]]:
    """Yield depths and their lines, each (n, 2) in the map's metres. Raises as :func:`find_contours`."""
    if not interval_m > 0.0:
        raise ValueError(f"interval_m is {interval_m}; it must be positive")
    grid = bathymetry.grid
    known = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
    if not known.size or min(grid.rows, grid.cols) < 2:
        return
    first, last = np.ceil(known.min() / interval_m), np.floor(known.max() / interval_m)
    if last - first >= MAX_LEVELS:
        least = (known.max() - known.min()) / MAX_LEVELS
        raise ValueError(
            f"interval_m is {interval_m}, which would make more than {MAX_LEVELS} contours; choose at least {least:.3g}"
        )
    generator = contour_generator(
        grid.east_m, grid.north_m, np.ma.masked_invalid(bathymetry.depth_m), line_type=LineType.Separate
    )
    for multiple in np.arange(first, last + 1.0):
        level = float(multiple * interval_m) + 0.0  # no minus before the datum's zero
        lines = [line for line in cast("list[FloatArray]", generator.lines(level)) if len(line) >= 2]
        if lines:
            yield round(level, 6), lines


def contours_geojson(contours: Sequence[Contour], *, vertical_datum: str) -> bytes:
    """Return a feature collection: one MultiLineString per depth with property ``depth_m``."""
    features = [
        {
            "type": "Feature",
            "properties": {"depth_m": contour.depth_m, "vertical_datum": vertical_datum},
            "geometry": {"type": "MultiLineString", "coordinates": contour.lines},
        }
        for contour in contours
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()
