"""Where altimeters lifted vehicles off the bottom: ranges cannot separate up from down, so walls are wrong."""

from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.core.problem import Situation

FELT_OF_STEP = 0.01
"""Of a step: by how much shallower than asked a vehicle must be to have been lifted."""


class FeltBottom:
    """Remembers what vehicles were asked and where they came to be instead.

    Attributes
    ----------
    points_m : (k, 3)
        East, north and depth of the bottom where vehicles were lifted.
    """

    def __init__(self) -> None:
        self.points_m = np.zeros((0, 3))
        self._asked: dict[str, list[float]] = {}

    def ask(self, vehicles: tuple[str, ...], positions: FloatArray) -> None:
        """Note where the vehicles are sent, (n_vehicles, 3)."""
        self._asked = {name: at.tolist() for name, at in zip(vehicles, positions, strict=True)}

    def feel(self, team: Situation) -> BoolArray:
        """Return which vehicles (n_vehicles,) were lifted since they were asked, and remember the bottom there."""
        asked = np.array([self._asked.get(name, at) for name, at in zip(team.vehicles, team.positions, strict=True)])
        lifted = asked[:, 2] - team.positions[:, 2] > FELT_OF_STEP * team.constraints.max_step_m
        felt = team.positions[lifted] + [0.0, 0.0, team.constraints.lowest_m]
        self.points_m = np.vstack([self.points_m, felt])
        return np.asarray(lifted, dtype=np.bool_)

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        return {"points": self.points_m, "asked": self._asked}

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self.points_m = np.array(state["points"], dtype=np.float64).reshape(-1, 3)
        self._asked = {str(k): [float(x) for x in v] for k, v in state["asked"].items()}
