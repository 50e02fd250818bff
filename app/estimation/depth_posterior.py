"""What ranges say of the depth of one landmark, exactly: the posterior on a grid of depths that narrows as it settles.

A range ``y = r (1 + noise xi)``, ``r^2 = h^2 + (z - z_vehicle)^2``, fits two depths, one below the vehicle and its
mirror image above. Beside a wall the upper one is the true one, so neither may be presumed: an estimate that is held
below every vehicle that looks is pressed away from the truth and gets surer at every look. Ranges from other depths
tell the two apart, and until they do the variance says so. Two things known of sea floors help, both with heavy tails:
a landmark above a vehicle must be reached from the vehicle's own water by a slope, and steep ones are rare; and a
landmark lies near the depths of its neighbours, the nearer the closer.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray

CELLS = 96
"""Depths at which a posterior is held."""

REACH_SD = 5.0
"""How many deviations a range may be short of the truth when the first look lays out the depths."""

OUTLIER_SD = 6.0
"""A range that is this many deviations off all depths that were likely speaks of one that a grid does not hold."""

OUTLIER_LOSS = 10.0
"""What such a range takes from the logarithm of the likelihood of the depths that it does not fit, at most: one alone
does not move an estimate, another one that agrees does."""

LOST = 20.0
"""Depths whose logarithm of likelihood lies this far below the best are given up when a grid narrows."""

NEVER = -1e4
"""Logarithm of the likelihood of what cannot be."""

TYPICAL_SLOPE = 0.5
"""Rise over run of sea floors, where they rise above a vehicle."""

TYPICAL_STEP = 0.35
"""Difference between a landmark and those round about it, over their distance."""

STEEP = 1e-4
"""Chance of a wall of whatever steepness: what is measured of it decides."""

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution of what lies between neighbours: steps and walls are not rare."""

LEAST = -7.0
"""Logarithm of the density, of the greatest, down to which depths belong to the estimate and not to another one."""

NEAREST_M = 1e-9

