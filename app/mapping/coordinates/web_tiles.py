"""Tiles of the Web Mercator pyramid (EPSG:3857) that web maps and GIS lay over each other."""

import math
from dataclasses import dataclass

from app.mapping.coordinates.map_windows import EARTH_RADIUS_M, WEB_MERCATOR, MapWindow

WORLD_M = 2.0 * math.pi * EARTH_RADIUS_M
"""Side of the square that the whole Earth is drawn into."""

MAX_ZOOM = 24
"""A pixel is less than a centimetre then."""

SIDE_PX = 256
"""Of a tile; at double resolution twice as many."""


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

    def window(self, side_px: int) -> MapWindow:
        """Return it as so many pixels along each side."""
        return MapWindow(WEB_MERCATOR, *self.bounds_m, side_px, side_px)


def finest_zoom(cell_m: float, lat_deg: float) -> int:
    """Return the zoom from which on a cell is at least four pixels wide: nothing more is to be seen beyond it."""
    pixel_m = cell_m / 4.0
    zoom = math.ceil(math.log2(WORLD_M * math.cos(math.radians(lat_deg)) / (SIDE_PX * pixel_m)))
    return min(max(zoom, 0), MAX_ZOOM)
