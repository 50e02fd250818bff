"""The transformed objective J + J1 + J2 + J3 (AURO15 eq. 8-15), each term on its own.

The printed switches of eq. (11), (13) and (15) are upside down; the text is followed: a switch is 0 while the vehicle
still gains accurate landmarks and K otherwise, and the last one opens only when J, J1 and J2 of that vehicle all stand
still. The inner norm of eq. (12) and (14) is the squared distance of landmark l to its closest vehicle, and a landmark
counts for that vehicle. Time advances by 1 per step.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.estimation.landmarks import LandmarkSets

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class ObjectiveWeights:
    """The design constants of AURO15: K1, K2, K3 and the thresholds eps1 (landmarks), eps2, eps3."""

    K1: float = 1.0
    K2: float = 1.0
    K3: float = 1.0
    eps1: float = 0.0
    eps2: float = 1e-9
    eps3: float = 1e-9


@dataclass(frozen=True)
class VehicleProgress:
    """What the switches compare, (n_vehicles,) each: |A_j|, and J1_j and J2_j without their switches."""

    accurate: FloatArray
    J1: FloatArray
    J2: FloatArray


@dataclass(frozen=True)
class Objective:
    """The terms at one time; :attr:`total` is eq. (9)."""

    J: float
    J1: float
    J2: float
    J3: float
    progress: VehicleProgress = field(repr=False)

    @property
    def total(self) -> float:
        """J + J1 + J2 + J3."""
        return self.J + self.J1 + self.J2 + self.J3

    @property
    def terms(self) -> dict[str, float]:
        """The terms by name, for reports."""
        return {"J": self.J, "J1": self.J1, "J2": self.J2, "J3": self.J3}


def closest_squared(positions: FloatArray, points: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the squared distance of each point (n, 3) to its closest vehicle (n_vehicles, 3), and that vehicle."""
    squared = ((positions[:, None, :] - points[None, :, :]) ** 2).sum(axis=2)
    closest = squared.argmin(axis=0)
    return squared[closest, np.arange(len(points))], closest


def switches(
    earlier: VehicleProgress | None, before: VehicleProgress | None, weights: ObjectiveWeights
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return s1, s2, s3 per vehicle from the progress at t-2 and t-1; None when there is no such history yet."""
    if earlier is None or before is None or len(earlier.accurate) != len(before.accurate):
        return None
    stuck = before.accurate - earlier.accurate <= weights.eps1
    still = stuck & (np.abs(before.J1 - earlier.J1) <= weights.eps2) & (np.abs(before.J2 - earlier.J2) <= weights.eps3)
    opened, last = stuck.astype(np.float64), still.astype(np.float64)
    return weights.K1 * opened, weights.K2 * opened, weights.K3 * last


def objective(
    positions: FloatArray,
    landmarks_m: FloatArray,
    sets: LandmarkSets,
    accurate_before: int,
    earlier: VehicleProgress | None = None,
    before: VehicleProgress | None = None,
    weights: ObjectiveWeights = ObjectiveWeights(),
) -> Objective:
    """Evaluate eq. (8)-(15) for a team configuration that has been taken.

    Parameters
    ----------
    positions : (n_vehicles, 3)
        The team configuration ``X_R``.
    landmarks_m : (n, 3)
        Estimated landmarks; a depth that is not known (NaN) counts as the mean of the known ones.
    sets : LandmarkSets
        The sets after the measurements taken there.
    accurate_before : int
        ``|A|`` one step before.
    earlier, before : VehicleProgress or None
        Progress at t-2 and t-1; without them every switch is open, because nothing shows that there is no deadlock.
    """
    n = len(positions)
    gained = float(sets.accurate.sum() - accurate_before)
    J1_by = sets.unfinished_by.sum(axis=1).astype(np.float64)
    J2_by = -_closest_sums(positions, landmarks_m, sets.unfinished)
    J3_by = -_closest_sums(positions, landmarks_m, sets.pending)
    opened = switches(earlier, before, weights)
    s1, s2, s3 = (
        opened
        if opened is not None
        else (
            np.full(n, weights.K1),
            np.full(n, weights.K2),
            np.full(n, weights.K3),
        )
    )
    return Objective(
        gained,
        float(s1 @ J1_by),
        float(s2 @ J2_by),
        float(s3 @ J3_by),
        VehicleProgress(sets.accurate_count_by.astype(np.float64), J1_by, J2_by),
    )


def _closest_sums(positions: FloatArray, landmarks_m: FloatArray, members: BoolArray) -> FloatArray:
    """Return, per vehicle, the sum of squared distances of the member landmarks whose closest vehicle it is."""
    if not members.any():
        return np.zeros(len(positions))
    points = landmarks_m[members].copy()
    unknown = np.isnan(points[:, 2])
    known_mean = 0.0 if unknown.all() else float(points[~unknown, 2].mean())
    points[unknown, 2] = known_mean
    squared, closest = closest_squared(positions, points)
    return np.bincount(closest, weights=squared, minlength=len(positions)).astype(np.float64)
