"""Where a vehicle believes to be: GPS at the surface, dead reckoning with growing error below."""

from __future__ import annotations

import math

import numpy as np

SURFACE_DEPTH_M = 0.3
"""Above this the antenna is out of the water."""

LEAST_VARIANCE_M2 = 0.005
"""Variance that a LAUV reports with a GPS fix."""


class Navigation:
    """Position error of one vehicle.

    Under water the error does a random walk: its variance per axis grows by ``drift_m2ps`` per second (DUNE
    reports 0.02 per second in its NavigationUncertainty). A GPS fix at the surface ends it.

    Parameters
    ----------
    drift_m2ps
        Growth of the variance per axis, m2 per second of simulated time; 0 for perfect dead reckoning.
    rng
        Source of the walk.
    gps_sd_m
        Standard deviation per axis of the error that a new fix leaves (only with drift).
    """

    def __init__(self, drift_m2ps: float, rng: np.random.Generator, *, gps_sd_m: float = 0.1) -> None:
        if not (math.isfinite(drift_m2ps) and drift_m2ps >= 0.0):
            raise ValueError(f"drift is {drift_m2ps}; it must be a growth of variance of 0 or more m2/s")
        self.drift_m2ps = drift_m2ps
        self.gps_sd_m = gps_sd_m if drift_m2ps > 0.0 else 0.0
        self.error_m = (0.0, 0.0)
        self.variance_m2 = LEAST_VARIANCE_M2
        self.submerged_s = 0.0
        self._rng = rng

    @property
    def has_fix(self) -> bool:
        """Whether GPS is received now."""
        return self.submerged_s == 0.0

    def step(self, depth_m: float, dt_s: float) -> None:
        """Advance by a time step at a depth."""
        if depth_m <= SURFACE_DEPTH_M:
            if self.submerged_s > 0.0:
                self.submerged_s = 0.0
                self.variance_m2 = LEAST_VARIANCE_M2
                if self.drift_m2ps > 0.0:
                    e, n = self._rng.normal(0.0, self.gps_sd_m, 2)
                    self.error_m = (float(e), float(n))
            return
        self.submerged_s += dt_s
        if self.drift_m2ps > 0.0:
            self.variance_m2 += self.drift_m2ps * dt_s
            e, n = self._rng.normal(0.0, math.sqrt(self.drift_m2ps * dt_s), 2)
            self.error_m = (self.error_m[0] + float(e), self.error_m[1] + float(n))
