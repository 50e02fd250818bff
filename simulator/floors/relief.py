"""Building blocks of generated sea floors: directions, smooth and fractal random fields."""

from __future__ import annotations

import math

import numpy as np

from simulator.arrays import FloatArray


def distance_along(east: FloatArray, north: FloatArray, angle_rad: float, *, centred: bool = True) -> FloatArray:
    """Return the coordinate in a direction (radians from north), zero at the centre of the grid."""
    e = east - 0.5 * (east.min() + east.max()) if centred else east
    n = north - 0.5 * (north.min() + north.max()) if centred else north
    return np.asarray(e * math.sin(angle_rad) + n * math.cos(angle_rad), dtype=float)


def smooth_field(east: FloatArray, north: FloatArray, wavelength_m: float, rng: np.random.Generator) -> FloatArray:
    """Return a sum of 24 plane waves of random direction and phase, unit variance, independent of the cell size."""
    z = np.zeros(east.shape)
    for _ in range(24):
        direction, phase = rng.uniform(0.0, 2.0 * math.pi, 2)
        k = 2.0 * math.pi / (wavelength_m * rng.uniform(0.7, 1.8))
        z += np.cos(k * (east * math.sin(direction) + north * math.cos(direction)) + phase)
    return z * math.sqrt(2.0 / 24.0)


def fractal(
    shape: tuple[int, int],
    exponent: float,
    rng: np.random.Generator,
    stretch: float = 1.0,
    direction_rad: float = 0.0,
) -> FloatArray:
    """Return a random field (rows, cols) with power-law spectrum, zero mean, unit standard deviation.

    Its amplitude falls with the frequency to the power ``-exponent``. Forms are ``stretch`` times as long in the
    direction (radians from north) as across it.
    """
    rows, cols = shape
    # Twice the size: an FFT field repeats itself, so opposite borders would otherwise join.
    ky = np.fft.fftfreq(2 * rows)[:, None]
    kx = np.fft.rfftfreq(2 * cols)[None, :]
    if stretch == 1.0:
        k = np.hypot(kx, ky)
    else:
        sine, cosine = math.sin(direction_rad), math.cos(direction_rad)
        k = np.hypot(stretch * (kx * sine + ky * cosine), kx * cosine - ky * sine)
    k[0, 0] = 1.0
    amplitude = k**-exponent
    amplitude[0, 0] = 0.0
    spectrum = amplitude * np.exp(2j * math.pi * rng.uniform(0.0, 1.0, k.shape))
    z = np.fft.irfft2(spectrum, s=(2 * rows, 2 * cols))[:rows, :cols]
    z = z - z.mean()
    return np.asarray(z / z.std(), dtype=float)
