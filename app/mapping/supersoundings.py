"""Near-duplicate soundings merged into precision-weighted ones: dense tracks need no dense matrices."""

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.types import Soundings


def merge_soundings(soundings: Soundings, cell_m: float) -> tuple[Soundings, IntArray]:
    """Merge all soundings of one square of side ``cell_m`` into one.

    Position and depth are means weighted by precision (1 / sd^2), so that a plane stays a plane; the merged
    standard deviation is that of the weighted mean of independent soundings.

    Returns
    -------
    merged : Soundings
        Ordered by square (south-west to north-east), so the result does not depend on the order of the input.
    group : (n,)
        For each sounding the row of ``merged`` that it went into.
    """
    if len(soundings) == 0:
        return soundings, np.zeros(0, np.int64)
    # Squares are counted from a fixed corner of the data itself: the result moves with the data.
    col = np.floor((soundings.east_m - soundings.east_m.min()) / cell_m).astype(np.int64)
    row = np.floor((soundings.north_m - soundings.north_m.min()) / cell_m).astype(np.int64)
    _, group = np.unique(row * (col.max() + 1) + col, return_inverse=True)
    precision = 1.0 / soundings.sd_m**2
    total = np.bincount(group, precision)

    def mean(values: FloatArray) -> FloatArray:
        offset = values.min()  # keeps the weighted sums small, hence exact for constant values
        return np.asarray(offset + np.bincount(group, precision * (values - offset)) / total)

    merged = Soundings(
        east_m=mean(soundings.east_m),
        north_m=mean(soundings.north_m),
        depth_m=mean(soundings.depth_m),
        sd_m=1.0 / np.sqrt(total),
    )
    return merged, group.astype(np.int64)
