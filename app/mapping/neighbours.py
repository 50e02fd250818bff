"""Nearest neighbours with the shapes and types that the rest of the package relies on."""

import numpy as np
from scipy.spatial import cKDTree

from app.mapping.types import FloatArray, IntArray


def nearest(tree: cKDTree, at: FloatArray, k: int) -> tuple[FloatArray, IntArray]:
    """Distance to and number of the ``k`` nearest points (fewer where the tree has fewer), both (m, k)."""
    distance, index = tree.query(at, k=np.arange(1, min(k, tree.n) + 1))
    return np.asarray(distance, np.float64), np.asarray(index, np.int64)
