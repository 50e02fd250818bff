"""Landmarks that vehicles came to without seeing them.

An estimate may be wrong, above all of a landmark whose whole position is estimated from few ranges, and the sea floor
may hide what should be in sight. A planner that goes by estimates would stay there for good, since nothing changes.
"""

from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.problem import Belief

MOST = 3
"""Steps in sight of where a landmark is estimated, with nothing learnt of it, after which it is set aside. A step in
which a vehicle that headed for it is there counts twice."""

WITHIN = 0.9
"""An estimate closer than this part of the distance of sight should have shown the landmark."""


class MissedLandmarks:
    """Counts the steps in which a landmark should have been seen and nothing was learnt of it."""

    def __init__(self) -> None:
        self._sd_m = np.zeros(0)
        self._missed: IntArray = np.zeros(0, dtype=np.int64)

    def update(self, belief: Belief, points: FloatArray, positions: FloatArray, visibility: float) -> None:
        """Take in what a step has shown; whatever was learnt of a landmark makes good all that was missed before.

        Parameters
        ----------
        points : (n, 3)
            Where the landmarks are estimated, or presumed.
        positions : (n_vehicles, 3)
            Where the vehicles are.
        visibility : float
            Distance within which a landmark is seen.
        """
        if len(self._sd_m) != len(belief.sd_m):
            self._sd_m, self._missed = np.full(len(points), np.nan), np.zeros(len(points), dtype=np.int64)
        same = belief.sd_m == self._sd_m
        if belief.covariance_m2 is not None:  # unseen ones are presumed elsewhere each time
            same &= np.isfinite(belief.sd_m)
        squared = ((points - positions[:, None]) ** 2).sum(axis=2).min(axis=0)
        self._missed = np.where(same, self._missed + (squared < (WITHIN * visibility) ** 2), 0)
        self._sd_m = belief.sd_m.copy()

    def count(self, rows: IntArray) -> None:
        """Count landmarks as missed once more, (k,): a vehicle that headed for them is where they are estimated."""
        self._missed[rows] += 1

    def forget(self) -> None:
        """Look for all of them again."""
        self._missed[:] = 0

    @property
    def set_aside(self) -> BoolArray:
        """Which landmarks were missed too often, (n,)."""
        return np.asarray(self._missed >= MOST, dtype=np.bool_)

    def remember(self) -> dict[str, Any]:
        """Return the memory as plain values."""
        return {
            "missed": self._missed.tolist(),
            "sd": [float(x) if np.isfinite(x) else None for x in self._sd_m],
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._missed = np.array(state["missed"], dtype=np.int64)
        self._sd_m = np.array([np.inf if x is None else x for x in state["sd"]], dtype=np.float64)
