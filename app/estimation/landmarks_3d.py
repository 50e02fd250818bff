"""Landmarks whose whole position is unknown: an extended Kalman filter per landmark, from ranges (MED13, NGCUV12).

A range says nothing of the direction. The first look therefore starts a bundle of filters, spread evenly over the
sphere round the vehicle, as far as it lies where landmarks may be; every further look updates all of them and weighs
each by how well it predicted the range, as in a Gaussian-sum filter. Once the bundle as a whole is narrow enough to be
linearised about, it becomes a single filter with the bundle's mean and covariance. The predicted range's mean and
variance are of second order, which keeps the covariance honest while a point is still uncertain across the beam.

All ranges of a dive share the error of the vehicle's own place, so it does not average out. It is a state that is
considered, not estimated (Schmidt's filter): each landmark keeps its covariance with the error of every vehicle. That
error grows by independent steps, and a fix leaves of it what the variance after says of the variance before. Between
two vehicles it is taken to be as common as it can be, because they share fixes and range to each other.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import ndtr

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.depth_posterior import STEEP, TYPICAL_SLOPE
from app.estimation.sensors import RangeSensor, Ranging

BUNDLE = 96
"""Filters that a first look starts on a whole sphere; those where no landmark may be have no weight."""

OUTSIDE = 0.1
"""A filter of which less than this part lies where landmarks may be is not started."""

NARROW = 0.15
"""A bundle becomes one filter when its standard deviation, all axes together, is below this part of the range."""


LEAST_NOISE = 1e-6
"""Of a range, relative: with less, rounding would make covariances that are none."""


@dataclass(frozen=True)
class Landmarks3D:
    """What is known of ``n`` points; every update returns a new object.

    Attributes
    ----------
    position_m : (n, 3)
        Estimates; NaN where never seen.
    covariance_m2 : (n, 3, 3)
        Their covariances; inf on the diagonal where never seen.
    looks : (n,)
        How often each was measured.
    accurate : (n,)
        The set ``A``; only grows.
    credited : (n,)
        Which vehicle brought the landmark into ``A``; -1 where none did.
    spread : (k,)
        The landmarks that still are a bundle of filters.
    means, covariances, weights : (k, BUNDLE, 3), (k, BUNDLE, 3, 3), (k, BUNDLE)
        The bundles.
    blur_m2 : (n_vehicles,)
        Variance of each vehicle's own place, along east and along north, when it measured last; those who always knew
        their place need none.
    shared_m2 : (n, n_vehicles, 3, 2)
        Covariance of each landmark's error with that of each vehicle's place.
    """

    position_m: FloatArray
    covariance_m2: FloatArray
    looks: IntArray
    accurate: BoolArray
    credited: IntArray
    spread: IntArray
    means: FloatArray
    covariances: FloatArray
    weights: FloatArray
    blur_m2: FloatArray
    shared_m2: FloatArray

    @classmethod
    def unknown(cls, n: int) -> "Landmarks3D":
        """Return ``n`` landmarks that are still unseen."""
        covariance = np.zeros((n, 3, 3))
        covariance[:, range(3), range(3)] = np.inf
        return cls(
            np.full((n, 3), np.nan),
            covariance,
            np.zeros(n, dtype=np.int64),
            np.zeros(n, dtype=np.bool_),
            np.full(n, -1, dtype=np.int64),
            np.zeros(0, dtype=np.int64),
            np.zeros((0, BUNDLE, 3)),
            np.zeros((0, BUNDLE, 3, 3)),
            np.zeros((0, BUNDLE)),
            np.zeros(0),
            np.zeros((n, 0, 3, 2)),
        )

    @property
    def fixed(self) -> BoolArray:
        """Which landmarks are a single filter by now, (n,)."""
        result = self.looks > 0
        result[self.spread] = False
        return np.asarray(result, dtype=np.bool_)

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviations of east, north and depth, (n, 3)."""
        return np.sqrt(np.diagonal(self.covariance_m2, axis1=1, axis2=2))


