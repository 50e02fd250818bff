"""The sphere on which a range leaves its target, as Gaussian parts, and what is left of filters on it.

An extended Kalman filter takes a range along one direction. That is right while the filter is narrow beside the range.
A wide one, of which parts lie before, behind and beside the vehicle, is cut into parts that are narrow: each is what
the filter says about one piece of the sphere.
"""

from typing import NamedTuple

import numpy as np

from app.arrays import FloatArray

AROUND, UPWARDS = 32, 9
"""Parts of a sphere by azimuth and by elevation, at least."""

MOST_AROUND, MOST_UPWARDS = 64, 32
"""The same at most: as many as it takes for flat parts."""

FLAT_SD = 0.3
"""A part of a sphere is flat when it departs from a plane by at most this many deviations of its range. A linearised
filter takes what it departs by for noise, another one at every range, and averages it out."""

THICK = 0.3
"""A sphere is this thick to begin with, in radii: the range itself, taken after that, makes it thin."""

HEAVIEST = 64
"""So many filters of a mixture are looked at."""


class SphereParts(NamedTuple):
    """Gaussian parts of a sphere: places (k, 3), their covariances (k, 3, 3), and their shares of its area, (k,)."""

    place_m: FloatArray
    covariance_m2: FloatArray
    share: FloatArray


def sphere_parts(
    centre_m: FloatArray, radius_m: float, sd_m: float, low_m: float, high_m: float, *, flat: bool = False
) -> SphereParts:
    """Return the parts of a sphere between two depths.

    Parameters
    ----------
    centre_m : (3,)
        East, north, and depth, positive down.
    sd_m
        How exactly its radius is known.
    low_m, high_m
        Least and greatest depth. A sphere that does not reach them ends at its nearest place.
    flat
        As many parts as it takes for all to be flat, up to ``MOST_AROUND`` by ``MOST_UPWARDS``.
    """
    below_m = np.clip(np.array([low_m, high_m]) - centre_m[2], -radius_m, radius_m)
    lowest, highest = np.arcsin(below_m / radius_m)
    upwards_count, around = UPWARDS, AROUND
    if flat:
        widest = 2.0 * np.sqrt(FLAT_SD * np.sqrt(2.0) * max(sd_m / radius_m, 1e-9))
        upwards_count = int(np.clip(np.ceil((highest - lowest) / widest), UPWARDS, MOST_UPWARDS))
        around = int(np.clip(np.ceil(2.0 * np.pi / widest), AROUND, MOST_AROUND))
    edges = np.linspace(lowest, highest, upwards_count + 1)
    elevation = np.repeat(0.5 * (edges[1:] + edges[:-1]), around)
    azimuth = np.tile(2.0 * np.pi / around * np.arange(around), upwards_count)
    zero, level = np.zeros_like(azimuth), np.cos(elevation)
    outwards = np.column_stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])
    sideways = np.column_stack([np.cos(azimuth), -np.sin(azimuth), zero])
    upwards = np.cross(outwards, sideways)
    # Neighbours overlap without a gap: half of the way between them is one standard deviation.
    aside_m = np.maximum(np.pi / around * radius_m * level, sd_m)
    up_m = max(0.5 * (edges[1] - edges[0]) * radius_m, sd_m)
    thick_m = max(THICK * radius_m, sd_m)
    covariance = (
        thick_m**2 * _outer(outwards) + up_m**2 * _outer(upwards) + (aside_m**2)[:, None, None] * _outer(sideways)
    )
    return SphereParts(centre_m + radius_m * outwards, covariance, level / level.sum())


def on_sphere(
    means: FloatArray, covariances: FloatArray, weights: FloatArray, parts: SphereParts
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what a mixture of filters says about each part of a sphere: means, covariances, and log likelihoods (k,).

    Parameters
    ----------
    means : (n, d)
        The first three are the place.
    covariances : (n, d, d)
    weights : (n,)
    """
    heavy = np.argsort(-weights, kind="stable")[:HEAVIEST]
    P, m = covariances[heavy, None], means[heavy, None]
    off = parts.place_m - m[..., :3]
    S = P[..., :3, :3] + parts.covariance_m2
    gain = P[..., :3] @ np.linalg.inv(S)
    own = m + np.einsum("nkij,nkj->nki", gain, off)
    left = P - gain @ np.swapaxes(P[..., :3], -1, -2)
    surprise = np.einsum("nki,nki->nk", off, np.linalg.solve(S, off[..., None])[..., 0])
    score = np.log(weights[heavy, None] * parts.share) - 0.5 * (surprise + np.linalg.slogdet(S)[1])
    most = score.max(axis=0)
    share = np.exp(score - most)
    total = share.sum(axis=0)
    share /= total
    mean = np.einsum("nk,nki->ki", share, own)
    spread = own - mean
    covariance = np.einsum("nk,nkij->kij", share, left) + np.einsum("nk,nki,nkj->kij", share, spread, spread)
    return mean, 0.5 * (covariance + np.swapaxes(covariance, -1, -2)), most + np.log(total)


def _outer(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors[:, :, None] * vectors[:, None, :])
