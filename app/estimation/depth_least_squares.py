"""The depth of a landmark below the vehicles by the papers' weighted least squares, range by range (AURO15 sec. 3.4).

Right for sonars that look down, such as PCAO18's. For one that sees all round it presses landmarks that lie above a
vehicle below it and gets surer all the same: see :mod:`app.estimation.depth_posterior`.
"""

import numpy as np
from numba import njit

ITERATIONS = 3


@njit(cache=True, nogil=True, error_model="numpy")
def fit_depth(
    prior: float, prior_variance: float, h2: float, vehicle_depth: float, measured: float, noise: float
) -> tuple[float, float]:
    """Return depth and variance of one landmark after one range to it, by Gauss-Newton.

    ``h2`` is the squared horizontal distance; an infinite prior variance means that nothing was known.
    """
    information = 1.0 / prior_variance if np.isfinite(prior_variance) else 0.0
    # A range shorter than the horizontal distance is noise: the floor keeps the first estimate below the vehicle.
    least = 0.05 * measured
    anchor, depth = prior, prior
    if information <= 0.0:
        anchor = 0.0
        depth = vehicle_depth + np.sqrt(max(measured**2 - h2, least**2))
    gained = 0.0
    for _ in range(ITERATIONS):
        drop = max(depth - vehicle_depth, least)
        r = np.sqrt(h2 + drop**2)
        slope = drop / r
        gained = (slope / (noise * r)) ** 2
        pseudo = depth + (measured - r) / slope
        depth = max((information * anchor + gained * pseudo) / (information + gained), vehicle_depth + least)
    return depth, 1.0 / (information + gained)
