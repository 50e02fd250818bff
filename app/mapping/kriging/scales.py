"""Local amplitude and local, directed correlation length: what makes the process nonstationary."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from app.arrays import FloatArray, IntArray
from app.mapping.kriging.fields import Field
from app.mapping.types import Grid

AMPLITUDE_EXPONENT = 0.15
LENGTH_EXPONENT = -0.7 / 4.0
LENGTH_FACTOR_RANGE = (0.3, 8.0)

STRETCH_EXPONENT = 0.15
STRETCH_RANGE = 2.5
TENSOR_FLOOR = 0.3
TENSOR_WINDOW_CELLS = 4.0


@dataclass(frozen=True)
class LocalScales:
    """How the process differs from place to place, relative to one amplitude and one length.

    Attributes
    ----------
    amplitude : (m,)
        Multiplier of the amplitude.
    metric : (m, 4)
        ``S_xx, S_xy, S_yy`` of the squared-length matrix and the fourth root of its determinant; that of a
        place with length multiplier f and no preferred direction is ``f^2, 0, f^2, f``.
    """

    amplitude: FloatArray
    metric: FloatArray

    def take(self, rows: IntArray) -> "LocalScales":
        """Return the scales of some places."""
        return LocalScales(self.amplitude[rows], self.metric[rows])

    def scaled_metric(self, length_m: float) -> FloatArray:
        """The metric for a length in metres, (m, 4)."""
        return np.asarray(self.metric * np.array([length_m**2, length_m**2, length_m**2, length_m]))


def uniform_scales(m: int) -> LocalScales:
    """Scales of a stationary process at ``m`` places."""
    return LocalScales(np.ones(m), np.tile([1.0, 0.0, 1.0, 1.0], (m, 1)))


def stretch_from_relief(grid: Grid, relief_m: FloatArray) -> Field:
    """Read from a first map along which direction the sea floor varies least (structure tensor of its gradients).

    Parameters
    ----------
    relief_m : (rows, cols)
        Depth minus trend.

    Returns
    -------
    log_stretch : Field
        Logarithm of the stretch matrix: ``xx`` and ``xy`` of a symmetric matrix with zero trace. Zero means no
        direction.
    """
    d_north, d_east = np.gradient(relief_m, grid.cell_m)
    xx, xy, yy = (
        gaussian_filter(part, TENSOR_WINDOW_CELLS, mode="nearest")
        for part in (d_east * d_east, d_east * d_north, d_north * d_north)
    )
    floor = TENSOR_FLOOR * float(np.mean(xx + yy)) + 1e-30
    middle = 0.5 * (xx + yy) + floor
    half = np.hypot(0.5 * (xx - yy), xy)
    # ln of the ratio of the principal gradient variances; short correlation across the grain, long along it
    log_ratio = np.log((middle + half) / (middle - half))
    log_stretch = np.clip(STRETCH_EXPONENT * log_ratio, 0.0, np.log(STRETCH_RANGE))
    scale = np.where(half > 0.0, log_stretch / np.maximum(half, 1e-300), 0.0)
    across_xx, across_xy = 0.5 * (xx - yy) * scale, xy * scale
    return Field(grid, np.array([-across_xx, -across_xy]))


def local_scales(relative_roughness: FloatArray, log_stretch: FloatArray) -> LocalScales:
    """Turn roughness (m,) and log stretch (2, m) into scales.

    Rough places get a somewhat larger amplitude and a shorter length; the length matrix is
    ``f^2 exp(2 log_stretch)``.
    """
    factor = np.clip(relative_roughness**LENGTH_EXPONENT, *LENGTH_FACTOR_RANGE)
    xx, xy = log_stretch
    strength = np.hypot(xx, xy)
    cosh, sinhc = (
        np.cosh(2.0 * strength),
        np.where(strength > 1e-12, np.sinh(2.0 * strength) / np.maximum(strength, 1e-12), 2.0),
    )
    square = factor**2
    metric = np.column_stack([square * (cosh + sinhc * xx), square * sinhc * xy, square * (cosh - sinhc * xx), factor])
    return LocalScales(relative_roughness**AMPLITUDE_EXPONENT, metric)
