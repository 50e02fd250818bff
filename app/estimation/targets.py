"""Moving targets from ranges alone: an extended Kalman filter with a constant-velocity model each (MED13, NGCUV12).

A range says nothing of the direction, and ranges from vehicles in a row leave mirror images. A target's first range
therefore starts a mixture of filters spread evenly over the water that it may be in; every range updates all of them
and weighs each by how well it predicted that range. Once the mixture is narrow enough to linearise about, it becomes
a single filter. Only while its standard deviations are small does a target belong to the set ``A`` (MED13): unlike a
landmark it leaves that set again.

A vehicle that comes close to a target ranges it from a place beside which the filter is wide, above all along depth.
Then what the filter says is cut into parts along the sphere of that range first (:mod:`app.estimation.range_sphere`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.estimation.range_filter import NEAREST_M, update_by_range
from app.estimation.range_sphere import FLAT_SD, on_sphere, sphere_parts
from app.estimation.sensors import RangeSensor

EVERYWHERE = np.inf

PER_AXIS = (8, 8, 6)
"""Filters that a first range starts, along east, north and depth."""

NARROW = 0.15
"""A mixture becomes one filter when its standard deviation, all axes together, is below this part of the range, and
so small that no sphere of a range bends within it."""

WIDE = 0.7
"""Filters whose standard deviations, all axes together, are above this part of a range are cut into parts on its
sphere."""

FORGOTTEN = 1e-6
"""Weight below which a filter of a mixture is given up."""

DOUBT = 0.95
"""Power to which weights are taken before each step: linearised filters are surer of each other than they may be."""

FINE, DOUBT_FINE = 0.03, 0.8
"""Ranges of which a deviation is a smaller part than the first leave filters that are still surer of each other."""

MEMORY = 0.9
"""Weight of the past in the running mean of squared normalised innovations, which is 1 while a filter is right."""

MEMORY_RANGES = 3.0
"""Ranges that count as one step in that mean: fewer at a time change it less, so that its spread stays the same."""

TURNED, WRONG = 1.6, 2.2
"""Running means that say that a target has turned, and that the filter follows something that is not there (chance:
3 and 6 standard deviations from 1)."""


@dataclass(frozen=True)
class TargetTrack:
    """What is known of one target; every update returns a new object.

    Attributes
    ----------
    means : (k, 6)
        East, north, depth and their rates per step, of each filter of the mixture.
    covariances : (k, 6, 6)
        Their covariances.
    weights : (k,)
        Their probabilities; empty before the first range.
    surprise : float
        Mean squared normalised innovation of the last step's ranges; NaN where there were none, and while it is a
        mixture.
    unease : float
        Its running mean.
    """

    means: FloatArray
    covariances: FloatArray
    weights: FloatArray
    surprise: float = np.nan
    unease: float = 1.0

    @classmethod
    def unknown(cls) -> "TargetTrack":
        """Return a target without any range."""
        return cls(np.zeros((0, 6)), np.zeros((0, 6, 6)), np.zeros(0))

    @property
    def known(self) -> bool:
        """Whether it was ever ranged."""
        return len(self.weights) > 0

    @property
    def single(self) -> bool:
        """Whether it is a single filter by now."""
        return len(self.weights) == 1

    @property
    def state(self) -> FloatArray:
        """Mean of the mixture, (6,); NaN while unknown."""
        return np.asarray(self.weights @ self.means) if self.known else np.full(6, np.nan)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the mixture, (6, 6); infinite variances while unknown."""
        if not self.known:
            return np.diag(np.full(6, np.inf))
        off = self.means - self.state
        spread = self.covariances + off[:, :, None] * off[:, None, :]
        return np.asarray(np.tensordot(self.weights, spread, axes=1))

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviations of east, north and depth, (3,)."""
        return np.sqrt(np.diagonal(self.covariance)[:3])

    @property
    def parts_m(self) -> float:
        """Standard deviation of one filter of the mixture, all axes together, on average."""
        return float(np.sqrt(self.weights @ np.trace(self.covariances[:, :3, :3], axis1=1, axis2=2)))


@dataclass(frozen=True)
class TargetEstimator:
    """The filter; see the module's text. Time advances by 1 per step, or by what :meth:`predict` is given.

    Attributes
    ----------
    sensor : RangeSensor
        Gives the noise, and how far a target can be ranged (infinitely far by default).
    acceleration_sd : float
        Standard deviation of the change of each velocity component within a unit of time ("zero-acceleration" model).
    accuracy_sd_m : float
        A target belongs to ``A`` while its three standard deviations are below this.
    low_m, high_m : (3,)
        Box in which a target may be at its first range.
    speed_sd : float
        Standard deviation of each component of its velocity then.
    vertical : float
        Part of all these deviations that counts along depth.
    turn_sd : float or None
        In place of ``acceleration_sd`` while a target turns; None: ``speed_sd``.
    """

    sensor: RangeSensor = RangeSensor(EVERYWHERE, 0.1)  # noqa: RUF009 - frozen
    acceleration_sd: float = 0.0003
    accuracy_sd_m: float = 0.1
    low_m: tuple[float, float, float] = (-1.0, -1.0, -1.0)
    high_m: tuple[float, float, float] = (1.0, 1.0, 1.0)
    speed_sd: float = 0.006
    vertical: float = 1.0
    turn_sd: float | None = None

    def accurate(self, track: TargetTrack) -> bool:
        """Return whether a target belongs to ``A`` now."""
        return bool(track.known and (track.sd_m < self.accuracy_sd_m).all())

    def predict(self, track: TargetTrack, time: float = 1.0) -> TargetTrack:
        """Let some time pass."""
        if not track.known or time <= 0.0:
            return track
        F = transition(time)
        return replace(
            track,
            means=track.means @ F.T,
            covariances=F @ track.covariances @ F.T + self.process_noise(self._manoeuvre(track), time),
            surprise=np.nan,
        )

    def process_noise(self, acceleration_sd: float | None = None, time: float = 1.0) -> FloatArray:
        """Return the noise of some time, (6, 6), as that of so many units of it one after the other.

        The change of the velocity within one acts half on the way meanwhile.
        """
        sd = self.acceleration_sd if acceleration_sd is None else acceleration_sd
        place = time**3 / 3.0 - time / 12.0 if time > 1.0 else 0.25 * time**3
        moved, axes = 0.5 * time**2, np.diag(self._axes**2)
        return np.asarray(sd**2 * np.kron([[place, moved], [moved, time]], axes))

    @property
    def _axes(self) -> FloatArray:
        return np.array([1.0, 1.0, self.vertical])

    def _manoeuvre(self, track: TargetTrack) -> float:
        """Return the sd of the velocity's change: large after ranges that no straight course explains."""
        if track.unease <= TURNED:
            return self.acceleration_sd
        return self.speed_sd if self.turn_sd is None else self.turn_sd

    def update(
        self, track: TargetTrack, positions: FloatArray, ranges: FloatArray, blur_m2: FloatArray | None = None
    ) -> TargetTrack:
        """Take in the ranges that the vehicles measured to a target in one step.

        Parameters
        ----------
        positions : (n_vehicles, 3)
            Where they measured.
        ranges : (n_vehicles,)
            What they measured; NaN where the target was not ranged.
        blur_m2 : (n_vehicles, 3) or None
            Variances of their own positions.
        """
        heard = np.flatnonzero(np.isfinite(ranges))
        if len(heard) == 0:
            return track
        blur = np.zeros((len(positions), 3)) if blur_m2 is None else blur_m2
        nearest = heard[np.argmin(ranges[heard])]
        place, range_m = np.asarray(positions[nearest], dtype=np.float64), float(ranges[nearest])
        sd_m = float(np.sqrt((self.sensor.relative_noise * range_m) ** 2 + blur[nearest].max()))
        if not track.known:
            track = self._begun(place, range_m, sd_m)
        elif track.unease > WRONG:
            track = _or(self._begun(place, range_m, sd_m), track)
        if track.parts_m > WIDE * range_m > 0.0:
            track = self._cut(track, place, range_m, sd_m)
        means, covariances = track.means.copy(), track.covariances.copy()
        weights = track.weights ** (DOUBT_FINE if sd_m < FINE * range_m else DOUBT)
        weights /= weights.sum()
        surprise = _take(
            means, covariances, weights, np.ascontiguousarray(positions[heard], dtype=np.float64), ranges[heard],
            self.sensor.relative_noise, np.ascontiguousarray(blur[heard], dtype=np.float64),
        )  # fmt: skip
        likely = weights > FORGOTTEN
        mixture = TargetTrack(means[likely], covariances[likely], weights[likely] / weights[likely].sum())
        if mixture.single and track.single:
            mean = surprise / len(heard)
            kept = MEMORY ** (len(heard) / MEMORY_RANGES)
            return replace(mixture, surprise=mean, unease=kept * track.unease + (1.0 - kept) * mean)
        closest = float(np.abs(ranges[heard]).min())
        flat_m = np.sqrt(3.0 * FLAT_SD * closest * sd_m)
        if np.sqrt((mixture.sd_m**2).sum()) < min(NARROW * closest, flat_m):
            return TargetTrack(mixture.state[None], mixture.covariance[None], np.ones(1))
        return mixture

    def _begun(self, place_m: FloatArray, range_m: float, sd_m: float) -> TargetTrack:
        """Return filters spread over where a target may be whose first range is heard at a place (3,).

        Those of the whole box, or of the sphere alone where they are wide beside it or it bends within one by more than
        its deviation.
        """
        anywhere = self._anywhere()
        bend_m = anywhere.parts_m**2 / (3.0 * max(range_m, NEAREST_M))
        if not (range_m > 0.0 and (anywhere.parts_m > WIDE * range_m or bend_m > sd_m > 0.0)):
            return anywhere
        parts = sphere_parts(place_m, range_m, sd_m, self.low_m[2], self.high_m[2], flat=True)
        low, high = np.array(self.low_m[:2]), np.array(self.high_m[:2])
        inside = ((parts.place_m[:, :2] >= low) & (parts.place_m[:, :2] <= high)).all(axis=1)
        inside |= not inside.any()
        count = int(inside.sum())
        covariances = np.zeros((count, 6, 6))
        covariances[:, :3, :3] = parts.covariance_m2[inside]
        covariances[:, 3:, 3:] = np.diag((self.speed_sd * self._axes) ** 2)
        share = parts.share[inside]
        return TargetTrack(np.hstack([parts.place_m[inside], np.zeros((count, 3))]), covariances, share / share.sum())

    def _cut(self, track: TargetTrack, place_m: FloatArray, range_m: float, sd_m: float) -> TargetTrack:
        """Return a track in parts that are narrow beside a range heard at a place (3,)."""
        parts = sphere_parts(place_m, range_m, sd_m, self.low_m[2], self.high_m[2])
        means, covariances, score = on_sphere(track.means, track.covariances, track.weights, parts)
        weights = np.exp(score - score.max())
        likely = weights > FORGOTTEN * weights.sum()
        return replace(
            track, means=means[likely], covariances=covariances[likely], weights=weights[likely] / weights[likely].sum()
        )

    def _anywhere(self) -> TargetTrack:
        """Return filters spread evenly over the box."""
        low, high = np.array(self.low_m), np.array(self.high_m)
        sides = (high - low) / np.array(PER_AXIS)
        axes = [low[k] + sides[k] * (np.arange(PER_AXIS[k]) + 0.5) for k in range(3)]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        n = len(places)
        # Neighbours overlap without a gap: half a side is one standard deviation.
        variance = np.concatenate([(0.5 * sides) ** 2, (self.speed_sd * self._axes) ** 2])
        covariances = np.repeat(np.diag(variance)[None], n, axis=0)
        return TargetTrack(np.hstack([places, np.zeros((n, 3))]), covariances, np.full(n, 1.0 / n))


