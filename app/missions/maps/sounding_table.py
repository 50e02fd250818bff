"""Soundings in memory: columns that grow at their end."""

from typing import Self

import numpy as np

from app.arrays import FloatArray
from app.mapping.types import SoundingRows

GROWTH = 1.25
"""More room is made by this factor: a sounding is copied a few times, however many follow it."""

LEAST_ROOM = 1024


class SoundingTable:
    """Soundings in the order they came; each column lies together in memory, so that nothing is copied to use it.

    Parameters
    ----------
    room
        For so many there is room at once.
    """

    def __init__(self, room: int = 0) -> None:
        self._columns: FloatArray = np.empty((4, room))
        self.rows: SoundingRows = self._columns[:, :0].T
        """All so far, (n, 4): they stay as they are while more come, and other threads may read them."""

    @classmethod
    def of(cls, rows: SoundingRows) -> Self:
        """Return a table of these, (n, 4), without a copy where their columns lie together already."""
        table = cls()
        table._columns, table.rows = rows.T, rows
        return table

    def __len__(self) -> int:
        return len(self.rows)

    def extend(self, rows: SoundingRows) -> None:
        """Add rows, (k, 4)."""
        count = len(self)
        end = count + len(rows)
        if end > self._columns.shape[1]:
            room = np.empty((4, max(end, int(GROWTH * count), LEAST_ROOM)))
            room[:, :count] = self.rows.T
            self._columns = room
        self._columns[:, count:end] = rows.T
        self.rows = self._columns[:, :end].T
