"""A sea floor: depths on a regular grid, and how to ask for the depth anywhere between its nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from simulator.arrays import FloatArray
from simulator.geodesy import LEIXOES_LAT_DEG, LEIXOES_LON_DEG, LocalFrame


class TerrainError(ValueError):
    """A terrain that cannot be used; the message names file, field, value and what would be right."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """Depths of a sea floor on square cells.

    The local frame starts at the outer south-west corner of the grid; values sit at cell centres, so the
    value of row r, column c belongs to east ``(c + 0.5) cell_m``, north ``(r + 0.5) cell_m``.

    Attributes
    ----------
    z_m
        Depths in metres, positive down, shape (rows, cols); row 0 is south, column 0 is west; NaN is unknown.
    cell_m
        Side of a cell in metres.
    origin_lat_deg, origin_lon_deg
        WGS84 position of the south-west corner, None where the terrain is nowhere in particular.
    name
        Where it came from, for messages.
    """

    z_m: FloatArray
    cell_m: float
    origin_lat_deg: float | None = None
    origin_lon_deg: float | None = None
    name: str = field(default="terrain")

    def __post_init__(self) -> None:
        z = np.array(self.z_m, dtype=np.float64)
        if z.ndim != 2 or min(z.shape) < 2:
            raise TerrainError(f"{self.name}: z has shape {z.shape}; it must be 2-D with at least 2 x 2 cells")
        if np.isinf(z).any():
            raise TerrainError(f"{self.name}: z holds infinite values; unknown cells must be NaN")
        if not np.isfinite(z).any():
            raise TerrainError(f"{self.name}: z holds no known depth; at least one cell must be finite")
        if not (math.isfinite(self.cell_m) and self.cell_m > 0.0):
            raise TerrainError(f"{self.name}: cell_m is {self.cell_m}; it must be a positive number of metres")
        if (self.origin_lat_deg is None) != (self.origin_lon_deg is None):
            raise TerrainError(
                f"{self.name}: origin_lat is {self.origin_lat_deg} and origin_lon is {self.origin_lon_deg}; "
                "give both or neither"
            )
        if self.origin_lat_deg is not None and not -90.0 <= self.origin_lat_deg <= 90.0:
            raise TerrainError(f"{self.name}: origin_lat is {self.origin_lat_deg}; it must be -90 to 90 degrees")
        if self.origin_lon_deg is not None and not -180.0 <= self.origin_lon_deg <= 180.0:
            raise TerrainError(f"{self.name}: origin_lon is {self.origin_lon_deg}; it must be -180 to 180 degrees")
        z.setflags(write=False)
        object.__setattr__(self, "z_m", z)
        object.__setattr__(self, "cell_m", float(self.cell_m))

    @property
    def rows(self) -> int:
        """Cells from south to north."""
        return int(self.z_m.shape[0])

    @property
    def cols(self) -> int:
        """Cells from west to east."""
        return int(self.z_m.shape[1])

    @property
    def width_m(self) -> float:
        """Extent from west to east, metres."""
        return self.cols * self.cell_m

    @property
    def height_m(self) -> float:
        """Extent from south to north, metres."""
        return self.rows * self.cell_m

    @cached_property
    def min_depth_m(self) -> float:
        """The shallowest known depth."""
        return float(np.nanmin(self.z_m))

    @cached_property
    def max_depth_m(self) -> float:
        """The deepest known depth."""
        return float(np.nanmax(self.z_m))

    @cached_property
    def frame(self) -> LocalFrame:
        """The geographic frame of the terrain; Leixões harbour where it has no place of its own."""
        if self.origin_lat_deg is None or self.origin_lon_deg is None:
            return LocalFrame(LEIXOES_LAT_DEG, LEIXOES_LON_DEG)
        return LocalFrame(self.origin_lat_deg, self.origin_lon_deg)

    def placed_at(self, lat_deg: float, lon_deg: float) -> Terrain:
        """The same sea floor with its south-west corner at another place."""
        return replace(self, origin_lat_deg=lat_deg, origin_lon_deg=lon_deg)

    def contains(self, east_m: float, north_m: float) -> bool:
        """Whether a position lies on the grid's rectangle (border included)."""
        return 0.0 <= east_m <= self.width_m and 0.0 <= north_m <= self.height_m

    def depth_at(self, east_m: ArrayLike, north_m: ArrayLike) -> FloatArray:
        """Depth by bilinear interpolation between cell centres.

        In the outer half cell the border's value is continued. NaN outside the rectangle and wherever an
        unknown cell would take part.

        Parameters
        ----------
        east_m, north_m
            Positions in the local frame, broadcast against each other.

        Returns
        -------
        Depths in metres, positive down, of the broadcast shape.
        """
        east, north = np.broadcast_arrays(np.asarray(east_m, dtype=float), np.asarray(north_m, dtype=float))
        inside = (east >= 0.0) & (east <= self.width_m) & (north >= 0.0) & (north <= self.height_m)
        x = np.clip(np.where(inside, east, 0.0) / self.cell_m - 0.5, 0.0, self.cols - 1.0)
        y = np.clip(np.where(inside, north, 0.0) / self.cell_m - 0.5, 0.0, self.rows - 1.0)
        j = np.minimum(x.astype(np.intp), self.cols - 2)
        i = np.minimum(y.astype(np.intp), self.rows - 2)
        u = x - j
        v = y - i
        depth = np.zeros(east.shape)
        for di, wy in ((0, 1.0 - v), (1, v)):
            for dj, wx in ((0, 1.0 - u), (1, u)):
                weight = wx * wy
                # A corner without weight must not spread its NaN.
                depth += np.where(weight > 0.0, weight * self.z_m[i + di, j + dj], 0.0)
        return np.where(inside, depth, np.nan)

    def depth_at_point(self, east_m: float, north_m: float) -> float:
        """The same as :meth:`depth_at` for one position, without numpy's overhead per call."""
        rows, cols = self.z_m.shape
        if not (0.0 <= east_m <= cols * self.cell_m and 0.0 <= north_m <= rows * self.cell_m):
            return math.nan
        last_col, last_row = cols - 1, rows - 1
        x = min(max(east_m / self.cell_m - 0.5, 0.0), float(last_col))
        y = min(max(north_m / self.cell_m - 0.5, 0.0), float(last_row))
        j, i = int(x), int(y)
        if j == last_col:
            j -= 1
        if i == last_row:
            i -= 1
        u, v = x - j, y - i
        item, depth = self.z_m.item, 0.0
        # A corner without weight must not spread its NaN.
        if v < 1.0:
            south = 1.0 - v
            if u < 1.0:
                depth += (1.0 - u) * south * item(i, j)
            if u > 0.0:
                depth += u * south * item(i, j + 1)
        if v > 0.0:
            if u < 1.0:
                depth += (1.0 - u) * v * item(i + 1, j)
            if u > 0.0:
                depth += u * v * item(i + 1, j + 1)
        return depth
