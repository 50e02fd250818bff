"""Outlines of marked cells as polygons, and cells that polygons touch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from app.mapping.coordinates.georeference import LocalFrame


def outlines(marked: NDArray[np.bool_], west_m: float, south_m: float, cell_m: float) -> list[Polygon]:
    """Return the outlines of all groups of marked cells that share sides, with their holes.

    Parameters
    ----------
    marked : (rows, cols)
        Row 0 is south, column 0 west.
    west_m, south_m, cell_m
        Outer corner of the south-western cell, and a cell's side.
    """
    # Runs of cells in a row: far fewer than cells.
    edges = np.diff(np.pad(marked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges > 0)
    _, end = np.nonzero(edges < 0)
    south = south_m + cell_m * row
    runs = shapely.box(west_m + cell_m * first, south, west_m + cell_m * end, south + cell_m)
    # Runs of different lengths meet in the middle of each other's sides: such points are no corners.
    joined = shapely.simplify(shapely.union_all(runs), 0.0)
    return [part for part in shapely.get_parts(joined).tolist() if isinstance(part, Polygon)]


def geographic_rings(polygon: Polygon, frame: LocalFrame) -> list[list[Any]]:
    """Return a polygon's rings of [longitude, latitude], the outer one counter-clockwise, holes clockwise."""
    turned = polygon if polygon.exterior.is_ccw else polygon.reverse()
    rings = []
    for ring in (turned.exterior, *turned.interiors):
        east, north = np.asarray(ring.coords).T
        lat, lon = frame.to_geographic(east, north)
        rings.append(np.round(np.column_stack([lon, lat]), 8).tolist())
    return rings


def touched(shapes: Sequence[BaseGeometry], rows: int, cols: int, cell_m: float) -> NDArray[np.bool_]:
    """Return the cells (rows, cols) that any of the shapes touches; row 0 is south, the grid begins at the origin."""
    cells = np.zeros((rows, cols), dtype=np.bool_)
    for shape in shapes:
        west, south, east, north = np.array(shape.bounds) / cell_m
        if not np.isfinite([west, south, east, north]).all():
            continue  # nothing
        bottom, left = max(0, int(np.floor(south))), max(0, int(np.floor(west)))
        top, right = min(rows, int(np.floor(north)) + 1), min(cols, int(np.floor(east)) + 1)
        if top <= bottom or right <= left:
            continue  # beyond the grid
        row, col = np.mgrid[bottom:top, left:right]
        shapely.prepare(shape)
        boxes = shapely.box(cell_m * col, cell_m * row, cell_m * (col + 1), cell_m * (row + 1))
        cells[row, col] |= shapely.intersects(shape, boxes)
    return cells
