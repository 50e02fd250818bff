"""Rays from a sonar to the sea floor, compiled: several vehicles at many times their pace cast thousands a second."""

import math

import numpy as np
from numba import njit

from simulator.arrays import FloatArray

FINE_M = 1e-3


@njit(cache=True, nogil=True)
def depth_between(z_m: FloatArray, cell_m: float, east_m: float, north_m: float) -> float:
    """Depth by bilinear interpolation, as ``Terrain.depth_at``; NaN outside and where an unknown cell takes part."""
    rows, cols = z_m.shape
    if not (0.0 <= east_m <= cols * cell_m and 0.0 <= north_m <= rows * cell_m):
        return np.nan
    x = min(max(east_m / cell_m - 0.5, 0.0), cols - 1.0)
    y = min(max(north_m / cell_m - 0.5, 0.0), rows - 1.0)
    j, i = min(int(x), cols - 2), min(int(y), rows - 2)
    u, v = x - j, y - i
    depth = 0.0
    for di in range(2):
        wy = v if di else 1.0 - v
        for dj in range(2):
            weight = (u if dj else 1.0 - u) * wy
            if weight > 0.0:  # a corner without weight must not spread its NaN
                depth += weight * z_m[i + di, j + dj]
    return depth


@njit(cache=True, nogil=True)
def march(
    z_m: FloatArray,
    cell_m: float,
    east_m: float,
    north_m: float,
    depth_m: float,
    directions: FloatArray,
    shoalest_m: float,
    deepest_m: float,
    max_range_m: float,
) -> FloatArray:
    """Distance along each ray, unit vectors (n, 3) east, north, down, to the sea floor; see ``cast_rays``.

    A ray that goes down meets the floor between the shoalest and the deepest point of it.
    """
    step = 0.5 * cell_m
    halvings = max(1, math.ceil(math.log2(step / FINE_M)))
    samples = math.ceil((max_range_m + step) / step)
    ranges = np.full(len(directions), np.nan)
    for ray in range(len(directions)):
        de, dn, dd = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        first, last = 0, samples
        if dd > 0.0:
            first = int(min(max((shoalest_m - depth_m) / dd / step - 1.0, 0.0), 1.0 * samples))
            last = int(min(max((deepest_m - depth_m) / dd / step + 2.0, 0.0), 1.0 * samples))
        before = np.nan
        for k in range(first, last):
            at = k * step
            gap = depth_between(z_m, cell_m, east_m + at * de, north_m + at * dn) - (depth_m + at * dd)
            if gap <= 0.0:
                # The sample before must be known and above the floor, or the ray came up from an unknown place.
                if k > 0 and np.isfinite(before):
                    near, far = at - step, at
                    for _ in range(halvings):
                        middle = 0.5 * (near + far)
                        floor = depth_between(z_m, cell_m, east_m + middle * de, north_m + middle * dn)
                        if floor <= depth_m + middle * dd:
                            far = middle
                        else:
                            near = middle
                    found = 0.5 * (near + far)
                    if found <= max_range_m:
                        ranges[ray] = found
                break
            before = gap
    return ranges


def warm_up() -> None:
    """Compile, or load from the cache, what would else be compiled while vehicles move."""
    floor = np.full((2, 2), 5.0)
    floor.setflags(write=False)  # as those of terrains are: numba compiles anew for arrays that may be written
    march(floor, 1.0, 1.0, 1.0, 0.0, np.array([[0.0, 0.0, 1.0]]), 5.0, 5.0, 10.0)
