"""What a team configuration is worth: the transformed objective J + J1 + J2 + J3 (AURO15 eq. 8-15), or MED13's cost.

The printed switches of eq. (11), (13) and (15) are upside down; the text is followed: a switch is 0 while the vehicle
still gains accurate landmarks and K otherwise, and the last one opens only when J, J1 and J2 of that vehicle all stand
still. In eq. (12) a landmark counts for its closest vehicle, by its squared distance. In eq. (14) the printed sum runs
over all of ``B_hat``, which draws a vehicle to the middle of what is left and holds it there; the text ("the distance
between every vehicle and its closest landmark") is followed. Time advances by 1 per step.
"""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.estimation.landmarks import LandmarkSets

Terms = Literal["J", "J+J1", "J+J2", "J+J3", "J+J1+J2", "J+J1+J3", "J+J2+J3", "full", "med13"]
"""The objectives that can be chosen: AURO15's, term by term (its figure 2), or MED13's cost."""

TERMS: tuple[Terms, ...] = get_args(Terms)
MED13_K = 1.0


@dataclass(frozen=True)
class ObjectiveWeights:
    """The design constants of AURO15: K1, K2, K3 (0 switches a term off) and eps1 (landmarks), eps2, eps3.

    With infinite thresholds every switch is always open.
    """

    K1: float = 1.0
    K2: float = 1.0
    K3: float = 1.0
    eps1: float = 0.0
    eps2: float = 1e-9
    eps3: float = 1e-9

    @classmethod
    def of(cls, terms: Terms, *, switched: bool = True) -> "ObjectiveWeights":
        """Return the weights that keep the named terms of eq. (9), with switches or with all of them open."""
        named = ["J1", "J2", "J3"] if terms == "full" else terms.split("+")
        kept = (float("J1" in named), float("J2" in named), float("J3" in named))
        return cls(*kept) if switched else cls(*kept, np.inf, np.inf, np.inf)


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
    J1_by, J2_by, J3_by = _terms(
        np.ascontiguousarray(positions), with_depths(landmarks_m), sets.unfinished_by, sets.pending
    )
    opened = switches(earlier, before, weights)
    s1, s2, s3 = opened if opened is not None else (np.full(n, k) for k in (weights.K1, weights.K2, weights.K3))
    return Objective(
        gained,
        float(s1 @ J1_by),
        float(s2 @ J2_by),
        float(s3 @ J3_by),
        VehicleProgress(sets.accurate_count_by.astype(np.float64), J1_by, J2_by),
    )


def med13_objective(
    positions: FloatArray, landmarks_m: FloatArray, sets: LandmarkSets, K: float = MED13_K
) -> Objective:
    """Evaluate minus the cost of MED13 eq. (3), so that more is better; its two terms stand as J2 and J1.

    The cost is the sum, over landmarks that are visible but not accurate, of the squared distance to the closest
    vehicle, plus K for each that is neither visible nor accurate.
    """
    J1_by, J2_by, _ = _terms(
        np.ascontiguousarray(positions), with_depths(landmarks_m), sets.unfinished_by, sets.pending
    )
    hidden = int((~sets.visible & ~sets.accurate).sum())
    progress = VehicleProgress(sets.accurate_count_by.astype(np.float64), J1_by, J2_by)
    return Objective(0.0, float(-K * hidden), float(J2_by.sum()), 0.0, progress)


def with_depths(landmarks_m: FloatArray) -> FloatArray:
    """Return the landmarks (n, 3) with unknown depths at the mean of the known ones."""
    points = np.array(landmarks_m, dtype=np.float64)
    unknown = np.isnan(points[:, 2])
    if unknown.any():
        points[unknown, 2] = 0.0 if unknown.all() else points[~unknown, 2].mean()
    return points


@njit(cache=True, nogil=True)
def _terms(
    positions: FloatArray, points: FloatArray, unfinished_by: BoolArray, pending: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return J1, J2 and J3 of each vehicle, (n_vehicles,) each, without switches."""
    n = len(positions)
    J1, J2, J3 = np.zeros(n), np.zeros(n), np.full(n, -np.inf)
    for m in range(len(points)):
        seen = False
        for j in range(n):
            if unfinished_by[j, m]:
                J1[j] += 1.0
                seen = True
        if not seen and not pending[m]:
            continue
        least, closest = np.inf, 0
        for j in range(n):
            squared = 0.0
            for k in range(3):
                squared += (positions[j, k] - points[m, k]) ** 2
            if squared < least:
                least, closest = squared, j
            if pending[m]:
                J3[j] = max(J3[j], -squared)
        if seen:
            J2[closest] -= least
    for j in range(n):
        if J3[j] == -np.inf:
            J3[j] = 0.0
    return J1, J2, J3
