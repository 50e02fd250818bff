"""Where unseen landmarks may be: spread evenly over ground that was not yet looked at.

MED13's cost needs the number of all landmarks (its footnote 3) but no place of an unseen one. A planner that thinks
ahead has to presume places; these are all that it may presume, because everything within sight of a vehicle is seen.
"""

import numpy as np

from app.arrays import FloatArray
from app.estimation.sensors import RangeSensor

CELLS_PER_SIGHT = 5.0
FEWEST_CELLS = 4
MISSED, MISSED_BESIDE = 0.1, 0.02
"""How likely a cell that was looked at was hidden all the same, and how likely where something was found in it."""

PASS = 10
"""So many further looks, about those of a vehicle that passes, find as large a part of what is left as the first."""

WITHIN = 0.9
"""A cell counts as looked at when its middle was this close, of the distance of sight."""


class Presumed:
    """Cells over a box, and how often each was looked at.

    Parameters
    ----------
    box_m : (2, 3)
        Lowest and highest east, north, depth of the landmarks.
    sight_m : float
        How far landmarks are seen.
    flat : bool
        Whether the landmarks lie on a floor of unknown depth; then the cells are columns.
    """

    def __init__(self, box_m: FloatArray, sight_m: float, *, flat: bool) -> None:
        low, high = box_m
        side = min(sight_m, float((high - low).max())) / CELLS_PER_SIGHT
        counts = np.maximum(FEWEST_CELLS, np.ceil((high - low) / side).astype(int))
        if flat:
            counts[2] = 1
        sides = (high - low) / counts
        axes = [low[k] + sides[k] * (np.arange(counts[k]) + 0.5) for k in range(3)]
        self.middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        self.looks = np.zeros(len(self.middles), dtype=np.int64)
        self._low, self._sides, self._counts = low, sides, counts
        self._flat = flat
        self._sensor = RangeSensor(WITHIN * sight_m)

    def look(self, positions: FloatArray, floor_m: FloatArray) -> None:
        """Note what the vehicles at ``positions`` (n_vehicles, 3) have looked at.

        ``floor_m`` (n_vehicles, n_cells) are the depths of the floor in the cells as presumed then, where there is one.
        """
        for position, floor in zip(positions, floor_m, strict=True):
            middles = np.column_stack([self.middles[:, :2], floor]) if self._flat else self.middles
            self.looks += self._sensor.visible(position[None], middles)[0]

    def places(self, count: int, seen_m: FloatArray) -> FloatArray:
        """Return ``count`` places (count, 3), evenly over the cells by how likely they hold unseen landmarks.

        ``seen_m`` (k, 3) are the estimates of those that were seen: a cell that was looked at and in which none was
        found may have been hidden, the more so the more there should be.
        """
        found = np.zeros(len(self.middles), dtype=np.bool_)
        if len(seen_m):
            index = np.floor((seen_m - self._low) / self._sides).astype(int)
            index[:, 2] = 0 if self._flat else index[:, 2]
            inside = ((index >= 0) & (index < self._counts)).all(axis=1)
            found[np.ravel_multi_index(tuple(index[inside].T), tuple(self._counts))] = True
        expected = (count + len(seen_m)) / len(self.middles)
        again = MISSED ** (np.maximum(self.looks - 1, 0) / PASS)
        missed = MISSED * again
        hidden = missed / (missed + (1.0 - missed) * np.exp(-expected))
        weight = np.where(self.looks == 0, 1.0, np.where(found, MISSED_BESIDE * again, hidden))
        share = np.cumsum(weight) / weight.sum()
        cell = np.searchsorted(share, (np.arange(count) + 0.5) / max(count, 1))
        # Several in a cell lie along its diagonals, evenly and without any randomness.
        turn = np.arange(count) - np.searchsorted(cell, cell)
        offset = (0.5 + turn[:, None] * np.array([0.7548776662, 0.5698402910, 0.3803])) % 1.0 - 0.5
        return np.asarray(self.middles[cell] + offset * self._sides)
