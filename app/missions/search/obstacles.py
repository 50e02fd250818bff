"""The obstacles of a search as GeoJSON."""

import orjson

from app.estimation.occupancy import Cell
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.outlines import geographic_rings, outlines
from app.missions.search.state import Search


def obstacles_geojson(search: Search, frame: LocalFrame) -> bytes:
    """Return a FeatureCollection (RFC 7946) with the outlines of all obstacles, holes included.

    The property ``found`` is true of those that no plan showed, ``area_m2`` is what the cells cover.
    """
    grid, states = search.grid, search.grid.states
    features = [
        {
            "type": "Feature",
            "properties": {"found": cell is Cell.FOUND, "area_m2": round(polygon.area, 3)},
            "geometry": {"type": "Polygon", "coordinates": geographic_rings(polygon, frame)},
        }
        for cell in (Cell.KNOWN, Cell.FOUND)
        for polygon in outlines(states == cell, grid.west_m, grid.south_m, grid.cell_m)
    ]
    return orjson.dumps({"type": "FeatureCollection", "features": features})
