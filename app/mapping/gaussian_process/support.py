"""Where the soundings surround a place, so that what was learned between them holds; and where they do not.

A smooth kernel, chosen because it predicts well between soundings, is far too sure of the ground beyond them: it
continues every slope. There, and in the middle of holes wider than the survey's gaps, nothing speaks for it.
"""

import numpy as np

from app.arrays import FloatArray
from app.mapping.gaussian_process.calibration import gaps
from app.mapping.kriging.fields import Field, coarse_grid
from app.mapping.kriging.levels import TwoLevels
from app.mapping.kriging.neighbours import nearest

AROUND = 12
"""Merged soundings that tell whether a place is surrounded."""

ONE_SIDED = (0.65, 0.9)
"""Distance to the middle of these soundings over their mean distance: 0 in their midst, 1 far away from all. Up to the
first a place counts as surrounded, from the second on it does not."""

FAR = (2.5, 4.0)
"""The same for the distance to the nearest sounding, over its median in the rectangle around all soundings."""


def support(levels: TwoLevels, cell_m: float, margin_m: float) -> Field:
    """Return how far places are surrounded by soundings, 1 quite and 0 not at all, as a field of one quantity.

    Parameters
    ----------
    cell_m
        Of the field.
    margin_m
        How far it reaches beyond the soundings.
    """
    tree = levels.fine_tree
    grid = coarse_grid(tree.mins - margin_m, tree.maxes + margin_m, cell_m)
    at = grid.centres_m
    closest = nearest(tree, at, 1)[0][:, 0]
    distance, around = nearest(levels.coarse_tree, at, AROUND)
    middle = np.asarray(levels.coarse_tree.data)[around].mean(axis=1)
    one_sided = np.hypot(*(middle - at).T) / np.maximum(distance.mean(axis=1), 1e-9)
    usual = max(float(np.quantile(gaps(tree), 0.5)), 1e-9)
    weight = _falling(one_sided, *ONE_SIDED) * _falling(closest / usual, *FAR)
    return Field(grid, weight.reshape(1, grid.rows, grid.cols))


def _falling(x: FloatArray, high: float, low: float) -> FloatArray:
    """Return 1 up to ``high``, 0 from ``low`` on, a smooth step between."""
    t = np.clip((low - x) / (low - high), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
