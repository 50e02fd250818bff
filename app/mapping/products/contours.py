"""Depth contours as GeoJSON."""

import json
from typing import cast

import numpy as np
from contourpy import LineType, contour_generator

from app.mapping.georeference import LocalFrame
from app.mapping.types import BathymetricMap, FloatArray

MAX_LEVELS = 500


def contours_geojson(bathymetry: BathymetricMap, frame: LocalFrame, *, interval_m: float, vertical_datum: str) -> bytes:
    """Return a feature collection: one MultiLineString per depth with property ``depth_m``.

    Depths are the multiples of ``interval_m`` within the map.

    Raises
    ------
    ValueError
        When the interval is not positive, or so small that more than ``MAX_LEVELS`` contours would result.
    """
    if not interval_m > 0.0:
        raise ValueError(f"interval_m is {interval_m}; it must be positive")
    grid = bathymetry.grid
    known = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
    features = []
    if known.size and min(grid.rows, grid.cols) >= 2:
        first, last = np.ceil(known.min() / interval_m), np.floor(known.max() / interval_m)
        if last - first >= MAX_LEVELS:
            least = (known.max() - known.min()) / MAX_LEVELS
            raise ValueError(
                f"interval_m is {interval_m}, which would make more than {MAX_LEVELS} contours; "
                f"choose at least {least:.3g}"
            )
        generator = contour_generator(
            grid.east_m, grid.north_m, np.ma.masked_invalid(bathymetry.depth_m), line_type=LineType.Separate
        )
        for multiple in np.arange(first, last + 1.0):
            level = float(multiple * interval_m)
            lines = []
            for line in cast("list[FloatArray]", generator.lines(level)):
                if len(line) >= 2:
                    lat, lon = frame.to_geographic(line[:, 0], line[:, 1])
                    lines.append(np.round(np.column_stack([lon, lat]), 8).tolist())
            if lines:
                features.append(
                    {
                        "type": "Feature",
                        "properties": {"depth_m": round(level, 6), "vertical_datum": vertical_datum},
                        "geometry": {"type": "MultiLineString", "coordinates": lines},
                    }
                )
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()
