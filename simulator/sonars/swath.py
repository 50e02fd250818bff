"""Swath sonars: many beams across the track in one ping, with the errors that real ones have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from simulator.arrays import FloatArray
from simulator.floors.terrain import Terrain
from simulator.sonars.frames import to_local_frame
from simulator.sonars.mounting import STRAIGHT, SonarMounting
from simulator.sonars.sensors import SensorKind, SonarNoise, told_ranges
from simulator.vehicles.vehicle import Motion
from simulator.water_column import ASSUMED_MPS, WaterColumn

OUTER_RAD = math.radians(60.0)
"""Angle from straight down at which errors that grow towards the sides are given."""
NEAR_M = 0.1
FOOTPRINT = np.array([[0.0, 0.0], [-0.35, 0.0], [0.35, 0.0], [0.0, -0.35], [0.0, 0.35]])
"""Rays of a beam: across and along the track, in parts of its width. Their mean stands for that over the footprint."""
LIMIT_DROPOUTS, LIMIT_STEEPNESS = 40.0, 8
"""How many times as often nothing is heard at the end of the range, and how suddenly that begins."""


@dataclass(frozen=True, slots=True)
class SwathSonar:
    """What a swath sonar can do.

    Attributes
    ----------
    aperture_deg
        Between its outermost beams, half of it to each side.
    beams
        How many, at equal angles.
    rate_hz
        Pings a second; a simulated vehicle pings at most once in each of its steps.
    range_m
        Longest slant range.
    """

    aperture_deg: float = 120.0
    beams: int = 256
    rate_hz: float = 5.0
    range_m: float = 100.0

    def __post_init__(self) -> None:
        if not 0.0 < self.aperture_deg < 180.0:
            raise ValueError(f"swath sonar: aperture_deg is {self.aperture_deg}; it must be above 0 and below 180")
        if self.beams < 2:
            raise ValueError(f"swath sonar: beams is {self.beams}; it must be 2 or more")
        for name, value in (("rate_hz", self.rate_hz), ("range_m", self.range_m)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"swath sonar: {name} is {value}; it must be a positive number")

    @property
    def angles_rad(self) -> FloatArray:
        """Of the beams (beams,) from straight down in the vehicle, positive to starboard; from port to starboard."""
        half = 0.5 * math.radians(self.aperture_deg)
        return np.linspace(-half, half, self.beams)


@dataclass(frozen=True, slots=True)
class SwathErrors:
    """What keeps the ranges of a swath from the truth; :data:`EXACT` has none of it.

    Attributes
    ----------
    relative_sd
        Standard deviation of a range as a fraction of it.
    outer_relative_sd
        The like, independent of that, at 60 degrees; it grows with the square of the angle.
    beam_width_deg
        Of a beam, across and along the track: it hears the mean of its footprint.
    roll_offset_deg
        How far the sonar is mounted to starboard of what it reports.
    sound_speed_error_mps
        How much faster sound is at the sonar than it assumes: beams leave too flat, and the bottom seems bent.
    dropout_rate
        Share of the beams at 60 degrees that hear nothing; it grows with the square of the angle, and at the end of the
        range.
    false_rate
        Share of the beams that detect something in the water, above the bottom.
    """

    relative_sd: float = 0.002
    outer_relative_sd: float = 0.002
    beam_width_deg: float = 1.0
    roll_offset_deg: float = 0.1
    sound_speed_error_mps: float = 1.0
    dropout_rate: float = 0.02
    false_rate: float = 0.001

    @classmethod
    def of(cls, noise: SonarNoise) -> SwathErrors:
        """Return the errors that go with such noise: none without any, else typical ones where it says nothing."""
        if noise == SonarNoise():
            return EXACT
        typical = cls()
        return cls(
            relative_sd=noise.relative_sd,
            outer_relative_sd=noise.relative_sd,
            dropout_rate=noise.dropout_rate or typical.dropout_rate,
            false_rate=noise.outlier_rate or typical.false_rate,
        )


EXACT = SwathErrors(*[0.0] * 7)


class SwathSounder:
    """One swath sonar on one vehicle.

    Parameters
    ----------
    sonar
        What it can do.
    errors
        What it does wrong.
    rng
        Source of the errors.
    mounting
        How it really sits in the vehicle.
    water
        What its sound goes through; None: it is everywhere as fast as the sonar assumes.
    """

    kind: ClassVar = SensorKind.MULTIBEAM

    def __init__(
        self,
        sonar: SwathSonar,
        errors: SwathErrors,
        rng: np.random.Generator,
        mounting: SonarMounting = STRAIGHT,
        water: WaterColumn | None = None,
    ) -> None:
        self.sonar = sonar
        self.errors = errors
        self.angles_rad = sonar.angles_rad
        self.ping_period_s = 1.0 / sonar.rate_hz
        self.max_range_m = sonar.range_m
        self._rng = rng
        self._outwards = (self.angles_rad / OUTER_RAD) ** 2
        self._sd = np.hypot(errors.relative_sd, errors.outer_relative_sd * self._outwards)
        self._mounting = mounting
        self._water = water
        self._body = mounting.turned(self._rays())

    def _rays(self) -> FloatArray:
        """Where beams really point in the sonar: unit vectors (rays * beams, 3), ray by ray."""
        errors = self.errors
        steered = np.sin(self.angles_rad) * (1.0 + errors.sound_speed_error_mps / ASSUMED_MPS)
        angles = np.arcsin(np.clip(steered, -1.0, 1.0)) + math.radians(errors.roll_offset_deg)
        parts = FOOTPRINT if errors.beam_width_deg > 0.0 else FOOTPRINT[:1]
        across, along = math.radians(errors.beam_width_deg) * parts.T[:, :, None]
        angles, along = np.broadcast_arrays(angles + across, along)
        flat = np.cos(along)
        return np.stack([np.sin(along), flat * np.sin(angles), flat * np.cos(angles)], axis=-1).reshape(-1, 3)

    def ping(self, terrain: Terrain, motion: Motion) -> FloatArray:
        """Measured slant ranges, shape (beams,), NaN where nothing was detected."""
        motion = self._mounting.placed(motion)
        directions = to_local_frame(self._body, motion.heading_rad, motion.pitch_rad, motion.roll_rad)
        rays = told_ranges(terrain, motion, directions, self.max_range_m, self._water)
        rays = rays.reshape(-1, len(self.angles_rad))
        heard = np.isfinite(rays)
        rng, n, errors = self._rng, len(self.angles_rad), self.errors
        with np.errstate(invalid="ignore"):
            ranges = np.where(heard, rays, 0.0).sum(axis=0) / heard.sum(axis=0)
            ranges *= 1.0 + self._sd * rng.standard_normal(n)
            ranges = np.where(rng.random(n) < errors.false_rate, ranges * rng.uniform(0.1, 0.9, n), ranges)
            late = LIMIT_DROPOUTS * (ranges / self.max_range_m) ** LIMIT_STEEPNESS
            lost = rng.random(n) < errors.dropout_rate * (self._outwards + late)
            return np.where(lost | (ranges < NEAR_M) | (ranges > self.max_range_m), np.nan, ranges)
