"""The sea floor as planners and the safety check see it: depth estimates on a raster that answers in constant time."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import FloatArray

MAX_CELLS_PER_SIDE = 128

LEG_CHECKS = 4
"""At so many points of a leg, evenly spaced up to its end, its height above the bottom is looked at."""

DEPTH_MARGIN_M = 1e-3
"""By how much more than the least height depths of travel are chosen."""

ROUNDING_M = 1e-9


@dataclass(frozen=True)
class Bottom:
    """Estimated depth of the sea floor on square cells; row 0 is south, column 0 is west.

    Attributes
    ----------
    west_m, south_m : float
        Outer corner of the south-western cell.
    cell_m : float
        Side of a cell.
    depth_m : (rows, cols)
        Depth, positive down; NaN where unknown. Outside the raster nothing is known.
    """

    west_m: float
    south_m: float
    cell_m: float
    depth_m: FloatArray

    @classmethod
    def unknown(cls) -> "Bottom":
        """Return a sea floor of which nothing is known."""
        return cls(0.0, 0.0, 1.0, np.full((1, 1), np.nan))

    @classmethod
    def from_landmarks(cls, xy_m: FloatArray, depth_m: FloatArray) -> "Bottom":
        """Give every cell the depth of the known landmark closest to it, within two landmark spacings.

        Parameters
        ----------
        xy_m : (n, 2)
            Landmark positions.
        depth_m : (n,)
            Depth estimates; NaN ones are left out.
        """
        known = np.isfinite(depth_m)
        if not known.any():
            return cls.unknown()
        low, high = xy_m.min(axis=0), xy_m.max(axis=0)
        extent = max(float((high - low).max()), 1e-9)
        spacing = max(float(np.sqrt(max(np.prod(high - low), 1e-18) / len(xy_m))), extent / MAX_CELLS_PER_SIDE)
        cols, rows = (int(k) for k in np.ceil((high - low) / spacing + 1e-9).astype(int) + 1)
        west, south = low - spacing / 2
        east, north = np.meshgrid(west + (np.arange(cols) + 0.5) * spacing, south + (np.arange(rows) + 0.5) * spacing)
        tree = cKDTree(xy_m[known], balanced_tree=False, compact_nodes=False)
        cells = np.column_stack([east.ravel(), north.ravel()])
        _, nearest = tree.query(cells, distance_upper_bound=np.nextafter(2 * spacing, np.inf))
        depth = np.append(depth_m[known], np.nan)[nearest]
        return cls(float(west), float(south), spacing, depth.reshape(rows, cols))

    def at(self, en_m: FloatArray) -> FloatArray:
        """Return depths at positions (..., 2); NaN where unknown."""
        col = np.floor((en_m[..., 0] - self.west_m) / self.cell_m)
        row = np.floor((en_m[..., 1] - self.south_m) / self.cell_m)
        rows, cols = self.depth_m.shape
        known = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
        safe_row = np.where(known, row, 0).astype(int)
        safe_col = np.where(known, col, 0).astype(int)
        return np.where(known, self.depth_m[safe_row, safe_col], np.nan)

    def deepest_end_m(
        self, origin: FloatArray, leg_m: FloatArray, min_altitude_m: float, climb: float = 0.0
    ) -> FloatArray:
        """Return how deep legs may end for vehicles to keep their height above the bottom; inf where it is unknown.

        A vehicle is taken to change its depth evenly along the leg, or to rise as steeply as it can from the beginning.

        Parameters
        ----------
        origin : (..., 3)
            Where legs begin, with the depth there.
        leg_m : (..., 2)
            Ways east and north.
        climb
            Metres a metre that it rises where it ends less deep than it begins; 0: evenly.
        """
        deepest = np.full(leg_m.shape[:-1], np.inf)
        length_m = np.hypot(leg_m[..., 0], leg_m[..., 1])
        for k in range(1, LEG_CHECKS + 1):
            part = k / LEG_CHECKS
            room = self.at(origin[..., :2] + part * leg_m) - min_altitude_m - DEPTH_MARGIN_M
            rising = (room - (1.0 - part) * origin[..., 2]) / part
            clears = origin[..., 2] - climb * part * length_m <= room + DEPTH_MARGIN_M + ROUNDING_M
            rising = np.where(clears, room, rising)
            deepest = np.fmin(deepest, np.fmin(room, rising))
        return deepest

    def deepest_to_leave_m(self, en_m: FloatArray, min_altitude_m: float, climb: float, reach_m: float) -> float:
        """Return how deep a vehicle may be at a place (2,) to rise over whatever is known within so many metres.

        Parameters
        ----------
        climb
            Metres a metre that it rises.
        """
        rows, cols = self.depth_m.shape
        low = np.floor((en_m - reach_m - [self.west_m, self.south_m]) / self.cell_m).astype(int)
        high = np.floor((en_m + reach_m - [self.west_m, self.south_m]) / self.cell_m).astype(int) + 1
        col = np.arange(max(low[0], 0), min(high[0], cols))
        row = np.arange(max(low[1], 0), min(high[1], rows))
        if not len(col) or not len(row):
            return np.inf
        # A cell is as far as the nearest place in it.
        aside_m, above_m = (
            np.maximum(np.abs(first + (index + 0.5) * self.cell_m - at) - 0.5 * self.cell_m, 0.0)
            for first, index, at in ((self.west_m, col, en_m[0]), (self.south_m, row, en_m[1]))
        )
        away_m = np.hypot(above_m[:, None], aside_m[None])
        depth_m = self.depth_m[row[0] : row[-1] + 1, col[0] : col[-1] + 1]
        deepest_m = np.where((away_m <= reach_m) & np.isfinite(depth_m), depth_m + climb * away_m, np.inf)
        return float(deepest_m.min() - min_altitude_m)
