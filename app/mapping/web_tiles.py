"""Tiles of the Web Mercator pyramid (EPSG:3857) that web maps and GIS lay over each other, and the cells under them."""

import math
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.georeference import LocalFrame
from app.mapping.types import Grid

EARTH_RADIUS_M = 6_378_137.0
WORLD_M = 2.0 * math.pi * EARTH_RADIUS_M
"""Side of the square that the whole Earth is drawn into."""

MAX_ZOOM = 24
"""A pixel is less than a centimetre then."""

SIDE_PX = 256
"""Of a tile; at double resolution twice as many."""

NODE_PX = 16
"""Positions are computed so many pixels apart and interpolated between: the curvature within is far below a pixel."""

MARGIN_PX = 1
BESIDE_DEG = 0.1


@dataclass(frozen=True)
class WebTile:
    """A tile: column ``x`` from the antimeridian, row ``y`` from the north, of ``2**zoom`` each."""

    zoom: int
    x: int
    y: int

    def __post_init__(self) -> None:
        """Refuse a tile that there is none of. Raises ValueError."""
        if not 0 <= self.zoom <= MAX_ZOOM:
            raise ValueError(f"z is {self.zoom}; it must be from 0 to {MAX_ZOOM}")
        for name, number in (("x", self.x), ("y", self.y)):
            if not 0 <= number < 2**self.zoom:
                raise ValueError(f"{name} is {number}; at z {self.zoom} it must be from 0 to {2**self.zoom - 1}")

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north end in metres of EPSG:3857."""
        side = WORLD_M / 2**self.zoom
        west, north = self.x * side - WORLD_M / 2.0, WORLD_M / 2.0 - self.y * side
        return west, north - side, west + side, north


@dataclass(frozen=True)
class TileCells:
    """Which cells of a grid the pixels of a part of a tile show.

    Attributes
    ----------
    top, left
        The first row and column of the part in the tile; all other pixels are off the grid.
    source : (rows, cols)
        The number of the cell, row by row of the grid, under each pixel's middle, northern row first; -1 without one.
    """

    top: int
    left: int
    source: IntArray


def tile_cells(tile: WebTile, side_px: int, grid: Grid, frame: LocalFrame) -> TileCells | None:
    """Return the cells under the pixels of a tile of ``side_px`` by ``side_px``; None where it lies beside the grid."""
    west, _, east, north = tile.bounds_m
    pixel_m = (east - west) / side_px
    ends = geographic_bounds(grid, frame)
    (low_x, high_x), (low_y, high_y) = mercator(np.array(ends[0::2]), np.array(ends[1::2]))
    first_col = max(math.floor((low_x - west) / pixel_m) - MARGIN_PX, 0)
    last_col = min(math.ceil((high_x - west) / pixel_m) + MARGIN_PX, side_px)
    first_row = max(math.floor((north - high_y) / pixel_m) - MARGIN_PX, 0)
    last_row = min(math.ceil((north - low_y) / pixel_m) + MARGIN_PX, side_px)
    rows, cols = last_row - first_row, last_col - first_col
    if rows <= 0 or cols <= 0:
        return None
    down, over_down = _nodes(rows)
    across, over_across = _nodes(cols)
    lat, _ = geographic(np.zeros(len(down)), north - (first_row + down + 0.5) * pixel_m)
    _, lon = geographic(west + (first_col + across + 0.5) * pixel_m, np.zeros(len(across)))
    # A pixel may be as wide as a country: its middle is taken no farther away than the frame is meant for.
    lat = np.clip(lat, ends[0] - BESIDE_DEG, ends[2] + BESIDE_DEG)
    lon = np.clip(lon, ends[1] - BESIDE_DEG, ends[3] + BESIDE_DEG)
    place_east, place_north = frame.to_local(*np.meshgrid(lat, lon, indexing="ij"))
    col = np.floor((over_down @ place_east @ over_across.T - grid.west_m) / grid.cell_m).astype(np.int64)
    row = np.floor((over_down @ place_north @ over_across.T - grid.south_m) / grid.cell_m).astype(np.int64)
    on_grid = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)
    if not on_grid.any():
        return None
    return TileCells(first_row, first_col, np.where(on_grid, row * grid.cols + col, -1))


def _nodes(count: int) -> tuple[FloatArray, FloatArray]:
    """Return places among ``count`` pixels, and the weights (count, nodes) that interpolate all pixels between them."""
    nodes = np.linspace(0.0, count - 1.0, max(2, math.ceil(count / NODE_PX) + 1)) if count > 1 else np.zeros(1)
    pixels = np.arange(count, dtype=np.float64)
    weights = np.array([np.interp(pixels, nodes, unit) for unit in np.eye(len(nodes))])
    return nodes, np.ascontiguousarray(weights.T)


def geographic_bounds(grid: Grid, frame: LocalFrame) -> tuple[float, float, float, float]:
    """Return the south, west, north and east end of a grid, WGS 84 degrees."""
    along = np.linspace(0.0, 1.0, 9)
    east = grid.west_m + grid.cols * grid.cell_m * np.concatenate([along, along, 0 * along, 0 * along + 1])
    north = grid.south_m + grid.rows * grid.cell_m * np.concatenate([0 * along, 0 * along + 1, along, along])
    lat, lon = frame.to_geographic(east, north)
    return float(lat.min()), float(lon.min()), float(lat.max()), float(lon.max())


def mercator(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y in EPSG:3857, metres, of positions."""
    x = EARTH_RADIUS_M * np.radians(lon_deg)
    return x, EARTH_RADIUS_M * np.arctanh(np.sin(np.radians(lat_deg)))


def geographic(x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return latitude and longitude, degrees, of places in EPSG:3857."""
    return np.degrees(np.arctan(np.sinh(y_m / EARTH_RADIUS_M))), np.degrees(x_m / EARTH_RADIUS_M)


def pixel_cells(tile: WebTile, side_px: int, cell_m: float, lat_deg: float) -> float:
    """Return how many cells a pixel is wide."""
    return WORLD_M / float(2**tile.zoom) / side_px * math.cos(math.radians(lat_deg)) / cell_m


def finest_zoom(cell_m: float, lat_deg: float) -> int:
    """Return the zoom from which on a cell is at least four pixels wide: nothing more is to be seen beyond it."""
    pixel_m = cell_m / 4.0
    zoom = math.ceil(math.log2(WORLD_M * math.cos(math.radians(lat_deg)) / (SIDE_PX * pixel_m)))
    return min(max(zoom, 0), MAX_ZOOM)
