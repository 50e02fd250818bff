"""Rectangles of pixels anywhere on the Earth, in the systems of coordinates of GIS, and the cells below them.

Coordinates are *x* to the east and *y* to the north throughout, degrees or metres; whoever reads a request puts those
of systems whose first axis is the latitude in this order.
"""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pyproj

from app.arrays import FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.types import Grid

EARTH_RADIUS_M = 6_378_137.0
WGS84, WEB_MERCATOR = 4326, 3857
"""EPSG codes; any other one is of a system in metres that is true to scale, as those of UTM zones are."""

NODE_PX = 16
"""Positions are computed so many pixels apart and interpolated between: the curvature within is far below a pixel."""

MARGIN_PX = 1
BESIDE_DEG = 0.1

Transform = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Projection:
    """A system of coordinates.

    Attributes
    ----------
    to_plane
        Returns x and y of latitudes and longitudes, WGS 84 degrees.
    to_geographic
        Returns latitudes and longitudes of x and y; not finite where there are none.
    ground_m
        Returns how many metres of the ground a unit of x and a unit of y are at a latitude.
    """

    to_plane: Transform
    to_geographic: Transform
    ground_m: Callable[[float], tuple[float, float]]


@dataclass(frozen=True)
class MapWindow:
    """A rectangle of a system of coordinates, and the pixels that it is shown in."""

    epsg: int
    west: float
    south: float
    east: float
    north: float
    width_px: int
    height_px: int

    @property
    def pixels(self) -> int:
        """Return how many there are."""
        return self.width_px * self.height_px

    def part(self, top: int, rows: int) -> "MapWindow":
        """Return so many rows of pixels, the first of them at ``top``."""
        pixel = (self.north - self.south) / self.height_px
        north = self.north - top * pixel
        return replace(self, north=north, south=north - rows * pixel, height_px=rows)

    def place(self, column: int, row: int) -> tuple[float, float]:
        """Return latitude and longitude, degrees, of a pixel's middle; not finite where there is no such place."""
        x = self.west + (column + 0.5) * (self.east - self.west) / self.width_px
        y = self.north - (row + 0.5) * (self.north - self.south) / self.height_px
        lat, lon = projection(self.epsg).to_geographic(np.array([x]), np.array([y]))
        return float(lat[0]), float(lon[0])

    def bounds_deg(self) -> tuple[float, float, float, float]:
        """Return about its west, south, east and north end, WGS 84 degrees, as far as it lies on the Earth."""
        along = np.linspace(0.0, 1.0, 9)
        across, up = np.meshgrid(
            self.west + along * (self.east - self.west), self.south + along * (self.north - self.south)
        )
        lat, lon = projection(self.epsg).to_geographic(across, up)
        if not (np.isfinite(lat).all() and np.isfinite(lon).all()):
            return -180.0, -90.0, 180.0, 90.0
        return float(lon.min()), float(lat.min()), float(lon.max()), float(lat.max())


@dataclass(frozen=True)
class WindowCells:
    """Which cells of a grid the pixels of a part of a window show.

    Attributes
    ----------
    top, left
        The first row and column of the part in the window; all other pixels are off the grid.
    source : (rows, cols)
        The number of the cell, row by row of the grid, under each pixel's middle, northern row first; -1 without one.
    """

    top: int
    left: int
    source: IntArray


def window_cells(window: MapWindow, grid: Grid, frame: LocalFrame) -> WindowCells | None:
    """Return the cells under the pixels of a window; None where it lies beside the grid."""
    system = projection(window.epsg)
    lat, lon = _outline(grid, frame)
    x, y = system.to_plane(lat, lon)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None
    pixel_x = (window.east - window.west) / window.width_px
    pixel_y = (window.north - window.south) / window.height_px
    ends_x, ends_y = np.array([x.min(), x.max()]) - window.west, window.north - np.array([y.max(), y.min()])
    first_col, last_col = _span(ends_x / pixel_x, window.width_px)
    first_row, last_row = _span(ends_y / pixel_y, window.height_px)
    rows, cols = last_row - first_row, last_col - first_col
    if rows <= 0 or cols <= 0:
        return None
    down, over_down = _nodes(rows)
    across, over_across = _nodes(cols)
    node_x = window.west + (first_col + across + 0.5) * pixel_x
    node_y = window.north - (first_row + down + 0.5) * pixel_y
    node_lat, node_lon = system.to_geographic(*np.meshgrid(node_x, node_y))
    # A pixel may be as wide as a country: its middle is taken no farther away than the frame is meant for.
    node_lat = _clipped(node_lat, float(lat.min()), float(lat.max()))
    node_lon = _clipped(node_lon, float(lon.min()), float(lon.max()))
    place_east, place_north = frame.to_local(node_lat, node_lon)
    col = np.floor((over_down @ place_east @ over_across.T - grid.west_m) / grid.cell_m).astype(np.int64)
    row = np.floor((over_down @ place_north @ over_across.T - grid.south_m) / grid.cell_m).astype(np.int64)
    on_grid = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)
    if not on_grid.any():
        return None
    return WindowCells(first_row, first_col, np.where(on_grid, row * grid.cols + col, -1))