@dataclass(frozen=True)
class Landmark3DEstimator:
    """The filter; see the module's text.

    Attributes
    ----------
    sensor : Ranging
        Gives the noise: ``y = r (1 + noise xi)``.
    accuracy_sd_m : float
        A landmark belongs to ``A`` once all three standard deviations are below this (MED13 footnote 3).
    visit_cap : int
        A landmark measured more often than this counts as accurate too (AURO15 footnote 3).
    low_m, high_m : (3,)
        Box in which the landmarks are known to lie.
    """

    sensor: Ranging = RangeSensor()  # noqa: RUF009 - frozen
    accuracy_sd_m: float = 0.02
    visit_cap: int = 200
    low_m: tuple[float, float, float] = (-np.inf, -np.inf, -np.inf)
    high_m: tuple[float, float, float] = (np.inf, np.inf, np.inf)

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
        """Take in the ranges that one vehicle measured.

        Parameters
        ----------
        vehicle : int
            Row of the vehicle, to be credited with the landmarks it completes.
        position : (3,)
            Where it measured.
        index : (k,)
            Which landmarks it measured, each at most once.
        ranges : (k,)
            The noisy ranges.
        position_sd_m : float
            Standard deviation of the vehicle's own place, along east and along north, which all ranges of a dive share.
        floor_m : float
            Depth of the sea floor under the vehicle, where landmarks lie on it: they are first looked for where it
            need not be steep to reach them. NaN where they may lie in the water.
        """
        noise = max(self.sensor.relative_noise, LEAST_NOISE)
        where = np.asarray(position, dtype=np.float64)
        mean, covariance, looks = landmarks.position_m.copy(), landmarks.covariance_m2.copy(), landmarks.looks.copy()
        first = index[looks[index] == 0]
        spread = np.concatenate([landmarks.spread, first])
        means, covariances, weights = self._start(where, ranges[looks[index] == 0], floor_m)
        covariances[..., range(2), range(2)] += position_sd_m**2
        means = np.concatenate([landmarks.means, means])
        covariances = np.concatenate([landmarks.covariances, covariances])
        weights = np.concatenate([landmarks.weights, weights])
        row = np.full(len(looks), -1, dtype=np.int64)
        row[spread] = np.arange(len(spread))
        blur, shared = _shared(landmarks, vehicle, position_sd_m**2)
        errors = np.minimum(blur[:, None], blur)
        observer = vehicle if vehicle < len(blur) else -1
        shared[first] = 0.0
        if observer >= 0:
            shared[first, :, 0, 0] = shared[first, :, 1, 1] = errors[observer]
        measured = _Measured(where, index, ranges, noise, observer, errors)
        single = _take(measured, looks, row, mean, covariance, shared, _Bundles(means, covariances, weights))
        looks[index] += 1

        variance = covariance[index][:, range(3), range(3)]
        done = (variance < self.accuracy_sd_m**2).all(axis=1) | (looks[index] > self.visit_cap)
        accurate, credited = landmarks.accurate.copy(), landmarks.credited.copy()
        fresh = index[done & ~accurate[index]]
        accurate[fresh] = True
        credited[fresh] = vehicle
        still = ~single
        return Landmarks3D(
            mean,
            covariance,
            looks,
            accurate,
            credited,
            spread[still],
            means[still],
            covariances[still],
            weights[still],
            blur,
            shared,
        )

    def _start(
        self, position: FloatArray, ranges: FloatArray, floor_m: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return bundles on the sphere about ``position`` (3,), one for each of ``ranges`` (k,)."""
        i = np.arange(BUNDLE) + 0.5
        down = 2.0 * i / BUNDLE - 1.0
        azimuth = np.pi * (1.0 + np.sqrt(5.0)) * i
        flat = np.sqrt(1.0 - down**2)
        u = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), down])
        # Half the side of a filter's share of the sphere, in ranges: neighbours overlap without a gap.
        across = 0.5 * np.sqrt(4.0 * np.pi / BUNDLE)
        along = u[:, :, None] * u[:, None, :]
        shape = max(self.sensor.relative_noise, LEAST_NOISE) ** 2 * along + across**2 * (np.eye(3) - along)
        means = position + ranges[:, None, None] * (1.0 - across**2) * u
        covariances = ranges[:, None, None, None] ** 2 * shape
        sd = ranges[:, None, None] * np.sqrt(np.diagonal(shape, axis1=1, axis2=2))
        inside = (ndtr((self.high_m - means) / sd) - ndtr((self.low_m - means) / sd)).prod(axis=-1)
        weights = np.where(inside < OUTSIDE, 0.0, inside)
        if np.isfinite(floor_m):
            steepness = np.abs(means[..., 2] - floor_m) / (ranges[:, None] * flat)
            weights *= np.exp(-steepness / TYPICAL_SLOPE) + STEEP
        weights[weights.sum(axis=1) == 0.0] = 1.0  # a range that leads out of the box: anywhere
        return means, covariances, weights / weights.sum(axis=1, keepdims=True)


def _shared(landmarks: Landmarks3D, vehicle: int, blur_m2: float) -> tuple[FloatArray, FloatArray]:
    """Return the vehicles' variances and the landmarks' covariances with their errors, one vehicle's brought up to now.

    A vehicle that is uncertain for the first time gets its place in both; without any they stay empty.
    """
    blur, shared = landmarks.blur_m2.copy(), landmarks.shared_m2.copy()
    lacking = vehicle + 1 - len(blur)
    if lacking > 0:
        if blur_m2 == 0.0:
            return blur, shared
        likewise = _shared_by_newcomer(blur, shared, blur_m2)[:, None]
        blur = np.concatenate([blur, np.zeros(lacking - 1), [blur_m2]])
        shared = np.concatenate([shared, np.zeros((len(shared), lacking - 1, 3, 2)), likewise], axis=1)
    if blur_m2 < blur[vehicle]:
        shared[:, vehicle] *= blur_m2 / blur[vehicle]
    blur[vehicle] = blur_m2
    return blur, shared


def _shared_by_newcomer(blur: FloatArray, shared: FloatArray, blur_m2: float) -> FloatArray:
    """Return the landmarks' covariances (n, 3, 2) with the error of one more vehicle, from those with the others'.

    What is most common to errors of different variances is what a walk has in common with itself: it is interpolated.
    """
    order = np.argsort(blur, kind="stable")
    steps = np.append(0.0, blur[order])
    above = int(np.searchsorted(steps, blur_m2))
    if above == len(steps):
        return np.asarray(shared[:, order[-1]] if len(order) else np.zeros((len(shared), 3, 2)))
    part = (blur_m2 - steps[above - 1]) / max(steps[above] - steps[above - 1], 1e-300)
    below = shared[:, order[above - 2]] if above > 1 else 0.0
    return np.asarray((1.0 - part) * below + part * shared[:, order[above - 1]])


class _Measured(NamedTuple):
    """What one vehicle measured at ``position`` (3,): ``ranges`` (k,) of ``landmarks`` (k,), by number.

    ``noise`` is relative to a range, ``errors`` (n_vehicles, n_vehicles) the covariances of the vehicles' own places
    along east and along north, m^2, and ``observer`` the vehicle's row there, -1 where it knows its place.
    """

    position: FloatArray
    landmarks: IntArray
    ranges: FloatArray
    noise: float
    observer: int
    errors: FloatArray


class _Bundles(NamedTuple):
    """The bundles' filters, as in ``Landmarks3D``."""

    means: FloatArray
    covariances: FloatArray
    weights: FloatArray


@njit(cache=True, nogil=True)
def _take(
    measured: _Measured,
    looks: IntArray,
    row: IntArray,
    mean: FloatArray,
    covariance: FloatArray,
    shared: FloatArray,
    bundles: _Bundles,
) -> BoolArray:
    """Update everything in place; return which bundles have become a single filter.

    ``looks``, ``mean``, ``covariance``, ``shared`` are of all landmarks; ``row`` is the bundle of each, -1 for a single
    filter.
    """
    means, covariances, weights = bundles
    single = np.zeros(len(means), dtype=np.bool_)
    gains, directions = np.zeros((BUNDLE, 3)), np.zeros((BUNDLE, 3))
    certain = np.ones(1)
    for k in range(len(measured.landmarks)):
        m, y = measured.landmarks[k], measured.ranges[k]
        b = row[m]
        if b < 0:
            _filter(mean[m], covariance[m], shared[m], measured, y, gains[0], directions[0])
            _update_shared(shared[m], measured, certain, gains, directions)
            _limit_shared(shared[m], covariance[m], measured.errors)
            continue
        if looks[m] > 0:
            _weigh(means[b], covariances[b], weights[b], shared[m], measured, y, gains, directions)
            _update_shared(shared[m], measured, weights[b], gains, directions)
        _match(means[b], covariances[b], weights[b], mean[m], covariance[m])
        _limit_shared(shared[m], covariance[m], measured.errors)
        spread = covariance[m, 0, 0] + covariance[m, 1, 1] + covariance[m, 2, 2]
        single[b] = spread < (NARROW * y) ** 2
    return single


@njit(cache=True, nogil=True)
def _filter(
    mean: FloatArray,
    covariance: FloatArray,
    shared: FloatArray,
    measured: _Measured,
    y: float,
    gain: FloatArray,
    direction: FloatArray,
) -> float:
    """Kalman update in place; return the log-likelihood of the range (up to a constant).

    Set ``gain`` (3,) and ``direction`` (3,), the direction from the vehicle to the landmark.
    """
    noise, observer = measured.noise, measured.observer
    u = mean - measured.position
    r = max(np.sqrt((u * u).sum()), 1e-9)
    u /= r
    # Covariance of landmark minus vehicle, which is what the range sees, and of the landmark with that.
    D = covariance.copy()
    Pu = np.zeros(3)
    part = _possible_part(covariance, shared[observer], measured.errors[observer, observer]) if observer >= 0 else 0.0
    for i in range(3):
        for j in range(3):
            Pu[i] += covariance[i, j] * u[j]
        if observer >= 0:
            for j in range(2):
                common = part * shared[observer, i, j]
                Pu[i] -= common * u[j]
                D[i, j] -= common
                D[j, i] -= common
    if observer >= 0:
        for j in range(2):
            D[j, j] += measured.errors[observer, observer]
    Du = np.zeros(3)
    for i in range(3):
        for j in range(3):
            Du[i] += D[i, j] * u[j]
    along = max((u * Du).sum(), 0.0)
    # The Hessian of the range is (I - u u') / r; its traces with D and with D Hessian D.
    across = max(D[0, 0] + D[1, 1] + D[2, 2] - along, 0.0) / r
    twice = max((D * D).sum() - 2.0 * (Du * Du).sum() + along * along, 0.0) / (r * r)
    predicted = r + 0.5 * across
    variance = along + 0.5 * twice + noise * noise * (predicted * predicted + along)
    innovation = y - predicted
    for i in range(3):
        gain[i] = Pu[i] / variance
        direction[i] = u[i]
        mean[i] += gain[i] * innovation
        for j in range(3):
            covariance[i, j] -= Pu[i] * Pu[j] / variance
    return float(-0.5 * (innovation * innovation / variance + np.log(variance)))


@njit(cache=True, nogil=True)
def _update_shared(
    shared: FloatArray, measured: _Measured, weights: FloatArray, gains: FloatArray, directions: FloatArray
) -> None:
    """Update a landmark's covariances with the vehicles' errors (n_vehicles, 3, 2) in place.

    ``gains`` and ``directions`` are those of its filters, whose ``weights`` (k,) sum to 1.
    """
    for v in range(len(shared)):
        less = np.zeros((3, 2))
        for h in range(len(weights)):
            if weights[h] > 0.0:
                for j in range(2):
                    told = 0.0
                    for i in range(3):
                        told += directions[h, i] * shared[v, i, j]
                    if measured.observer >= 0:
                        told -= directions[h, j] * measured.errors[measured.observer, v]
                    for i in range(3):
                        less[i, j] += weights[h] * gains[h, i] * told
        shared[v] -= less


@njit(cache=True, nogil=True)
def _limit_shared(shared: FloatArray, covariance: FloatArray, errors: FloatArray) -> None:
    """Leave a landmark no more covariance with a vehicle's error (n_vehicles, 3, 2) than there can be, in place.

    What is taken to be common to vehicles may say more: they have fixes at different times.
    """
    for v in range(len(shared)):
        shared[v] *= _possible_part(covariance, shared[v], errors[v, v])


@njit(cache=True, nogil=True, error_model="numpy")
def _possible_part(covariance: FloatArray, shared: FloatArray, error: float) -> float:
    """Return which part of a covariance with a vehicle's error (3, 2) there can be: 1 where all of it.

    ``covariance`` (3, 3) less what the error, of variance ``error`` along either axis, explains of it is one, too.
    """
    if error <= 0.0:
        return 0.0
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    d, e, f = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    inverse = np.array(
        (
            (d * f - e * e, c * e - b * f, b * e - c * d),
            (c * e - b * f, a * f - c * c, b * c - a * e),
            (b * e - c * d, b * c - a * e, a * d - b * b),
        )
    )
    determinant = a * inverse[0, 0] + b * inverse[0, 1] + c * inverse[0, 2]
    if determinant <= 0.0:
        return 0.0
    explained = np.zeros((2, 2))
    for p in range(2):
        for q in range(2):
            for i in range(3):
                for j in range(3):
                    explained[p, q] += shared[i, p] * inverse[i, j] * shared[j, q]
    explained /= determinant * error
    half = 0.5 * (explained[0, 0] + explained[1, 1])
    off = 0.25 * (explained[0, 0] - explained[1, 1]) ** 2 + explained[0, 1] * explained[1, 0]
    most = half + np.sqrt(max(off, 0.0))
    return 1.0 if most <= 1.0 else 1.0 / np.sqrt(most)


@njit(cache=True, nogil=True)
def _weigh(
    means: FloatArray,
    covariances: FloatArray,
    weights: FloatArray,
    shared: FloatArray,
    measured: _Measured,
    y: float,
    gains: FloatArray,
    directions: FloatArray,
) -> None:
    """Update a bundle in place; filters that have lost all weight are left as they are."""
    scores = np.full(len(weights), -np.inf)
    for h in range(len(weights)):
        if weights[h] > 0.0:
            scores[h] = np.log(weights[h]) + _filter(
                means[h], covariances[h], shared, measured, y, gains[h], directions[h]
            )
    likely = np.exp(scores - scores.max())
    likely = np.where(likely < 1e-9, 0.0, likely)
    weights[:] = likely / likely.sum()


@njit(cache=True, nogil=True)
def _match(
    means: FloatArray, covariances: FloatArray, weights: FloatArray, mean: FloatArray, covariance: FloatArray
) -> None:
    """Set mean (3,) and covariance (3, 3) to those of the bundle."""
    mean[:] = 0.0
    covariance[:] = 0.0
    for h in range(len(weights)):
        if weights[h] > 0.0:
            for i in range(3):
                mean[i] += weights[h] * means[h, i]
    for h in range(len(weights)):
        if weights[h] > 0.0:
            for i in range(3):
                for j in range(3):
                    off = (means[h, i] - mean[i]) * (means[h, j] - mean[j])
                    covariance[i, j] += weights[h] * (covariances[h, i, j] + off)
