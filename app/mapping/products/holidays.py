"""What a swath survey missed, as GeoJSON."""

from collections.abc import Sequence

import numpy as np
import orjson

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.outlines import geographic_rings, outlines
from app.mapping.swath.holidays import Holiday


def holidays_geojson(found: Sequence[Holiday], cell_m: float, frame: LocalFrame, *, version: int) -> bytes:
    """Return a FeatureCollection (RFC 7946) with the outlines of holidays, numbered from 1 in their order.

    ``version`` is that of the map they were found in.
    """
    features = []
    for number, holiday in enumerate(found, start=1):
        parts = outlines(holiday.cells, holiday.west_m, holiday.south_m, cell_m)
        lat, lon = frame.to_geographic(np.array(holiday.east_m), np.array(holiday.north_m))
        features.append(
            {
                "type": "Feature",
                "properties": {
                    "number": number,
                    "area_m2": round(holiday.area_m2, 3),
                    "lat_deg": round(float(lat), 8),
                    "lon_deg": round(float(lon), 8),
                },
                "geometry": {
                    "type": "MultiPolygon",
                    "coordinates": [geographic_rings(part, frame) for part in parts],
                },
            }
        )
    return orjson.dumps({"type": "FeatureCollection", "version": version, "features": features})
