"""Whether filters are as sure as they may be: NEES and NIS over many runs ."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from app.arrays import FloatArray
from app.estimation import CooperativeLocalizer, Fading, Landmark3DEstimator, Landmarks3D, RangeSensor
from app.estimation.targets import TargetEstimator, TargetTrack, transition

STEPS = 60
STEP_LENGTH = 0.05


@dataclass(frozen=True)
class Consistency:
    """A mean normalised squared error over runs, beside the interval that holds it with 95 % probability."""

    what: str
    dimensions: int
    runs: int
    mean: float
    low: float
    high: float

    @property
    def within(self) -> bool:
        """Whether it lies in the interval."""
        return self.low < self.mean < self.high


def consistency(runs: int = 100, seed: int = 0) -> list[Consistency]:
    """Return NEES and NIS of targets, of the team's places, and of landmarks."""
    rngs = [np.random.default_rng([seed, run]) for run in range(runs)]
    targets = np.array([_target(rng) for rng in rngs])
    return [
        _judge("target, NEES", 6, targets[:, 0]),
        _judge("target, NIS of three ranges", 3, targets[:, 1]),
        _judge("team of three, dead reckoning, NEES", 6, np.array([_team(rng, ranges=False) for rng in rngs])),
        _judge("team of three with ranges and fixes, NEES", 6, np.array([_team(rng, ranges=True) for rng in rngs])),
        _judge("landmark in three dimensions, NEES", 3, np.array([_landmark(rng, 0.3) for rng in rngs])),
        _judge("the same, seen from below, NEES", 3, np.array([_landmark(rng, 0.9) for rng in rngs])),
    ]


def _judge(what: str, dimensions: int, values: FloatArray) -> Consistency:
    low, high = (float(chi2.ppf(p, dimensions * len(values))) / len(values) for p in (0.025, 0.975))
    return Consistency(what, dimensions, len(values), float(values.mean()), float(low), float(high))


def _target(rng: np.random.Generator) -> tuple[float, float]:
    """Let three vehicles circle a target that the filter has found."""
    estimator = TargetEstimator()
    truth = np.concatenate([rng.uniform(-0.5, 0.5, 3), estimator.speed_sd * rng.standard_normal(3)])
    P = np.diag([0.05**2] * 3 + [estimator.speed_sd**2] * 3)
    track = TargetTrack(rng.multivariate_normal(truth, P)[None], P[None], np.ones(1))
    phase, turning = rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(0.05, 0.12, 3)
    for step in range(STEPS):
        truth = transition() @ truth + rng.multivariate_normal(np.zeros(6), estimator.process_noise())
        angle = phase + turning * step
        around = np.column_stack([np.cos(angle), np.sin(angle), 0.8 * np.sin(2.1 * angle + phase)])
        places = truth[:3] + 0.5 * around
        ranges = np.array([estimator.sensor.measure(place, truth[None, :3], rng)[0] for place in places])
        track = estimator.update(estimator.predict(track), places, ranges)
    error = truth - track.state
    return float(error @ np.linalg.solve(track.covariance, error)), 3.0 * track.surprise


def _team(rng: np.random.Generator, *, ranges: bool) -> float:
    """Let three vehicles wander; one of them surfaces every 20 steps where they range to each other."""
    fading = Fading()
    localizer = CooperativeLocalizer(fading)
    start = rng.uniform(-0.4, 0.4, (3, 3))
    truth, drift = start.copy(), fading.drift * rng.standard_normal((3, 2))
    truth[:, :2] += fading.fix_sd_m * rng.standard_normal((3, 2))
    team = localizer.begin(start)
    kept = float(fading.kept(np.array(STEP_LENGTH)))
    for step in range(STEPS):
        legs = rng.standard_normal((3, 3))
        legs *= STEP_LENGTH / np.linalg.norm(legs, axis=1, keepdims=True)
        truth = truth + legs
        truth[:, :2] += STEP_LENGTH * drift
        drift = kept * drift + np.sqrt(1.0 - kept**2) * fading.drift * rng.standard_normal((3, 2))
        team = localizer.move(team, legs)
        if ranges and step % 20 == 19:
            team = localizer.fix(team, 0, truth[0, :2] + fading.fix_sd_m * rng.standard_normal(2))
        for i, j in ((0, 1), (0, 2), (1, 2)) if ranges else ():
            distance = float(np.linalg.norm(truth[i] - truth[j]))
            team = localizer.meet(team, i, j, distance * (1.0 + fading.range_noise * rng.standard_normal()))
    error = (truth - team.positions_m)[:, :2].ravel()
    at = np.array([0, 1, 4, 5, 8, 9])
    return float(error @ np.linalg.solve(team.covariance[np.ix_(at, at)], error))


def _landmark(rng: np.random.Generator, depth: float) -> float:
    """Let three vehicles wander about a depth, above or below a landmark within sight."""
    sensor = RangeSensor()
    truth = np.array([[*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.5, 0.7)]])
    places = np.column_stack([rng.uniform(-0.2, 0.2, (3, 2)), np.full(3, depth)])
    known, estimator = Landmarks3D.unknown(1), Landmark3DEstimator(sensor)
    for _ in range(STEPS):
        move = rng.standard_normal((3, 3))
        places = places + STEP_LENGTH * move / np.linalg.norm(move, axis=1, keepdims=True)
        places = np.clip(places, [-0.2, -0.2, depth - 0.1], [0.2, 0.2, depth + 0.1])
        for j in np.flatnonzero(sensor.visible(places, truth)[:, 0]):
            ranges = sensor.measure(places[j], truth, rng)
            known = estimator.update(known, int(j), places[j], np.array([0]), ranges)
    error = (known.position_m - truth)[0]
    return float(error @ np.linalg.solve(known.covariance_m2[0], error))