def expected_range(track: TargetTrack, position: FloatArray, noise: float, blur: FloatArray) -> tuple[float, float]:
    """Return the range that a single filter expects from ``position`` (3,), and its standard deviation.

    ``noise`` and ``blur`` (3,) as for :func:`app.estimation.range_filter.update_by_range`.
    """
    innovation, variance = update_by_range(
        track.means[0].copy(), track.covariances[0].copy(), np.asarray(position, dtype=np.float64), 0.0, noise, blur
    )
    return -float(innovation), float(np.sqrt(variance))


def _or(one: TargetTrack, other: TargetTrack) -> TargetTrack:
    """Return the mixture in which either of two may be true, as likely as not."""
    return TargetTrack(
        np.concatenate([one.means, other.means]),
        np.concatenate([one.covariances, other.covariances]),
        np.concatenate([one.weights, other.weights]) / 2.0,
    )


def transition(time: float = 1.0) -> FloatArray:
    """Return the constant-velocity transition of some time, (6, 6)."""
    F = np.eye(6)
    F[:3, 3:] = time * np.eye(3)
    return F


@njit(cache=True, nogil=True)
def _take(
    means: FloatArray,
    covariances: FloatArray,
    weights: FloatArray,
    positions: FloatArray,
    ranges: FloatArray,
    noise: float,
    blur: FloatArray,
) -> float:
    """Update all filters in place by all ranges; return the last one's summed squared normalised innovations."""
    surprise = 0.0
    scores = np.log(weights)
    for h in range(len(weights)):
        surprise = 0.0
        for k in range(len(ranges)):
            innovation, variance = update_by_range(means[h], covariances[h], positions[k], ranges[k], noise, blur[k])
            surprise += innovation * innovation / variance
            scores[h] -= 0.5 * (innovation * innovation / variance + np.log(variance))
    likely = np.exp(scores - scores.max())
    weights[:] = likely / likely.sum()
    return surprise


@njit(cache=True, nogil=True)
def foretold_sd(
    mean: FloatArray, covariance: FloatArray, configurations: FloatArray, noise: float, hearing: float, sd: float
) -> FloatArray:
    """Return, for each team configuration (c, n_vehicles, 3), the greatest standard deviation it would leave, (c,).

    ``mean`` (6,) and ``covariance`` (6, 6) are the target's as predicted for that time; every vehicle closer than
    ``hearing`` is taken to range to it once, and to find it where it is expected. ``sd`` is the part of the
    noise that is the same at any distance.
    """
    result = np.empty(len(configurations))
    blur = np.full(3, sd * sd)
    for c in range(len(configurations)):
        m, P = mean.copy(), covariance.copy()
        for i in range(configurations.shape[1]):
            r = np.sqrt(((m[:3] - configurations[c, i]) ** 2).sum())
            if r < hearing:
                here = m.copy()
                update_by_range(here, P, configurations[c, i], r, noise, blur)
        worst = 0.0
        for k in range(3):
            worst = max(worst, P[k, k])
        result[c] = np.sqrt(worst)
    return result
