"""What it tells that landmarks were not seen from close by: they lie deeper than a vehicle there can see."""

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.exploration.core.problem import Belief

NEIGHBOURS = 4
"""Known landmarks that tell where one that was never seen is presumed."""

SLACK = 0.12
"""How much deeper than they must lie at least landmarks are presumed, in visibilities."""


def look_in_vain(
    least_m: FloatArray, belief: Belief, positions: FloatArray, visibility_m: float, deepest_m: float
) -> FloatArray:
    """Return the least depths (n_landmarks,) that landmarks never seen must have, after a look from ``positions``.

    A landmark out of sight of a vehicle that is close by lies below what it can see, or above, on a wall. It is taken
    to lie above where its known neighbours do.

    Parameters
    ----------
    least_m : (n_landmarks,)
        The same before; -inf where nothing is known.
    positions : (n_vehicles, 3)
        Where the vehicles are.
    deepest_m : float
        No landmark lies deeper.
    """
    unseen = np.flatnonzero(np.isnan(belief.depth_m))
    known = np.flatnonzero(~np.isnan(belief.depth_m))
    if not len(unseen) or not len(known):
        return least_m
    away2 = ((belief.xy_m[unseen, None] - positions[None, :, :2]) ** 2).sum(axis=2)
    limit = positions[:, 2] + np.sqrt(np.maximum(0.0, visibility_m**2 - away2))
    near = (away2 < visibility_m**2).any(axis=1)
    if not near.any():
        return least_m
    unseen, away2, limit = unseen[near], away2[near], limit[near]
    presumed = _presumed(belief, known, unseen)
    below = (away2 < visibility_m**2) & (presumed[:, None] > positions[:, 2]) & (limit < deepest_m)
    least = least_m.copy()
    least[unseen] = np.maximum(least[unseen], np.where(below, limit, -np.inf).max(axis=1))
    return least


def deeper_than_presumed(belief: Belief, least_m: FloatArray) -> FloatArray:
    """Return places and least depths (k, 3) of unseen landmarks that lie deeper than their known neighbours tell."""
    sought = np.flatnonzero(np.isnan(belief.depth_m) & np.isfinite(least_m))
    known = np.flatnonzero(~np.isnan(belief.depth_m))
    if not len(sought) or not len(known):
        return np.zeros((0, 3))
    deeper = sought[least_m[sought] > _presumed(belief, known, sought)]
    return np.column_stack([belief.xy_m[deeper], least_m[deeper]])


def _presumed(belief: Belief, known: IntArray, rows: IntArray) -> FloatArray:
    """Return the mean depth of the known neighbours of some landmarks, the closer ones counting more."""
    k = min(NEIGHBOURS, len(known))
    found = cKDTree(belief.xy_m[known]).query(belief.xy_m[rows], k=k)
    away, which = (np.asarray(part).reshape(len(rows), k) for part in found)
    weight = 1.0 / (away**2 + 1e-6)
    return np.asarray((weight * belief.depth_m[known][which]).sum(axis=1) / weight.sum(axis=1))
