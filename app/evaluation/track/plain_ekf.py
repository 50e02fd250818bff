"""The extended Kalman filter as it is usually taken: one Gaussian from the start, linearised at its mean.

MED13's figure 1 shows what comes of planning by such a filter. It is kept for that comparison only.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray, IntArray
from app.estimation import Landmarks3D


@dataclass(frozen=True)
class PlainEkf:
    """Stands where :class:`app.estimation.Landmark3DEstimator` stands.

    Attributes
    ----------
    noise : float
        Standard deviation of the multiplicative noise.
    accuracy_sd_m : float
        A landmark belongs to ``A`` once all three standard deviations are below this.
    box_m : (2, 3)
        The landmarks are presumed evenly in it: its middle and variance are the prior.
    fixed_m : float or None
        Standard deviation that the filter takes every range to have, whatever its length; None: it knows the noise.
    """

    noise: float
    accuracy_sd_m: float
    box_m: FloatArray
    fixed_m: float | None = None

    def update(
        self,
        landmarks: Landmarks3D,
        vehicle: int,
        position: FloatArray,
        index: IntArray,
        ranges: FloatArray,
        position_sd_m: float = 0.0,
        floor_m: float = np.nan,
    ) -> Landmarks3D:
        """Take in the ranges that one vehicle measured; arguments as for the other estimator, the floor left alone."""
        mean, covariance, looks = landmarks.position_m.copy(), landmarks.covariance_m2.copy(), landmarks.looks.copy()
        first = index[looks[index] == 0]
        mean[first] = self.box_m.mean(axis=0)
        covariance[first] = np.diag(np.ptp(self.box_m, axis=0) ** 2 / 12.0)
        u = mean[index] - position
        r = np.maximum(np.linalg.norm(u, axis=1), 1e-9)
        u /= r[:, None]
        Pu = np.einsum("mij,mj->mi", covariance[index], u)
        sd = self.noise * r if self.fixed_m is None else np.full(len(r), self.fixed_m)
        variance = (u * Pu).sum(axis=1) + sd**2 + position_sd_m**2
        mean[index] += Pu * ((ranges - r) / variance)[:, None]
        covariance[index] -= Pu[:, :, None] * Pu[:, None, :] / variance[:, None, None]
        looks[index] += 1
        done = (covariance[index][:, range(3), range(3)] < self.accuracy_sd_m**2).all(axis=1)
        accurate, credited = landmarks.accurate.copy(), landmarks.credited.copy()
        fresh = index[done & ~accurate[index]]
        accurate[fresh], credited[fresh] = True, vehicle
        return replace(
            landmarks, position_m=mean, covariance_m2=covariance, looks=looks, accurate=accurate, credited=credited
        )
