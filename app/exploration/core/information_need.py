"""What is still lacking of each landmark, as directions along which it is not known well enough.

Where only depths are estimated that is one figure per landmark. Where whole positions are, a range informs
along its own direction only: looking again from the same side helps no more. Each axis of a landmark's error ellipsoid
that is too long is therefore kept as a task of its own, with its direction.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.exploration.core.problem import Belief

TRACE = 1e-6
"""Least need of a landmark that is not accurate, as a fraction of what is enough."""

DOWN = np.array([0.0, 0.0, 1.0])
FLAT = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class Lacking(NamedTuple):
    """Tasks, of which a landmark may have several.

    Attributes
    ----------
    row : (k,)
        Landmarks, as rows of the belief.
    direction : (k, 3)
        Unit vectors.
    need : (k,)
        Information (inverse variance) that is lacking along them; at least a trace.
    """

    row: NDArray[np.int64]
    direction: FloatArray
    need: FloatArray


def lacking(belief: Belief, accuracy_sd_m: float, hedge: float = 1.0) -> Lacking:
    """Return what is lacking of the landmarks that are not accurate.

    ``hedge`` is how much more than needed is presumed for those never seen.
    """
    enough = 1.0 / accuracy_sd_m**2
    open_ = np.flatnonzero(~belief.accurate)
    if belief.covariance_m2 is None:
        sd = belief.sd_m[open_]
        have = np.where(np.isfinite(sd), 1.0 / np.maximum(sd, 1e-9) ** 2, 0.0)
        need = np.maximum(TRACE * enough, np.where(np.isnan(belief.depth_m[open_]), hedge * enough, enough - have))
        return Lacking(open_, np.repeat(DOWN[None], len(open_), axis=0), need)
    seen = np.isfinite(belief.sd_m[open_])
    unseen_rows, rows = open_[~seen], open_[seen]
    variance, axes = np.linalg.eigh(belief.covariance_m2[rows])
    short = enough - 1.0 / np.maximum(variance, 1e-12)
    # Rounding and a landmark's last look can leave nothing to be done along any axis: the longest one stays a task.
    short[:, 2] = np.maximum(short[:, 2], TRACE * enough)
    which, axis = np.nonzero(short > 0.0)
    return Lacking(
        np.concatenate([rows[which], np.repeat(unseen_rows, len(FLAT))]),
        np.vstack([axes[which, :, axis], np.tile(FLAT, (len(unseen_rows), 1))]),
        np.concatenate([short[which, axis], np.full(len(FLAT) * len(unseen_rows), hedge * enough)]),
    )
