"""By how much one set of depths is off from another, as by the difference of their vertical datums."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.mapping.cell_index import cell_numbers
from app.mapping.types import Grid, Soundings

FEWEST_CELLS = 10
"""Fewer cells that both know tell nothing."""

SIGNIFICANT_SD = 2.0
"""A difference of so many predicted deviations is none by chance. It is that of one cell: what a survey has wrong as a
whole, such as its tide, does not become less over many."""


@dataclass(frozen=True)
class Offset:
    """One set of depths minus another, in the cells that both know.

    Attributes
    ----------
    median_m
        Of the differences, positive where the first is deeper.
    predicted_m
        Median standard deviation of a difference by those of the depths, what soundings of a cell have in common.
    """

    cells: int
    median_m: float
    predicted_m: float

    @property
    def is_significant(self) -> bool:
        """Whether the difference is more than the depths' deviations explain."""
        return self.cells >= FEWEST_CELLS and abs(self.median_m) > SIGNIFICANT_SD * self.predicted_m


def offset_between(grid: Grid, known: Soundings, other: Soundings) -> Offset | None:
    """Return by how much ``other`` is deeper than ``known``, cell by cell of a grid; None where no cell has both."""
    depths, deviations = zip(*(_means(grid, soundings) for soundings in (known, other)), strict=True)
    off = depths[1] - depths[0]
    both = np.isfinite(off)
    if not both.any():
        return None
    predicted = np.hypot(*deviations)[both]
    return Offset(int(both.sum()), float(np.median(off[both])), float(np.median(predicted)))


def _means(grid: Grid, soundings: Soundings) -> tuple[FloatArray, FloatArray]:
    """Return mean depth and root mean square deviation of each cell, (rows * cols,), NaN where there is none."""
    cells = cell_numbers(grid, soundings)
    inside, size = cells >= 0, grid.rows * grid.cols
    count = np.bincount(cells[inside], minlength=size)
    with np.errstate(invalid="ignore"):
        depth = np.bincount(cells[inside], soundings.depth_m[inside], size) / count
        deviation = np.sqrt(np.bincount(cells[inside], soundings.sd_m[inside] ** 2, size) / count)
    return depth, deviation
