"""What is left of the goal area: parts that are not explored, and how far they may be."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from app.arrays import BoolArray, FloatArray
from app.estimation import Cell
from app.exploration.site_search.scene import Scene

MOST_PARTS, LEAST_CELLS = 6, 3
"""So many parts, the largest ones, are told of, each of so many cells at least."""


class GoalPart(NamedTuple):
    """Unexplored cells of the goal area that hang together, if there may be a way to them.

    Attributes
    ----------
    cells : float
        How many.
    sweep_m : float
        How far a vehicle travels to see them, its scanner seeing a strip as wide as it reaches.
    way_m : (rows, cols)
        How far they may be from every cell, unexplored ones taken as free.
    home_m : float
        How far the entry may be from the nearest of them, in the same way.
    """

    cells: float
    sweep_m: float
    way_m: FloatArray
    home_m: float

    def halved(self) -> "GoalPart":
        """Return what is left of it for one vehicle more."""
        return self._replace(cells=0.5 * self.cells, sweep_m=0.5 * self.sweep_m)


def goal_left(scene: Scene) -> BoolArray:
    """Return the unexplored cells (rows, cols) of the goal area."""
    return np.asarray((scene.task.states == Cell.UNEXPLORED) & scene.task.in_goal)


def parts_left(scene: Scene) -> list[GoalPart]:
    """Return the parts that are left, the largest first."""
    task, ground = scene.task, scene.ground
    marks, _ = label(goal_left(scene), structure=np.ones((3, 3)))
    sizes = np.bincount(marks.ravel())
    sizes[0] = 0
    largest = [mark for mark in np.argsort(-sizes, kind="stable")[:MOST_PARTS] if sizes[mark] >= LEAST_CELLS]
    if not largest:
        return []
    entry = np.zeros(marks.shape, dtype=np.bool_)
    entry[tuple(ground.places(task.entry_m[None])[0])] = True
    home_m = ground.metres(ground.hoped(entry))
    parts = []
    for mark in largest:
        part = marks == mark
        if np.isfinite(home := float(home_m[part].min())):
            sweep_m = float(sizes[mark]) * task.grid.cell_m**2 / task.scanner.reach_m
            parts.append(GoalPart(float(sizes[mark]), sweep_m, ground.metres(ground.hoped(part)), home))
    return parts
