"""One range into one extended Kalman filter: shared by targets and by the localization of vehicles, compiled.

The predicted range and its variance are of second order in the position's uncertainty, which keeps the covariance
honest while a point is uncertain across the line of sight; the covariance is updated in Joseph form, which keeps it
symmetric and positive whatever rounding does.
"""

import numpy as np
from numba import njit

from app.arrays import FloatArray

NEAREST_M = 1e-9


@njit(cache=True, nogil=True)
def update_by_range(
    mean: FloatArray, covariance: FloatArray, position: FloatArray, y: float, noise: float, blur: FloatArray
) -> tuple[float, float]:
    """Update a filter in place by a range ``y = r (1 + noise xi)`` from a place to its point.

    Parameters
    ----------
    mean : (d,)
        State; the first three are the point's position.
    covariance : (d, d)
        Its covariance.
    position : (3,)
        Where the range was measured from.
    noise : float
        Standard deviation of the multiplicative noise.
    blur : (3,)
        Variances of that place along the axes.

    Returns
    -------
    innovation, variance
        Measured minus predicted range, and the variance that was predicted for it.
    """
    d = len(mean)
    u = mean[:3] - position
    r = max(np.sqrt((u * u).sum()), NEAREST_M)
    u = u / r
    Pu = np.zeros(d)
    for i in range(d):
        for j in range(3):
            Pu[i] += covariance[i, j] * u[j]
    # Covariance of the difference between point and place, which is what the range sees.
    D = covariance[:3, :3].copy()
    for i in range(3):
        D[i, i] += blur[i]
    Du = D @ u
    along = (u * Du).sum()
    # The Hessian of the range is (I - u u') / r; its traces with D and with D Hessian D.
    across = (D[0, 0] + D[1, 1] + D[2, 2] - along) / r
    twice = ((D * D).sum() - 2.0 * (Du * Du).sum() + along * along) / (r * r)
    predicted = r + 0.5 * across
    variance = along + 0.5 * twice + noise * noise * (predicted * predicted + along)
    innovation = y - predicted
    known = (u * Pu[:3]).sum()
    rest = max(variance - known, 0.0)
    gain = Pu / variance
    mean += gain * innovation
    # Joseph form: (I - K H) P (I - K H)' + K (S - H P H') K', with H = (u', 0).
    A = np.eye(d)
    for i in range(d):
        for j in range(3):
            A[i, j] -= gain[i] * u[j]
    P = A @ covariance @ A.T
    for i in range(d):
        for j in range(d):
            covariance[i, j] = 0.5 * (P[i, j] + P[j, i]) + rest * (gain[i] * gain[j])
    return innovation, variance
