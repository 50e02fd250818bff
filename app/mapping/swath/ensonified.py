"""How far a swath survey has come: what is ensonified, how densely, and what was missed."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label, maximum

from app.arrays import BoolArray, IntArray
from app.mapping.swath.density import LEAST_SOUNDINGS
from app.mapping.swath.gridded import area_of, is_of_swaths
from app.mapping.swath.holidays import Holiday, gaps, missed, pieces, side_of
from app.mapping.tiers import asked_of, by_depth
from app.mapping.types import BathymetricMap

FULL_DENSE_PCT = 95.0
"""Share of the area's cells that have to be dense for full coverage."""

AHEAD_OF_AREA, AHEAD_OF_HOLIDAYS = 0.02, 10
"""Missed ground beside the area's border that is larger than this share of the area, and than so many of the smallest
holidays, is still ahead: it is swept, not filled."""


@dataclass(frozen=True)
class Ensonified:
    """How far a swath survey has come.

    Attributes
    ----------
    ensonified_pct
        Share of the area's cells with a sounding.
    dense_pct
        Share of them with as many as full coverage asks for.
    holidays
        What was missed inside of what was swept, largest first.
    full_coverage
        Whether no piece of ground without a sounding has as many cells as the smallest holiday, whatever its shape, and
        the area is as dense as full coverage asks for.
    """

    ensonified_pct: float
    dense_pct: float
    holidays: tuple[Holiday, ...]
    full_coverage: bool


def ensonified(bathymetry: BathymetricMap, cell_of_depth: float | None = None) -> Ensonified | None:
    """Return how far the survey of a map has come; None where it is not one of swaths.

    With ``cell_of_depth`` each place is judged by the cell that its depth asks for.
    """
    if not is_of_swaths(bathymetry):
        return None
    area, cell_m = area_of(bathymetry), bathymetry.grid.cell_m
    cells = max(int(area.sum()), 1)
    asked = asked_of(bathymetry.depth_m, cell_m, cell_of_depth)
    own = np.where(bathymetry.sounded, bathymetry.count, 0)
    count = by_depth(own, area, asked, lambda count, _: count)
    side = side_of(cell_m, cell_m)
    gap = by_depth(own, area, asked, lambda count, mask: gaps(count > 0, mask, side)) > 0
    lost = by_depth(own, area, asked, lambda count, mask: missed(count > 0, mask, side)) > 0
    dense_pct = 100.0 * float((count >= LEAST_SOUNDINGS).sum()) / cells
    return Ensonified(
        100.0 * float((count > 0).sum()) / cells,
        dense_pct,
        tuple(pieces(lost & ~_ahead(lost, area, asked, side), bathymetry.grid)),
        full_coverage=dense_pct >= FULL_DENSE_PCT and not gap.any(),
    )


def _ahead(lost: BoolArray, area: BoolArray, asked: IntArray, side: int) -> BoolArray:
    """Return which missed cells are ground that nobody has come to yet; what is swept all around is none."""
    number, found = label(lost, np.ones((3, 3)))
    if not found:
        return lost
    sizes = np.bincount(number.ravel())[1:]
    smallest = side**2 * 4 ** maximum(asked, number, np.arange(1, found + 1))
    large = sizes > np.maximum(AHEAD_OF_AREA * float(area.sum()), AHEAD_OF_HOLIDAYS * smallest)
    # An island within the area leads out of it only where it reaches the border.
    outside, _ = label(np.pad(lost | ~area, 1, constant_values=True), np.ones((3, 3)))
    reached = np.unique(number[lost & (outside == outside[0, 0])[1:-1, 1:-1]])
    return np.asarray(np.isin(number, np.intersect1d(1 + np.flatnonzero(large), reached)))
