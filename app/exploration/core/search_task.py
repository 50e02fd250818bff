"""What a search is about: the site as known now, the goal, the way out, and what is left of the time window."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.estimation.occupancy import Cell, OccupancyGrid, Scanner


@dataclass(frozen=True)
class SearchTask:
    """A search mission as planners see it. Positions are east and north in metres.

    Attributes
    ----------
    grid : OccupancyGrid
        The matrix M (ACCESS13 section IV-A).
    scanner : Scanner
        What every vehicle carries.
    goal_m, goal_radius_m : (2,), float
        The point G and the radius ``r_c`` of the goal area ``C_g``.
    entry_m : (2,)
        The point S where vehicles enter, and where they have to be when the time is up.
    transmitter_m, com_range_m : (2,), float
        The point H and the range ``C_r`` beyond which a vehicle is out of contact.
    safety_m : float
        ``d_r``: least distance between a vehicle and an obstacle's edge.
    step_m : float
        Length of a step while alpha is 1; a leg may be as long as the constraints allow.
    left_m : float
        How far each vehicle can still travel before the time is up.
    window_m : float
        The same when the mission began.
    spare_m : float
        How much more than ``safety_m`` legs keep where they can: real vehicles do not arrive at the very place.
    standing_m, apart_m : (k, 2), float
        Where vehicles are that take no part now, and how far legs keep from them.
    """

    grid: OccupancyGrid
    scanner: Scanner
    goal_m: FloatArray
    goal_radius_m: float
    entry_m: FloatArray
    transmitter_m: FloatArray
    com_range_m: float
    safety_m: float
    step_m: float
    left_m: float
    window_m: float
    spare_m: float = 0.0
    standing_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    apart_m: float = 0.0

    @cached_property
    def states(self) -> NDArray[np.uint8]:
        """The cells' states, (rows, cols)."""
        return self.grid.states

    @cached_property
    def in_goal(self) -> BoolArray:
        """Cells of the goal area ``C_g``, (rows, cols)."""
        grid, (rows, cols) = self.grid, self.grid.blueprint.shape
        east = grid.west_m + grid.cell_m * (np.arange(cols) + 0.5) - self.goal_m[0]
        north = grid.south_m + grid.cell_m * (np.arange(rows) + 0.5) - self.goal_m[1]
        return np.asarray(east**2 + north[:, None] ** 2 <= self.goal_radius_m**2)

    @cached_property
    def explored_part(self) -> float:
        """``F_1`` (eq. 1, 2, 5): explored and traversable cells over those that the blueprint leaves open."""
        return _part(self.states == Cell.EXPLORED, ~self.grid.blueprint)

    @cached_property
    def explored_goal_part(self) -> float:
        """``F_2`` (eq. 3, 4, 6): the same within the goal area."""
        return _part((self.states == Cell.EXPLORED) & self.in_goal, ~self.grid.blueprint & self.in_goal)


def _part(of: BoolArray, all_: BoolArray) -> float:
    return float(np.count_nonzero(of)) / max(1, int(np.count_nonzero(all_)))