def _span(ends: FloatArray, count: int) -> tuple[int, int]:
    """Return the first and the one after the last of ``count`` pixels that lie between two ends, with a margin."""
    first, last = max(ends[0] - MARGIN_PX, 0.0), min(ends[1] + MARGIN_PX, float(count))
    return (math.floor(first), math.ceil(last)) if first < last else (0, 0)


def _clipped(degrees: FloatArray, low: float, high: float) -> FloatArray:
    return np.clip(np.nan_to_num(degrees, nan=math.inf), low - BESIDE_DEG, high + BESIDE_DEG)


def _nodes(count: int) -> tuple[FloatArray, FloatArray]:
    """Return places among ``count`` pixels, and the weights (count, nodes) that interpolate all pixels between them."""
    nodes = np.linspace(0.0, count - 1.0, max(2, math.ceil(count / NODE_PX) + 1)) if count > 1 else np.zeros(1)
    pixels = np.arange(count, dtype=np.float64)
    weights = np.array([np.interp(pixels, nodes, unit) for unit in np.eye(len(nodes))])
    return nodes, np.ascontiguousarray(weights.T)


def window_pixel_cells(window: MapWindow, cell_m: float, lat_deg: float) -> float:
    """Return how many cells a pixel is wide."""
    across_m, up_m = projection(window.epsg).ground_m(lat_deg)
    pixel_x = (window.east - window.west) / window.width_px
    pixel_y = (window.north - window.south) / window.height_px
    return math.sqrt(pixel_x * across_m) * math.sqrt(pixel_y * up_m) / cell_m


def geographic_bounds(grid: Grid, frame: LocalFrame) -> tuple[float, float, float, float]:
    """Return the south, west, north and east end of a grid, WGS 84 degrees."""
    lat, lon = _outline(grid, frame)
    return float(lat.min()), float(lon.min()), float(lat.max()), float(lon.max())


def _outline(grid: Grid, frame: LocalFrame) -> tuple[FloatArray, FloatArray]:
    """Return latitudes and longitudes of places all around a grid."""
    along = np.linspace(0.0, 1.0, 9)
    east = grid.west_m + grid.cols * grid.cell_m * np.concatenate([along, along, 0 * along, 0 * along + 1])
    north = grid.south_m + grid.rows * grid.cell_m * np.concatenate([0 * along, 0 * along + 1, along, along])
    return frame.to_geographic(east, north)


def mercator(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y in EPSG:3857, metres, of positions."""
    x = EARTH_RADIUS_M * np.radians(lon_deg)
    return x, EARTH_RADIUS_M * np.arctanh(np.sin(np.radians(lat_deg)))


def geographic(x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return latitude and longitude, degrees, of places in EPSG:3857."""
    # Beyond this there is nothing but the pole, and the sine would be too large.
    up = np.clip(y_m / EARTH_RADIUS_M, -700.0, 700.0)
    return np.degrees(np.arctan(np.sinh(up))), np.degrees(x_m / EARTH_RADIUS_M)


@cache
def _in_degrees() -> Projection:
    degree_m = math.radians(1.0) * EARTH_RADIUS_M
    return Projection(
        lambda lat, lon: (lon, lat),
        lambda x, y: (y, x),
        lambda lat_deg: (degree_m * math.cos(math.radians(lat_deg)), degree_m),
    )


@cache
def _in_mercator() -> Projection:
    def ground_m(lat_deg: float) -> tuple[float, float]:
        return math.cos(math.radians(lat_deg)), math.cos(math.radians(lat_deg))

    return Projection(mercator, geographic, ground_m)


_THREADS = threading.local()
"""A transformer must not be shared between threads."""


def _transformer(epsg: int) -> pyproj.Transformer:
    known: dict[int, pyproj.Transformer] = _THREADS.__dict__.setdefault("known", {})
    if epsg not in known:
        known[epsg] = pyproj.Transformer.from_crs("OGC:CRS84", f"EPSG:{epsg}", always_xy=True)
    return known[epsg]


@cache
def _in_metres(epsg: int) -> Projection:
    def to_plane(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y = _transformer(epsg).transform(lon_deg, lat_deg)
        return np.asarray(x, float), np.asarray(y, float)

    def to_geographic(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        lon, lat = _transformer(epsg).transform(x, y, direction=pyproj.enums.TransformDirection.INVERSE)
        return np.asarray(lat, float), np.asarray(lon, float)

    return Projection(to_plane, to_geographic, lambda _: (1.0, 1.0))


def projection(epsg: int) -> Projection:
    """Return the system of a code. Raises pyproj.exceptions.CRSError where there is none."""
    if epsg == WGS84:
        return _in_degrees()
    return _in_mercator() if epsg == WEB_MERCATOR else _in_metres(epsg)
