"""Where landmarks that nobody has seen may be: spread evenly over what nobody has looked at yet.

MED13's cost needs the number of all landmarks (its footnote 3) but no place of an unseen one. A planner that thinks
ahead has to presume places; these are all that it may presume, because everything within sight of a vehicle is seen.
"""

import numpy as np
from numpy.typing import NDArray

from app.estimation.sensors import RangeSensor

FloatArray = NDArray[np.float64]

CELLS_PER_SIGHT = 5.0
FEWEST_CELLS = 4
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
        self._sides = sides
        self._flat = flat
        self._sensor = RangeSensor(WITHIN * sight_m)

    def look(self, positions: FloatArray, floor_m: FloatArray) -> None:
        """Note what the vehicles at ``positions`` (n_vehicles, 3) have looked at.

        ``floor_m`` (n_vehicles,) are the depths of the floor under them, where there is one.
        """
        for position, floor in zip(positions, floor_m, strict=True):
            middles = self.middles
            if self._flat:
                middles = np.column_stack([middles[:, :2], np.full(len(middles), floor)])
            self.looks += self._sensor.visible(position[None], middles)[0]

    def places(self, count: int) -> FloatArray:
        """Return ``count`` places (count, 3), as evenly as can be over the cells that were looked at least often."""
        rarest = np.flatnonzero(self.looks == self.looks.min())
        chosen = rarest[np.arange(count) * len(rarest) // max(count, 1)] if count < len(rarest) else rarest
        turns = -(-count // len(chosen))
        # Several in a cell lie along its diagonals, evenly and without any randomness.
        k = np.arange(turns)[:, None]
        offset = (np.hstack([0.5 + k * 0.7548776662, 0.5 + k * 0.5698402910, 0.5 + k * 0.3803]) % 1.0) - 0.5
        places = self.middles[chosen][None] + offset[:, None, :] * self._sides
        return np.asarray(places.reshape(-1, 3)[:count])
