"""How often lines were to see a cell in vain: what so many did not see is given up."""

import base64
import zlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.coverage import Coverage
from app.exploration.swath.raster import Flying, LineRaster

MOST_TRIES = 4
"""What so many lines were to see and did not is given up."""


def packed(counts: IntArray) -> list[Any]:
    """Return small counts (rows, cols) as what JSON takes, for ``unpacked``; what is more than 255 is 255."""
    bits = zlib.compress(np.minimum(counts, 255).astype(np.uint8).tobytes(), level=1)
    return [counts.shape, base64.b64encode(bits).decode()]


def unpacked(state: list[Any]) -> IntArray:
    """Return what was packed. Raises TypeError or ValueError when it is not that."""
    shape, text = state
    counts = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return counts.reshape(tuple(shape)).astype(np.int64)


def without(coverage: Coverage, cells: BoolArray | None) -> Coverage:
    """Return a coverage as if some cells (rows, cols) were done; on another grid than theirs it is left as it is."""
    if cells is None or cells.shape != coverage.done.shape:
        return coverage
    return replace(coverage, done=coverage.done | cells)


class Tries:
    """Counts of lines for each cell of the grid."""

    def __init__(self) -> None:
        self._counts: IntArray = np.zeros((0, 0), dtype=np.int64)

    def left(self, coverage: Coverage, under_way: Iterable[BoolArray] = ()) -> Coverage:
        """Return the same without what is given up; all begins anew on another grid.

        ``under_way``: what each line that is flown now was counted for, (rows, cols): it is no try in vain yet.
        """
        if self._counts.shape != coverage.wanted.shape:
            self._counts = np.zeros(coverage.wanted.shape, dtype=np.int64)
        ended = self._counts.copy()
        for cells in under_way:
            if cells.shape == ended.shape:
                ended -= cells
        return replace(coverage, done=coverage.done | (ended >= MOST_TRIES))

    def again(self, coverage: Coverage) -> Coverage:
        """Return the same with nothing left but what two lines were to see and did not."""
        return replace(coverage, done=coverage.done | (self._counts < 2))

    def count(
        self, path: FloatArray, flying: Flying, coverage: Coverage, raster: LineRaster, tries: int = 1
    ) -> BoolArray:
        """Note what a line (k, 2) that is begun is to see, what it leads over in any case; -1: it was not flown.

        Returns the cells (rows, cols) that this was noted for.
        """
        seen = raster.under(path, flying)
        turned = raster.axes.turned(path)
        seen[raster.columns_of(turned[:, 0]), raster.rows_of(turned[:, 1])] = True
        places = raster.axes.turned(coverage.places_m(coverage.left))
        inside = seen[raster.columns_of(places[:, 0]), raster.rows_of(places[:, 1])]
        rows, cols = np.nonzero(coverage.left)
        counted = np.zeros(coverage.left.shape, dtype=bool)
        counted[rows[inside], cols[inside]] = True
        self._counts[counted] = np.maximum(self._counts[counted] + tries, 0)
        return counted

    def remember(self) -> list[Any]:
        """Return the counts, for ``recall``."""
        return packed(self._counts)

    def recall(self, state: list[Any]) -> None:
        """Take up what ``remember`` returned. Raises TypeError or ValueError when it is not that."""
        self._counts = unpacked(state)
