"""Lines of swath sonars beside keep-out zones: what can be seen from outside of them, and ways that lead round."""

from dataclasses import replace

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon

from app.arrays import FloatArray, IntArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import Coverage
from app.exploration.core.free_space import FreeSpace
from app.exploration.swath.raster import Flying

SAME_M = 0.01
"""Corners closer together are one."""


class BarredGround:
    """The cells that no vehicle may be over, and how far each is from where one may.

    Parameters
    ----------
    constraints
        Their zones, margins included, are what is barred.
    coverage
        The grid.
    """

    def __init__(self, constraints: Constraints, coverage: Coverage) -> None:
        rows, cols = coverage.wanted.shape
        self._grid = _grid_of(coverage)
        east_m, north_m = np.meshgrid(
            coverage.west_m + (np.arange(cols) + 0.5) * coverage.cell_m,
            coverage.south_m + (np.arange(rows) + 0.5) * coverage.cell_m,
        )
        barred = np.zeros((rows, cols), dtype=bool)
        for zone in constraints.keep_out:
            barred |= shapely.contains_xy(Polygon(zone), east_m, north_m)
        away_m = np.asarray(distance_transform_edt(barred)) * coverage.cell_m
        places: IntArray = np.argwhere(barred)
        self._at = places[:, 0], places[:, 1]
        self._away_m: FloatArray = away_m[barred]

    def is_of(self, coverage: Coverage) -> bool:
        """Return whether this is about the same grid."""
        return self._grid == _grid_of(coverage)

    def within_sight(self, coverage: Coverage, flying: Flying) -> Coverage:
        """Return what is left of the wanted ground without what cannot be seen from where a vehicle may be."""
        if not len(self._away_m):
            return coverage
        depth_m = coverage.depth_m[self._at]
        known = np.isfinite(depth_m)
        hidden = np.zeros(len(depth_m), dtype=bool)
        hidden[known] = self._away_m[known] > flying.half_width_m(depth_m[known])
        wanted = coverage.wanted.copy()
        wanted[self._at[0][hidden], self._at[1][hidden]] = False
        return replace(coverage, wanted=wanted)


def led_round(path: FloatArray, space: FreeSpace) -> FloatArray:
    """Return a path (k, 2) through free space: what lies outside is moved to its border, what it bars is gone round.

    It has a single vertex where nothing of it can be flown.
    """
    inside = np.array([space.nearest(corner) for corner in path])
    way = np.vstack([inside[:1], space.connect(inside[0], inside[1:])])
    return np.asarray(way[np.concatenate([[True], np.hypot(*np.diff(way, axis=0).T) > SAME_M])])


def _grid_of(coverage: Coverage) -> tuple[float, float, float, tuple[int, ...]]:
    return coverage.west_m, coverage.south_m, coverage.cell_m, coverage.wanted.shape
