"""Nearest neighbours with the shapes and types that the rest of the package relies on."""

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray

MANY_PAIRS = 500_000
"""From so many pairs of places and neighbours on, all cores search."""


def nearest(tree: cKDTree, at: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
    """Distance to and number of the ``k`` nearest points (fewer where the tree has fewer), both (m, k)."""
    workers = -1 if len(at) * k > MANY_PAIRS else 1
    distance, index = tree.query(at, k=np.arange(1, min(k, tree.n) + 1), workers=workers)
    return np.asarray(distance, np.float64), np.asarray(index, np.int64)