Cells = NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def lay_out(vehicle_depth: float, measured: float, noise: float, below: bool, h2: float) -> tuple[float, float]:
    """Return the first depth and the spacing of a grid that holds whatever a first range may mean.

    However short it is, the landmark is no closer than its horizontal distance, whose square is ``h2``.
    """
    reach = max(measured, NEAREST_M) / max(1.0 - REACH_SD * noise, 0.25)
    reach = max(reach, np.sqrt(h2))
    lowest = vehicle_depth if below else vehicle_depth - reach
    return lowest, (vehicle_depth + reach - lowest) / (CELLS - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _deviation(
    z: float, h2: float, vehicle_depth: float, measured: float, noise: float, spacing: float
) -> tuple[float, float]:
    """Return by how many deviations a range is off at depth ``z``, and the deviation, blurred by half a ``spacing``."""
    drop = z - vehicle_depth
    r = max(np.sqrt(h2 + drop * drop), NEAREST_M)
    sd = np.sqrt((noise * r) ** 2 + (0.5 * spacing * drop / r) ** 2)
    return (measured - r) / sd, sd


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(z: float, h2: float, vehicle_depth: float, measured: float, noise: float, spacing: float) -> float:
    """Return the logarithm of the likelihood of a range at depth ``z``, blurred by half a ``spacing``."""
    off, sd = _deviation(z, h2, vehicle_depth, measured, noise, spacing)
    return float(-0.5 * off**2 - np.log(sd))


@njit(cache=True, nogil=True, error_model="numpy")
def _stored(z: float, h2: float, vehicle_depth: float, measured: float, noise: float, spacing: float) -> float:
    """Return what is kept of a range at depth ``z``: the logarithm of its likelihood, no sharper than a cell."""
    drop = z - vehicle_depth
    r = max(np.sqrt(h2 + drop * drop), NEAREST_M)
    sd = max(noise * r, 0.5 * spacing * abs(drop) / r)
    return float(-0.5 * ((measured - r) / sd) ** 2 - np.log(sd))


@njit(cache=True, nogil=True, error_model="numpy")
def _is_outlier(
    fit: Cells,
    grid: tuple[float, float],
    h2: float,
    vehicle_depth: float,
    measured: float,
    noise: float,
    below: bool,
) -> bool:
    """Return whether a range fits none of the depths that were likely so far, or best the last of a grid."""
    lowest, spacing = grid
    best, where, closest = -np.inf, 0, np.inf
    for c in range(CELLS):
        off, sd = _deviation(lowest + c * spacing, h2, vehicle_depth, measured, noise, spacing)
        value = fit[c] - 0.5 * off**2 - np.log(sd)
        if value > best:
            best, where = value, c
        if fit[c] > -1.5 * LOST:
            closest = min(closest, abs(off))
    return closest > OUTLIER_SD or where == CELLS - 1 or (where == 0 and not below)


@njit(cache=True, nogil=True, error_model="numpy")
def _widen(fit: Cells, steepness: Cells, grid: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Lay a grid out again in place so that it holds ``other`` too; return first depth and spacing.

    Beyond the old one depths are as likely as at its end, but not less than when they were given up.
    """
    lowest = min(grid[0], other[0])
    last = max(grid[0] + (CELLS - 1) * grid[1], other[0] + (CELLS - 1) * other[1])
    spacing = (last - lowest) / (CELLS - 1)
    old, slopes = fit.copy(), steepness.copy()
    best = -np.inf
    for c in range(CELLS):
        at = (lowest + c * spacing - grid[0]) / grid[1]
        near = int(min(max(np.round(at), 0.0), CELLS - 1.0))
        steepness[c] = slopes[near]
        fit[c] = old[near]
        if abs(at - near) > 0.5:
            fit[c] = max(fit[c], -LOST)
        elif spacing > grid[1]:  # the best of what the cell holds
            reach = int(np.ceil(0.5 * spacing / grid[1]))
            for k in range(max(near - reach, 0), min(near + reach, CELLS - 1) + 1):
                fit[c] = max(fit[c], old[k])
        best = max(best, fit[c])
    for c in range(CELLS):
        fit[c] -= best
    return lowest, spacing


@njit(cache=True, nogil=True)
def _between(row: Cells, at: float) -> float:
    """Return a row's value between cells: a parabola, which a logarithm of a density nearly is."""
    k = min(max(int(np.round(at)), 1), CELLS - 2)
    u = at - k
    a, b, c = float(row[k - 1]), float(row[k]), float(row[k + 1])
    if min(a, b, c) < 0.1 * NEVER:
        return b
    return b + 0.5 * u * (c - a) + 0.5 * u * u * (a - 2.0 * b + c)


@njit(cache=True, nogil=True)
def _narrow(fit: Cells, steepness: Cells, lowest: float, spacing: float, middle: float) -> tuple[float, float]:
    """Halve the spacing in place round the cell ``middle``; return first depth and spacing."""
    start = min(max(middle - 0.25 * (CELLS - 1), 0.0), 0.5 * (CELLS - 1))
    finer, slopes = np.empty(CELLS, dtype=np.float32), np.empty(CELLS, dtype=np.float32)
    for c in range(CELLS):
        at = start + 0.5 * c
        k = min(int(at), CELLS - 2)
        finer[c] = _between(fit, at)
        slopes[c] = steepness[k] + (at - k) * (steepness[k + 1] - steepness[k])
    fit[:] = finer
    steepness[:] = slopes
    return lowest + start * spacing, 0.5 * spacing


@njit(cache=True, nogil=True, error_model="numpy")
def take_range(
    fit: Cells,
    steepness: Cells,
    grid: tuple[float, float],
    h2: float,
    vehicle_depth: float,
    measured: float,
    noise: float,
    below: bool,
) -> tuple[float, float]:
    """Take one range into a landmark's posterior, in place.

    Parameters
    ----------
    fit : (CELLS,)
        Logarithm of the likelihood of all ranges so far, 0 at the best depth.
    steepness : (CELLS,)
        Slope (rise over run) by which the floor must rise from a vehicle's place to reach that depth; the most.
    grid : first depth and spacing
        The new ones are returned.
    h2 : float
        Squared horizontal distance from the vehicle to the landmark.
    below : bool
        The sensor looks down only.
    """
    noise = max(noise, NEAREST_M)
    outlier = _is_outlier(fit, grid, h2, vehicle_depth, measured, noise, below)
    if outlier:
        grid = _widen(fit, steepness, grid, lay_out(vehicle_depth, measured, noise, below, h2))
    lowest, spacing = grid
    for _ in range(40):
        if outlier:
            break  # what is likely is not known yet
        best = -np.inf
        for c in range(CELLS):
            z = lowest + c * spacing
            best = max(best, fit[c] + _fit(z, h2, vehicle_depth, measured, noise, spacing))
        first, last = CELLS, -1
        for c in range(CELLS):
            z = lowest + c * spacing
            if fit[c] + _fit(z, h2, vehicle_depth, measured, noise, spacing) > best - LOST:
                first, last = min(first, c), c
        if 3 * (last - first) > CELLS:
            break
        lowest, spacing = _narrow(fit, steepness, lowest, spacing, 0.5 * (first + last))
    best, most = -np.inf, -np.inf
    h = max(np.sqrt(h2), NEAREST_M)
    if outlier:
        for c in range(CELLS):
            most = max(most, _stored(lowest + c * spacing, h2, vehicle_depth, measured, noise, spacing))
    for c in range(CELLS):
        rise = vehicle_depth - (lowest + c * spacing)
        told = _stored(lowest + c * spacing, h2, vehicle_depth, measured, noise, spacing)
        value = fit[c] + max(told, most - OUTLIER_LOSS)
        if rise > 0.0:
            steepness[c] = max(steepness[c], rise / h)
            value = NEVER if below else value
        fit[c] = max(value, NEVER)
        best = max(best, fit[c])
    for c in range(CELLS):
        fit[c] = max(fit[c] - best, NEVER)
    return lowest, spacing


@njit(cache=True, nogil=True, error_model="numpy")
def estimate(
    fit: Cells, steepness: Cells, grid: tuple[float, float], around: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return a landmark's likeliest depth and its variance about it, and both by its own ranges alone.

    The variance includes what other depths are possible. By its own ranges alone, the landmark is taken to have the
    likeliest of these: that is what neighbours are told, or errors would go round among them and be counted again and
    again.

    Parameters
    ----------
    fit, steepness, grid
        As for :func:`take_range`.
    around : depth and scale
        Of the landmarks round about; an infinite scale where none is known.
    """
    lowest, spacing = grid
    own, density = np.empty(CELLS), np.empty(CELLS)
    best, mode = -np.inf, 0
    for c in range(CELLS):
        off = (lowest + c * spacing - around[0]) / around[1]
        own[c] = fit[c] + np.log(np.exp(-steepness[c] / TYPICAL_SLOPE) + STEEP)
        # Scaled so that close by it says as much as a normal distribution of that scale, no more.
        density[c] = own[c] - 0.5 * (FREEDOM + 1.0) * np.log1p(off * off / (FREEDOM + 1.0))
        if density[c] > best:
            best, mode = density[c], c
    middle, _ = _moments(density, mode)
    own_middle, own_spread = _moments(own, mode)
    total, spread = 0.0, 0.0
    for c in range(CELLS):
        weight = np.exp(density[c] - best)
        total += weight
        spread += weight * (c - middle) ** 2
    # Where a depth lies between two cells is not known.
    return (
        lowest + middle * spacing,
        max(spread / total, 1.0 / 12.0) * spacing * spacing,
        lowest + own_middle * spacing,
        max(own_spread, 1.0 / 12.0) * spacing * spacing,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(density: FloatArray, mode: int) -> tuple[float, float]:
    """Return mean and variance of the number of a cell, of the logarithms of densities (CELLS,) joined to ``mode``."""
    first, last, best = mode, mode, density[mode]
    while first > 0 and density[first - 1] > best + LEAST:
        first -= 1
        best = max(best, density[first])
    while last < CELLS - 1 and density[last + 1] > best + LEAST:
        last += 1
        best = max(best, density[last])
    total, once, twice = 0.0, 0.0, 0.0
    for c in range(first, last + 1):
        weight = np.exp(density[c] - best)
        total += weight
        once += weight * (c - mode)
        twice += weight * (c - mode) ** 2
    mean = once / total
    return mode + mean, max(twice / total - mean * mean, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def from_neighbours(
    depth: FloatArray, variance: FloatArray, apart: FloatArray, known: BoolArray
) -> tuple[float, float]:
    """Return the depth that neighbours (k,) suggest and the scale by which it may differ; infinite where none does.

    Those count that are ``known`` (k,); ``depth`` and ``variance`` are by their own ranges alone, so these errors even
    out; what lies between them and the landmark does not, it is much the same for all. ``apart`` (k,) are distances.
    """
    weights, depths, noise, ground = 0.0, 0.0, 0.0, 0.0
    for k in range(len(depth)):
        if known[k]:
            step = (TYPICAL_STEP * apart[k]) ** 2
            weight = 1.0 / max(step + variance[k], NEAREST_M**2)
            weights += weight
            depths += weight * depth[k]
            noise += weight * weight * variance[k]
            ground += weight * step
    if weights == 0.0:
        return 0.0, np.inf
    return depths / weights, np.sqrt(noise / (weights * weights) + ground / weights)
