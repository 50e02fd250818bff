"""An oracle that knows the truth and travels nowhere: what the same number of soundings could do at best, or nearly."""

import numpy as np
from scipy.ndimage import gaussian_filter

from app.arrays import FloatArray
from app.evaluation.survey.world import Log, terrain_grid
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.types import Soundings
from simulator.floors.terrain import Terrain

FIRST_PART = 0.3
ROUNDS = 10
LEARNS = 3
"""After so many rounds the map's hyperparameters are learned again."""
LEAST_APART = 0.5
"""Distance between soundings of one round, as a part of that of an even spread."""


def oracle_soundings(log: Log, terrain: Terrain, count: int, depth_m: float) -> Soundings:
    """Place ``count`` soundings, taken from ``depth_m`` below the surface, where the map made so far is wrong.

    A third is spread evenly. The rest goes, round by round, to where the squared error of the map, averaged over the
    surroundings that a sounding improves, is largest.
    """
    grid = terrain_grid(terrain)
    centres = grid.centres_m
    truth = terrain.depth_at(centres[:, 0], centres[:, 1])
    known = np.isfinite(truth)
    first = max(min(count, 4), int(FIRST_PART * count))
    _sound(log, spread_points(first, terrain), depth_m)
    left, process = count - first, GaussianProcessMap(claims=False)
    for k in range(ROUNDS):
        batch = left // (ROUNDS - k)
        left -= batch
        if batch == 0:
            continue
        squared = known.astype(np.float64)
        if len(log.soundings):
            estimate = process.fit(log.soundings, learn=k % LEARNS == 0).predict(grid)
            squared = np.where(known, (estimate.depth_m.ravel() - truth) ** 2, 0.0)
        apart = np.sqrt(known.sum() * grid.cell_m**2 / count)
        worth = gaussian_filter(squared.reshape(grid.rows, grid.cols), 0.5 * apart / grid.cell_m, mode="nearest")
        _sound(log, centres[_largest(worth.ravel() * known, centres, batch, LEAST_APART * apart)], depth_m)
    return log.soundings


def spread_points(count: int, terrain: Terrain) -> FloatArray:
    """Return points (count, 2) spread evenly over the terrain's rectangle (additive recurrence of low discrepancy)."""
    k = np.arange(1, count + 1)[:, None]
    unit = (0.5 + k * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    return np.asarray(unit * [terrain.width_m, terrain.height_m])


def _largest(worth: FloatArray, at_m: FloatArray, count: int, apart_m: float) -> list[int]:
    """Return the rows of the largest ``worth`` that keep ``apart_m``; when there are too few, the next ones closer."""
    chosen: list[int] = []
    remaining = list(np.argsort(-worth, kind="stable"))
    while len(chosen) < count and remaining:
        taken = np.zeros((0, 2))
        later = []
        for row in remaining:
            if len(chosen) == count:
                break
            if len(taken) and np.min(np.sum((taken - at_m[row]) ** 2, axis=1)) < apart_m**2:
                later.append(row)
                continue
            chosen.append(int(row))
            taken = np.vstack([taken, at_m[row]])
        remaining = later
        apart_m *= 0.5
    return chosen


def _sound(log: Log, en_m: FloatArray, depth_m: float) -> None:
    log.sound(np.column_stack([en_m, np.full(len(en_m), depth_m)]))
