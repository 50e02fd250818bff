"""Outlines of marked cells as polygons."""

import numpy as np
from numpy.typing import NDArray
from rasterio.features import shapes
from rasterio.transform import from_origin
from shapely.geometry import Polygon


def outlines(marked: NDArray[np.bool_], west_m: float, south_m: float, cell_m: float) -> list[Polygon]:
    """Return the outlines of all groups of marked cells that share sides, with their holes.

    Parameters
    ----------
    marked : (rows, cols)
        Row 0 is south, column 0 west.
    west_m, south_m, cell_m
        Outer corner of the south-western cell, and a cell's side.
    """
    north_up = np.ascontiguousarray(marked[::-1]).astype(np.uint8)
    to_metres = from_origin(west_m, south_m + cell_m * marked.shape[0], cell_m, cell_m)
    found = shapes(north_up, mask=north_up > 0, connectivity=4, transform=to_metres)
    return [Polygon(geometry["coordinates"][0], geometry["coordinates"][1:]) for geometry, _ in found]
