"""Sensor models: what a vehicle measures of the sea floor (AURO15 eq. 4, 5). Depth is positive down."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray
from app.estimation.beams import BeamSonar, noisy_ranges
from app.estimation.occupancy import Scanner


@dataclass(frozen=True)
class RangeSensor:
    """Ranges to every landmark in sight, ``y = r (1 + noise * xi)`` with standard normal ``xi`` (AURO15 eq. 5).

    Attributes
    ----------
    visibility_m : float
        Threshold beyond which a landmark is not seen.
    relative_noise : float
        Standard deviation of the multiplicative noise.
    """

    visibility_m: float = 0.4
    relative_noise: float = 0.1

    def visible(self, positions: FloatArray, landmarks: FloatArray) -> BoolArray:
        """Return which vehicle at ``positions`` (n_vehicles, 3) sees which landmark (n_landmarks, 3), as a matrix.

        Landmarks of unknown depth (NaN) are not visible.
        """
        return _closer(positions, landmarks, self.visibility_m)

    def measure(self, position: FloatArray, landmarks: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return noisy ranges (n_landmarks,) from ``position`` (3,) to ``landmarks`` (n_landmarks, 3)."""
        return noisy_ranges(position, landmarks, self.relative_noise, rng)


@dataclass(frozen=True)
class SingleBeam:
    """One beam straight down (bathymeter, altimeter): the depth below the vehicle, all along the way.

    Attributes
    ----------
    relative_noise : float
        Standard deviation of the multiplicative noise on the range to the bottom.
    """

    relative_noise: float = 0.01

    def measure(self, vehicle_depth_m: FloatArray, bottom_depth_m: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return sounded depths: vehicle depth plus a noisy range, arrays of one shape."""
        ranges = bottom_depth_m - vehicle_depth_m
        noisy = ranges * (1.0 + self.relative_noise * rng.standard_normal(np.shape(ranges)))
        return np.asarray(vehicle_depth_m + noisy, dtype=np.float64)

    def sd_m(self, vehicle_depth_m: FloatArray, bottom_depth_m: FloatArray) -> FloatArray:
        """Return the standard deviation of such a sounding, at least a millimetre."""
        return np.maximum(1e-3, self.relative_noise * np.abs(bottom_depth_m - vehicle_depth_m))


@njit(cache=True, nogil=True)
def _closer(positions: FloatArray, landmarks: FloatArray, reach: float) -> BoolArray:
    """Return which of the positions (n, 3) is closer than ``reach`` to which landmark (m, 3), (n, m)."""
    closer = np.zeros((len(positions), len(landmarks)), dtype=np.bool_)
    for i in range(len(positions)):
        for m in range(len(landmarks)):
            squared = 0.0
            for k in range(3):
                squared += (positions[i, k] - landmarks[m, k]) ** 2
            closer[i, m] = squared < reach * reach  # never with an unknown depth
    return closer


Ranging = RangeSensor | SingleBeam | BeamSonar
Sensor = Ranging | Scanner
