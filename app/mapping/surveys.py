"""What a thorough map of many soundings takes: outliers judged, the model learned, every cell predicted.

Numbers in, numbers out, so that it can be done anywhere.
"""

import copy

import numpy as np

from app.arrays import BoolArray
from app.mapping.gp import GaussianProcessMap
from app.mapping.outliers import flag_outliers
from app.mapping.types import BathymetricMap, Grid, SoundingRows, Soundings


def judged(
    rows: SoundingRows, trusted: BoolArray, model: GaussianProcessMap
) -> tuple[GaussianProcessMap, dict[int, str]]:
    """Return the model learned anew, and by their number the soundings that are outliers, each with the reason.

    Parameters
    ----------
    rows : (n, 4)
        East, north, depth, standard deviation.
    trusted : (n,)
        Those that are no outliers whatever their neighbours say.
    model
        As it was learned before, if it was.
    """
    soundings = Soundings.of_rows(rows)
    verdict = flag_outliers(soundings, hyperparameters=getattr(model, "stationary_hyperparameters_", None))
    reasons = {i: reason for i, reason in enumerate(verdict.reasons) if reason and not trusted[i]}
    used = np.ones(len(rows), dtype=bool)
    used[list(reasons)] = False
    return copy.copy(model).fit(soundings.take(used), learn=True).learned(), reasons


def mapped(
    rows: SoundingRows, model: GaussianProcessMap, grid: Grid, mask: BoolArray
) -> tuple[BathymetricMap, GaussianProcessMap]:
    """Return the map that soundings (n, 4) make, and its model, learned of them where nothing was learned before."""
    fitted = copy.copy(model).fit(Soundings.of_rows(rows), learn=False)
    return fitted.predict(grid, mask), fitted.learned()
