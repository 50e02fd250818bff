"""Where the map is likely to be wrong, and by how much more than elsewhere: the roughness that a plan weighs with.

The Gaussian process states a deviation, but it has learned from soundings along a few lines how variable the whole
area is. Its map shows more: between two lines the error is larger where the map is steep or bends. The law

    squared error ~ variance^a  roughness^b  distance^c  slope^d  bend^e

(distance to the nearest sounding, squared; squared slope about the mean slope and squared curvature of the map,
averaged over the surroundings) was fitted to the true errors of maps from coarse survey lines over sixteen sea floors,
each predicted by the law fitted to the other fifteen. It predicts errors better than the variance alone on all patchy
ones and about as well on the others.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.exploration.core.problem import Belief, Situation

VARIANCE_POWER, ROUGHNESS_POWER, DISTANCE_POWER, SLOPE_POWER, BEND_POWER = 0.67, 0.35, 0.15, 0.18, 0.13
SLOPE_SMOOTHING, BEND_SMOOTHING = 2.5, 1.0
"""Standard deviations of the averages, in spacings of the landmarks."""
FEATURE_FLOOR = 0.1
"""Part of the mean that is added to squared slope and curvature: what is quite flat may yet hide something."""
NEAR_PART = 0.3
"""Distances are not taken as smaller than this part of the spacing of the survey lines."""
WEIGHT_RANGE = (0.02, 50.0)
HEDGE = 0.25
"""Part of the roughness that is spread evenly: what no sounding has met may be anywhere."""
TRUSTED_TO = 1.25
"""Farther from all soundings, in spacings of the survey lines, less and less is known of the roughness."""

LEAST_RANGE, MOST_NOISE = 0.05, 10.0
"""Over a smaller range of distances nothing is learned of the noise; a larger part of it than this is taken as this."""

SECOND_LOOK = 30.0
"""Weight of a place whose only sounding is doubted: is there a rock, or was it a fish?"""
LOOK_WITHIN, LOOK_WITHIN_M = 0.6, 6.0
"""How far around, in spacings of the survey lines, and at most: a rock is no larger where lines are far apart."""
MOST_DOUBTS = 0.01
"""Where a larger part of the soundings is doubted the sounder is to blame, and second looks would cost the survey."""


@dataclass(frozen=True)
class RoughnessRaster:
    """Landmarks put on a grid: ``cell`` (n,) is the place of each in the flattened ``shape``."""

    shape: tuple[int, int]
    cell: IntArray
    cell_m: float

    @classmethod
    def of(cls, xy_m: FloatArray) -> "RoughnessRaster":
        """Return the raster for landmarks at ``xy_m`` (n, 2), its cells as wide as they are apart."""
        distance = np.asarray(cKDTree(xy_m).query(xy_m, k=2)[0])
        cell_m = max(float(np.median(distance[:, 1])), float(np.ptp(xy_m, axis=0).max()) / 200.0, 1e-9)
        at = np.rint((xy_m - xy_m.min(axis=0)) / cell_m).astype(np.int64)
        cols, rows = (int(k) + 1 for k in at.max(axis=0))
        return cls((rows, cols), at[:, 1] * cols + at[:, 0], cell_m)

    def fill(self, values: FloatArray) -> FloatArray:
        """Return ``values`` (n,) on the raster; cells without a finite one take that of the nearest with one."""
        known = np.isfinite(values)
        raster = np.full(self.shape, np.nan)
        raster.ravel()[self.cell[known]] = values[known]
        missing = np.isnan(raster)
        if missing.any():
            nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
            raster = raster[tuple(nearest)]
        return raster


def expected_roughness(belief: Belief, distance_m: FloatArray, spacing_m: float) -> FloatArray:
    """Return how large squared errors are expected to be at the landmarks at equal distance to soundings, (n,), mean 1.

    Parameters
    ----------
    distance_m : (n,)
        From each landmark to the nearest sounding.
    spacing_m : float
        Of the survey lines that the mission pays for.
    """
    known = np.isfinite(belief.depth_m) & np.isfinite(belief.sd_m)
    if known.sum() < 9:
        return np.ones(len(belief.xy_m))
    raster = RoughnessRaster.of(belief.xy_m)
    if min(raster.shape) < 3:
        return np.ones(len(belief.xy_m))
    depth, variance = (raster.fill(np.where(known, v, np.nan)) for v in (belief.depth_m, belief.sd_m**2))
    squared_distance = raster.fill(distance_m) ** 2 + (NEAR_PART * spacing_m) ** 2
    d_north, d_east = np.gradient(depth, raster.cell_m)
    slope = (d_east - d_east.mean()) ** 2 + (d_north - d_north.mean()) ** 2
    bend = sum(part**2 for d in (d_north, d_east) for part in np.gradient(d, raster.cell_m))
    error = (
        np.maximum(variance, 1e-12) ** VARIANCE_POWER
        * np.maximum(raster.fill(belief.weight), 1e-6) ** ROUGHNESS_POWER
        * squared_distance**DISTANCE_POWER
        * _averaged(slope, SLOPE_SMOOTHING) ** SLOPE_POWER
        * _averaged(np.asarray(bend), BEND_SMOOTHING) ** BEND_POWER
    )
    blur = max(1.0, 0.25 * spacing_m / raster.cell_m)
    roughness = gaussian_filter(error, blur, mode="nearest") / gaussian_filter(squared_distance, blur, mode="nearest")
    roughness = roughness.ravel()[raster.cell]
    roughness = np.clip(roughness / roughness.mean(), *WEIGHT_RANGE)
    trust = (1.0 - HEDGE) * np.exp(-np.maximum(0.0, distance_m / spacing_m - TRUSTED_TO))
    return np.asarray(trust * roughness / roughness.mean() + 1.0 - trust)


def noise_part(belief: Belief, distance_m: FloatArray, scale_m: float) -> float:
    """Return the squared error that is left where soundings are, over the most that distance adds to it.

    The map's variance grows with the distance D to the nearest sounding as x / (1 + x) with x = (D / l)^2 (see
    :mod:`.value`); what it is at none is the sounder's noise, which better places for lines do not lower.

    Parameters
    ----------
    distance_m : (n,)
        From each landmark to the nearest sounding.
    scale_m : float
        The length l.
    """
    known = np.isfinite(belief.depth_m) & np.isfinite(belief.sd_m)
    x = (distance_m[known] / scale_m) ** 2
    grows = x / (1.0 + x)
    if known.sum() < 9 or float(np.ptp(grows)) < LEAST_RANGE:
        return 0.0
    slope, at_none = np.polyfit(grows, belief.sd_m[known] ** 2, 1)
    if slope <= 0.0:
        return MOST_NOISE
    return float(np.clip(at_none / slope, 0.0, MOST_NOISE))


def with_second_looks(roughness: FloatArray, team: Situation, spacing_m: float) -> FloatArray:
    """Return the landmarks' roughness (n,) raised around soundings that are doubted."""
    doubtful = team.doubtful_en_m
    if not 0 < len(doubtful) <= max(1.0, MOST_DOUBTS * (len(doubtful) + len(team.soundings_en_m))):
        return roughness
    within_m = min(LOOK_WITHIN * spacing_m, LOOK_WITHIN_M)
    away = np.asarray(cKDTree(doubtful).query(team.belief.xy_m)[0])
    # Landmarks farther apart than a rock is wide stand for more ground than is looked at again.
    apart_m = float(np.sqrt(np.prod(np.ptp(team.belief.xy_m, axis=0)) / max(len(away) - 1, 1)))
    reach_m = max(within_m, apart_m / np.sqrt(2.0))
    return np.where(away <= reach_m, np.maximum(roughness, SECOND_LOOK * (within_m / reach_m) ** 2), roughness)


def _averaged(squared: FloatArray, smoothing: float) -> FloatArray:
    """Return squares averaged over the surroundings, never much below the mean; all 1 where there is nothing."""
    mean = float(squared.mean())
    if not mean > 0.0:
        return np.ones_like(squared)
    return np.asarray(gaussian_filter(squared, smoothing, mode="nearest") / mean + FEATURE_FLOOR)
