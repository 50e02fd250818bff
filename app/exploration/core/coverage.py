"""What a swath survey has to ensonify, and what it has."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation.swath import SwathSonar

MOST_CELLS = 300_000


@dataclass(frozen=True)
class Coverage:
    """Cells of a square grid, row 0 south and column 0 west; all arrays have shape (rows, cols).

    Attributes
    ----------
    west_m, south_m
        The grid's south-western corner in the local frame.
    cell_m
        Side of a cell.
    wanted
        Which cells are to be ensonified.
    done
        Which of them are.
    depth_m
        Depth of the bottom as far as it is known, of whatever source; NaN where it is not.
    """

    west_m: float
    south_m: float
    cell_m: float
    wanted: BoolArray
    done: BoolArray
    depth_m: FloatArray

    @property
    def left(self) -> BoolArray:
        """Which cells are still to be ensonified."""
        return np.asarray(self.wanted & ~self.done)

    def places_m(self, cells: BoolArray) -> FloatArray:
        """Return the centres (n, 2) of some cells, east and north."""
        rows, cols = np.nonzero(cells)
        return np.column_stack([self.west_m + (cols + 0.5) * self.cell_m, self.south_m + (rows + 0.5) * self.cell_m])

    def planned_on(self) -> "Coverage":
        """Return the coverage on as many cells as lines are planned on: neighbours are joined where there are more."""
        factor = int(np.ceil(np.sqrt(self.wanted.sum() / MOST_CELLS)))
        return self if factor <= 1 else self.coarser(factor)

    def coarser(self, factor: int) -> "Coverage":
        """Return the coverage on larger cells, by a factor: wanted where any is, done where all that are wanted are."""
        rows, cols = self.wanted.shape
        pad = ((0, -rows % factor), (0, -cols % factor))

        def blocks(values: np.ndarray, fill: float | bool) -> np.ndarray:
            padded = np.pad(values, pad, constant_values=fill)
            return padded.reshape(padded.shape[0] // factor, factor, -1, factor).swapaxes(1, 2)

        known = np.isfinite(self.depth_m)
        count = blocks(known, False).sum(axis=(2, 3))
        total = blocks(np.where(known, self.depth_m, 0.0), 0.0).sum(axis=(2, 3))
        return Coverage(
            self.west_m,
            self.south_m,
            factor * self.cell_m,
            np.asarray(blocks(self.wanted, False).any(axis=(2, 3))),
            np.asarray(~blocks(self.left, False).any(axis=(2, 3))),
            np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0),
        )


@dataclass(frozen=True)
class SwathTask:
    """What a swath survey is asked for.

    Attributes
    ----------
    coverage
        What there is to ensonify, and what was.
    sonars
        Of each vehicle by name; those without one ensonify nothing.
    overlap
        Share of half a swath that is sounded twice at least.
    altitudes_m
        Height above the bottom of the vehicles that keep one, by name; the others keep a depth.
    """

    coverage: Coverage
    sonars: Mapping[str, SwathSonar]
    overlap: float
    altitudes_m: Mapping[str, float] = field(default_factory=dict)
