"""A map's cells on the grid of a UTM zone: what knows no frame of a mission's own."""

from dataclasses import dataclass

import numpy as np
import pyproj

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.types import BathymetricMap, Grid

NORTH_END_DEG, SOUTH_END_DEG = 84.0, -80.0
"""Nearer to the poles there are no zones, but the universal polar stereographic projection."""

WIDER_ZONES = (
    (56.0, 64.0, 3.0, 12.0, 32),
    (72.0, 84.0, 0.0, 9.0, 31),
    (72.0, 84.0, 9.0, 21.0, 33),
    (72.0, 84.0, 21.0, 33.0, 35),
    (72.0, 84.0, 33.0, 42.0, 37),
)
"""South, north, west and east end, and number, of the zones off Norway and about Svalbard that are not of 6 degrees."""


@dataclass(frozen=True)
class UtmCells:
    """Cells of a map that were taken to a UTM zone.

    Attributes
    ----------
    epsg
        The zone, or universal polar stereographic, of WGS 84.
    grid
        In its eastings and northings; its lines are whole multiples of the cell.
    source : (rows, cols)
        The number of the map's cell, row by row, that each cell has its values of; -1 without one.
    """

    epsg: int
    grid: Grid
    source: IntArray

    @property
    def filled(self) -> BoolArray:
        """Which cells have values, (rows, cols)."""
        return np.asarray(self.source >= 0)

    def of(self, layer: FloatArray | IntArray | BoolArray, fill: float) -> FloatArray:
        """Return a layer of the map, (rows, cols) of the map, on this grid."""
        return np.where(self.filled, layer.ravel()[np.maximum(self.source, 0)], fill)


def utm_epsg(lat_deg: float, lon_deg: float) -> int:
    """Return the EPSG code of the UTM zone of a place, or of universal polar stereographic, WGS 84."""
    if lat_deg > NORTH_END_DEG:
        return 5041
    if lat_deg < SOUTH_END_DEG:
        return 5042
    usual = int((lon_deg + 180.0) // 6.0) % 60 + 1
    wider = (
        zone for south, north, west, east, zone in WIDER_ZONES if south <= lat_deg < north and west <= lon_deg < east
    )
    zone = next(wider, usual)
    return (32600 if lat_deg >= 0.0 else 32700) + zone


def utm_cells(bathymetry: BathymetricMap, frame: LocalFrame, keep: BoolArray) -> UtmCells:
    """Return the cells to ``keep``, (rows, cols), on a grid of the same cell, two by two at least.

    Each cell has the values of the map's cell that its centre lies in. The two grids are turned and stretched against
    each other, which leaves some of the map's cells out: they replace a deeper one, so that no shoal is lost.

    Raises
    ------
    ValueError
        When there is nothing to keep.
    """
    if not keep.any():
        raise ValueError("no cell of the map was sounded")
    grid, cell = bathymetry.grid, bathymetry.grid.cell_m
    rows, cols = np.nonzero(keep)
    lat, lon = frame.to_geographic(grid.east_m[cols].mean(), grid.north_m[rows].mean())
    epsg = utm_epsg(float(lat), float(lon))
    transformer = pyproj.Transformer.from_crs(frame.crs, epsg, always_xy=True)
    east, north = transformer.transform(grid.east_m[cols], grid.north_m[rows])
    first_col, first_row = int(np.floor(east.min() / cell)), int(np.floor(north.min() / cell))
    j, i = np.floor(east / cell).astype(np.int64) - first_col, np.floor(north / cell).astype(np.int64) - first_row
    found = Grid(first_col * cell, first_row * cell, cell, max(int(i.max()) + 1, 2), max(int(j.max()) + 1, 2))

    back = transformer.transform(*np.meshgrid(found.east_m, found.north_m), direction="INVERSE")
    col, row = (np.floor((at - low) / cell) for at, low in zip(back, (grid.west_m, grid.south_m), strict=True))
    on_map = (col >= 0) & (col < grid.cols) & (row >= 0) & (row < grid.rows)
    number = np.where(on_map, row * grid.cols + col, 0).astype(np.int64)
    source = np.where(on_map & keep.ravel()[number], number, -1)

    depth = bathymetry.depth_m.ravel()
    kept = np.flatnonzero(keep)
    shoal_last = np.argsort(-depth[kept])
    shoalest = np.full(source.shape, -1)
    shoalest[i[shoal_last], j[shoal_last]] = kept[shoal_last]
    shoaler = (shoalest >= 0) & ((source < 0) | (depth[shoalest] < depth[source]))
    return UtmCells(epsg, found, np.where(shoaler, shoalest, source))
