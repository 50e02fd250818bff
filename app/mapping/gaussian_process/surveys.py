"""What a thorough map of many soundings takes: outliers judged, the model learned, every cell predicted.

Numbers in, numbers out, so that it can be done anywhere.
"""

import copy

import numpy as np

from app.arrays import BoolArray
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gross_errors.outliers import flag_outliers
from app.mapping.types import BathymetricMap, Grid, SoundingRows, Soundings


def judged(
    rows: SoundingRows,
    trusted: BoolArray,
    model: GaussianProcessMap,
    grid: Grid | None = None,
    mask: BoolArray | None = None,
) -> tuple[GaussianProcessMap, dict[int, str], BathymetricMap | None]:
    """Return the model learned anew, by their number the soundings that are outliers with the reason, and the map.

    Parameters
    ----------
    rows : (n, 4)
        East, north, depth, standard deviation.
    trusted : (n,)
        Those that are no outliers whatever their neighbours say.
    model
        As it was learned before, if it was.
    grid, mask
        Of the map that the others make; without them none is made.
    """
    verdict = flag_outliers(
        Soundings.of_rows(rows), hyperparameters=getattr(model, "stationary_hyperparameters_", None)
    )
    rejected = verdict.rejected & ~trusted
    reasons = {i: verdict.reason(i) for i in np.flatnonzero(rejected).tolist()}
    fitted = copy.copy(model).fit(taken(rows, ~rejected), learn=True)
    return fitted.learned(), reasons, None if grid is None else fitted.predict(grid, mask)


def mapped(
    rows: SoundingRows, used: BoolArray, model: GaussianProcessMap, grid: Grid, mask: BoolArray
) -> tuple[BathymetricMap, GaussianProcessMap]:
    """Return the map that soundings make, (n, 4), of which some are ``used`` (n,), and its model.

    The model is learned of them where nothing was learned before.
    """
    fitted = copy.copy(model).fit(taken(rows, used), learn=False)
    return fitted.predict(grid, mask), fitted.learned()


def taken(rows: SoundingRows, used: BoolArray) -> Soundings:
    """Return the soundings where ``used`` (n,) is True; nothing is copied where all are."""
    soundings = Soundings.of_rows(rows)
    return soundings if used.all() else soundings.take(used)
