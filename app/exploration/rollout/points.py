"""Landmarks whose whole position is unknown, as flights look at them: each with the information held about it.

A range informs along its own direction only, so that the information of a flight on a landmark is a matrix. A
straight line, however long, leaves the direction across it and across the line of sight unknown; a second line at the
side, or across, settles it. Flights that predict the matrices know that; single figures do not.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.exploration.core.problem import Belief
from app.exploration.rollout.flight import NEAREST, Work, make_work
from app.exploration.rollout.floor import FloorEstimate, sample

DEPTH_PRESUMED = 0.5
"""Deviation, in visibilities, of the depth that a landmark is presumed to have before anybody has seen it."""

SURELY = 0.8
"""Part of the accuracy threshold that flights must come below: estimates come out a little worse than the bound."""

AZIMUTHS, RINGS = 16, 8
"""Directions and distances, up to that of sight, in which the floor around a landmark is taken to hide it."""

GRAZE = 0.05
"""How much higher than estimated the floor may be between a vehicle and a landmark that it sees, in visibilities."""


class LandmarkPoints(NamedTuple):
    """Landmarks still to be done.

    Attributes
    ----------
    work : Work
        Where they are, in buckets; ``need`` is 1 each.
    information : (6, m)
        Inverse covariances: xx, xy, xz, yy, yz, zz.
    variance_m2 : float
        Along every axis a landmark is accurate below this.
    ground_m : (m,)
        Depth of the estimated floor where they lie.
    horizon : (m, AZIMUTHS, RINGS)
        How far the floor around a landmark rises above it per distance, at most, in each direction up to each distance.
    """

    work: Work
    information: FloatArray
    variance_m2: float
    ground_m: FloatArray
    horizon: NDArray[np.float32]


def make_points(
    xyz: FloatArray, belief: Belief, row: NDArray[np.int64], accuracy_sd_m: float, area: FloatArray, sight_m: float,
    buckets: int, total: float, floor: FloorEstimate,
) -> LandmarkPoints:  # fmt: skip
    """Return the landmarks ``row`` (m,) of a belief, presumed at ``xyz`` (m, 3), as flights look at them.

    ``total`` is how many there are in all, done ones included, of which these are a fair sample.
    """
    assert belief.covariance_m2 is not None  # noqa: S101 - only where whole positions are estimated
    information = np.zeros((len(row), 3, 3))
    information[:, 2, 2] = 1.0 / (DEPTH_PRESUMED * sight_m) ** 2
    seen = np.isfinite(belief.sd_m[row])
    information[seen] = np.linalg.inv(belief.covariance_m2[row[seen]] + 1e-12 * np.eye(3))
    work, order = make_work(xyz, np.ones(len(row)), area, sight_m / buckets, 0.0, total, 1.0)
    six = information[order][:, (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)]
    ground, horizon = _horizons(work.xyz, floor, sight_m)
    return LandmarkPoints(work, np.ascontiguousarray(six.T), (SURELY * accuracy_sd_m) ** 2, ground, horizon)


@njit(cache=True, nogil=True, error_model="numpy")
def _horizons(xyz: FloatArray, floor: FloorEstimate, sight_m: float) -> tuple[FloatArray, NDArray[np.float32]]:
    """Return the floor's depth at landmarks (3, m) and how steeply it rises around them; see ``LandmarkPoints``."""
    size = xyz.shape[1]
    ground, horizon = np.empty(size), np.empty((size, AZIMUTHS, RINGS), dtype=np.float32)
    for m in range(size):
        x, y = xyz[0, m], xyz[1, m]
        ground[m] = sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        for a in range(AZIMUTHS):
            angle = 2.0 * np.pi * a / AZIMUTHS
            east, north, steepest = np.cos(angle), np.sin(angle), -np.inf
            for ring in range(RINGS):
                away = sight_m * (ring + 1) / RINGS
                at = sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, x + away * east, y + away * north)
                steepest = max(steepest, (ground[m] - at) / away)
                horizon[m, a, ring] = steepest
    return ground, horizon


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _hidden(points: LandmarkPoints, m: int, dx: float, dy: float, z: float, reach: float) -> bool:
    """Whether the floor hides landmark ``m`` from a vehicle at depth ``z`` from which it lies ``dx``, ``dy`` away."""
    away = np.sqrt(dx * dx + dy * dy)
    ring = min(RINGS, int(away / reach * RINGS)) - 1
    if ring < 0:
        return False
    azimuth = int(np.floor(np.arctan2(-dy, -dx) * (AZIMUTHS / (2.0 * np.pi)) + 0.5)) % AZIMUTHS
    return bool(points.ground_m[m] - z + GRAZE * reach < points.horizon[m, azimuth, ring] * away)


@njit(cache=True, nogil=True, error_model="numpy")
def lacks(information: FloatArray, m: int, variance: float) -> float:
    """Return what part of the variance of landmark ``m`` must still go, 0 to 1; 0 when it is accurate."""
    a, b, c = information[0, m], information[1, m], information[2, m]
    d, e, f = information[3, m], information[4, m], information[5, m]
    xx = d * f - e * e
    yy = a * f - c * c
    zz = a * d - b * b
    det = a * xx - b * (b * f - c * e) + c * (b * e - c * d)
    worst = max(xx, max(yy, zz))
    if worst < variance * det:
        return 0.0
    return float(1.0 - max(0.0, variance * det) / max(worst, 1e-300))


@njit(cache=True, nogil=True, error_model="numpy")
def look_whole(
    x: float,
    y: float,
    z: float,
    points: LandmarkPoints,
    reach: float,
    noise: float,
    information: FloatArray,
    done: BoolArray,
) -> int:
    """Add what a vehicle sees at (x, y, z) to ``information`` (6, m); return how many landmarks that completes."""
    work = points.work
    v2 = reach * reach
    gain = 1.0 / (noise * noise)
    b = work.bucket_m
    low = max(0, int(np.floor((y - reach - work.south_m) / b)))
    high = min(work.rows - 1, int(np.floor((y + reach - work.south_m) / b)))
    completed = 0
    for row in range(low, high + 1):
        south = work.south_m + row * b
        gap = max(0.0, max(south - y, y - south - b))
        half = np.sqrt(max(0.0, v2 - gap * gap))
        left = max(0, int(np.floor((x - half - work.west_m) / b)))
        right = min(work.cols - 1, int(np.floor((x + half - work.west_m) / b)))
        if right < left:
            continue
        for m in range(work.first[row * work.cols + left], work.first[row * work.cols + right + 1]):
            if done[m]:
                continue
            dx = work.xyz[0, m] - x
            dy = work.xyz[1, m] - y
            dz = work.xyz[2, m] - z
            r2 = max(dx * dx + dy * dy + dz * dz, NEAREST * v2)
            if r2 >= v2 or _hidden(points, m, dx, dy, z, reach):
                continue
            g = gain / (r2 * r2)
            information[0, m] += g * dx * dx
            information[1, m] += g * dx * dy
            information[2, m] += g * dx * dz
            information[3, m] += g * dy * dy
            information[4, m] += g * dy * dz
            information[5, m] += g * dz * dz
            if lacks(information, m, points.variance_m2) == 0.0:
                done[m] = True
                completed += 1
    return completed
