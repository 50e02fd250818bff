"""Targets that move and localization that fades, as planners see them, and what they cost (MED13 eq. 3, NGCUV12).

A *fictitious target* stands for localization (NGCUV12): it lies at the surface above the shallowest vehicle, counts as
accurately known as long as the vehicles know well enough where they are, and draws a vehicle up when they do not.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray

FICTITIOUS_WEIGHT = 10.0
"""What the fictitious target counts in the cost: NGCUV12 asks for a large weight, so that re-surfacing comes first."""


@dataclass(frozen=True)
class Targets:
    """What is known of ``k`` moving targets.

    Attributes
    ----------
    state : (k, 6)
        Where they are expected when the step that is decided ends, and their rates per step; NaN where unknown.
    covariance : (k, 6, 6)
        Of that.
    accurate : (k,)
        Which of them belong to ``A`` now.
    accuracy_sd_m : float
        Below which standard deviation, along all axes, they do.
    relative_noise : float
        Of ranges to them.
    hearing_m : float
        How far they can be ranged; inf: everywhere.
    range_sd_m : float
        Part of the ranges' deviation that is the same at any distance.
    standoff_m : float
        Vehicles on an errand come no closer to any target.
    """

    state: FloatArray
    covariance: FloatArray
    accurate: BoolArray
    accuracy_sd_m: float
    relative_noise: float
    hearing_m: float = np.inf
    range_sd_m: float = 0.0
    standoff_m: float = 0.0

    @property
    def sd_m(self) -> FloatArray:
        """Greatest standard deviation of each position, (k,)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, :3].max(axis=1)))


@dataclass(frozen=True)
class Localization:
    """How well the vehicles know where they are.

    Attributes
    ----------
    sd_m : (n_vehicles,)
        Standard deviation of each vehicle's horizontal position; NaN where it does not say.
    foretold_sd_m : (n_vehicles,)
        What it would be by the time that a vehicle which rises now has come to the surface.
    threshold_sd_m : float
        What it should not exceed.
    surface_m : float
        Depth at which there is GPS.
    shared : bool
        Whether a fix of one vehicle relocalizes the whole team (NGCUV12), or each needs its own.
    """

    sd_m: FloatArray
    foretold_sd_m: FloatArray
    threshold_sd_m: float
    surface_m: float = 0.0
    shared: bool = False

    def of(self, rows: NDArray[np.int64]) -> "Localization":
        """Return the localization of some of the vehicles, in this order."""
        return replace(self, sd_m=self.sd_m[rows], foretold_sd_m=self.foretold_sd_m[rows])


def dynamic_cost(positions: FloatArray, targets: Targets | None, localization: Localization | None, K: float) -> float:
    """Return what targets and localization add to MED13's cost for a team configuration (n_vehicles, 3)."""
    cost = 0.0
    if targets is not None:
        for state, accurate in zip(targets.state, targets.accurate, strict=True):
            if accurate:
                continue
            squared = ((positions - state[:3]) ** 2).sum(axis=1)
            nearest = float(np.nan_to_num(squared.min(), nan=np.inf))
            cost += nearest if nearest < targets.hearing_m**2 and np.isfinite(nearest) else K
    if localization is not None and len(positions) and (localization.sd_m > localization.threshold_sd_m).any():
        point = fictitious_target(positions, localization.surface_m)
        cost += FICTITIOUS_WEIGHT * float(((positions - point) ** 2).sum(axis=1).min())
    return cost


def fictitious_target(positions: FloatArray, surface_m: float) -> FloatArray:
    """Return where the fictitious target lies, (3,): at the surface above the shallowest vehicle."""
    return np.append(positions[int(np.argmin(positions[:, 2])), :2], surface_m)
