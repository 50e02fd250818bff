"""Holidays: ground that a survey missed, as squares of empty cells, or empty cells in a row, as NOAA counts them."""

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import binary_opening, find_objects, label

from app.arrays import BoolArray
from app.mapping.types import Grid

LET_BE = 0.005
"""Share of an area that may go unseen in pieces that are no holidays: nobody goes back for a few single cells."""


@dataclass(frozen=True)
class Holiday:
    """One connected piece of missed ground.

    Attributes
    ----------
    east_m, north_m
        The middle of its cells.
    west_m, south_m, width_m, height_m
        The rectangle around it.
    area_m2
    cells
        Which cells of that rectangle it is made of, (rows, cols), row 0 south.
    """

    east_m: float
    north_m: float
    west_m: float
    south_m: float
    width_m: float
    height_m: float
    area_m2: float
    cells: BoolArray = field(repr=False, compare=False)


def side_of(coarsest_m: float, cell_m: float) -> int:
    """Return how many cells in a square make a holiday: three times the coarsest resolution that is allowed."""
    return max(1, int(np.floor(3.0 * coarsest_m / cell_m + 1e-9)))


def missed(ensonified: BoolArray, mask: BoolArray, side: int, *, in_a_row: bool = False) -> BoolArray:
    """Return which cells of the area, (rows, cols), belong to holidays.

    Full coverage misses squares of ``side`` cells without a sounding; detection of objects so many ``in_a_row`` along
    or across the grid. What lies outside of the area is not missed.
    """
    empty = mask & ~ensonified
    if in_a_row:
        along, across = np.ones((1, side), dtype=bool), np.ones((side, 1), dtype=bool)
        return np.asarray(binary_opening(empty, along) | binary_opening(empty, across))
    return np.asarray(binary_opening(empty, np.ones((side, side), dtype=bool)))


def gaps(ensonified: BoolArray, mask: BoolArray, side: int) -> BoolArray:
    """Return which cells of the area, (rows, cols), lie in pieces without a sounding that are as large as a holiday.

    However narrow: a strip of single cells is one, too, of as many as the smallest holiday has, ``side`` squared.
    """
    number, _ = label(mask & ~ensonified, np.ones((3, 3)))
    large = np.bincount(number.ravel()) >= side**2
    large[0] = False
    return np.asarray(large[number])


def holidays(ensonified: BoolArray, mask: BoolArray, grid: Grid, side: int, *, in_a_row: bool = False) -> list[Holiday]:
    """Return the holidays of a survey, largest first; cells belong together that touch, at corners too."""
    return pieces(missed(ensonified, mask, side, in_a_row=in_a_row), grid)


def pieces(cells: BoolArray, grid: Grid) -> list[Holiday]:
    """Return missed cells, (rows, cols), as holidays, largest first."""
    number, _ = label(cells, np.ones((3, 3)))
    found = []
    for k, (rows, cols) in enumerate(find_objects(number), start=1):
        own = number[rows, cols] == k
        i, j = np.nonzero(own)
        cell_m = grid.cell_m
        found.append(
            Holiday(
                east_m=grid.west_m + (cols.start + float(j.mean()) + 0.5) * cell_m,
                north_m=grid.south_m + (rows.start + float(i.mean()) + 0.5) * cell_m,
                west_m=grid.west_m + cols.start * cell_m,
                south_m=grid.south_m + rows.start * cell_m,
                width_m=(cols.stop - cols.start) * cell_m,
                height_m=(rows.stop - rows.start) * cell_m,
                area_m2=len(i) * cell_m**2,
                cells=own,
            )
        )
    return sorted(found, key=lambda holiday: (-holiday.area_m2, holiday.north_m, holiday.east_m))


def open_ground(ensonified: BoolArray, mask: BoolArray, side: int) -> BoolArray:
    """Return which cells a survey has still to see: holidays, and strips of two cells and more along the border.

    Smaller pieces are let be as long as all of them are less than ``LET_BE`` of the area; else the largest count, too.
    """
    empty = mask & ~ensonified
    outside = np.pad(empty | ~mask, side, constant_values=True)
    opened = binary_opening(outside, np.ones((side, side), dtype=bool))[side:-side, side:-side]
    opened &= binary_opening(empty, np.ones((min(side, 2),) * 2, dtype=bool))
    over = int((empty & ~opened).sum()) - int(LET_BE * mask.sum())
    return np.asarray(opened if over <= 0 else opened | _largest(empty & ~opened, over))


def _largest(cells: BoolArray, least: int) -> BoolArray:
    """Return the largest connected pieces of cells that are so many together."""
    number, count = label(cells, np.ones((3, 3)))
    sizes = np.bincount(number.ravel(), minlength=count + 1)[1:]
    order = np.argsort(-sizes, kind="stable")
    chosen = order[: int(np.searchsorted(np.cumsum(sizes[order]), least)) + 1]
    return np.asarray(np.isin(number, 1 + chosen))
