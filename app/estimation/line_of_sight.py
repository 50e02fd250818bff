"""Line of sight: which landmarks the sea floor itself hides from a vehicle. Depth is positive down."""

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray

SAMPLES_PER_CELL = 2.0
GRAZE = 1e-6
"""Of a cell: how far below the sea floor a ray may run before it counts as blocked (rounding)."""


def in_sight(
    positions: FloatArray,
    landmarks: FloatArray,
    depth_m: FloatArray,
    west_m: float,
    south_m: float,
    cell_m: float,
) -> BoolArray:
    """Return which vehicle sees which landmark over the sea floor, whatever the distance.

    The straight ray is sampled twice per cell and compared with the bilinearly interpolated floor; a ray below it is
    blocked. Where the floor is unknown, and outside the raster, nothing blocks.

    Parameters
    ----------
    positions : (n_vehicles, 3)
        Vehicles: east, north, depth.
    landmarks : (n_landmarks, 3)
        Landmarks on the floor; those of unknown depth (NaN) are never in sight.
    depth_m : (rows, cols)
        Depths at cell centres; row 0 is south, column 0 is west, NaN is unknown.
    west_m, south_m : float
        Outer corner of the south-western cell.
    cell_m : float
        Side of a cell.

    Returns
    -------
    (n_vehicles, n_landmarks)
    """
    return _in_sight(
        np.ascontiguousarray(positions, dtype=np.float64),
        np.ascontiguousarray(landmarks, dtype=np.float64),
        np.ascontiguousarray(depth_m, dtype=np.float64),
        west_m,
        south_m,
        cell_m,
    )


@njit(cache=True, nogil=True)
def _floor(x: float, y: float, depth: FloatArray, west: float, south: float, cell: float) -> float:
    """Bilinear depth; the border's value goes on in the outer half cell. NaN outside and next to unknown cells."""
    rows, cols = depth.shape
    u = (x - west) / cell
    v = (y - south) / cell
    if u < 0.0 or v < 0.0 or u > cols or v > rows:
        return np.nan
    u = min(max(u - 0.5, 0.0), cols - 1.0)
    v = min(max(v - 0.5, 0.0), rows - 1.0)
    j = min(int(u), max(cols - 2, 0))
    i = min(int(v), max(rows - 2, 0))
    u -= j
    v -= i
    total = 0.0
    for di in range(2):
        wy = v if di == 1 else 1.0 - v
        for dj in range(2):
            weight = wy * (u if dj == 1 else 1.0 - u)
            if weight > 0.0:  # a corner without weight must not spread its NaN
                total += weight * depth[i + di, j + dj]
    return total


@njit(cache=True, nogil=True)
def _in_sight(
    positions: FloatArray, landmarks: FloatArray, depth: FloatArray, west: float, south: float, cell: float
) -> BoolArray:
    out = np.zeros((len(positions), len(landmarks)), dtype=np.bool_)
    for i in range(len(positions)):
        ax, ay, az = positions[i, 0], positions[i, 1], positions[i, 2]
        for m in range(len(landmarks)):
            dx, dy, dz = landmarks[m, 0] - ax, landmarks[m, 1] - ay, landmarks[m, 2] - az
            if np.isnan(dz):
                continue
            n = int(np.ceil(SAMPLES_PER_CELL * np.hypot(dx, dy) / cell))
            clear = True
            for k in range(1, n):
                t = k / n
                if az + t * dz > _floor(ax + t * dx, ay + t * dy, depth, west, south, cell) + GRAZE * cell:
                    clear = False
                    break
            out[i, m] = clear
    return out
