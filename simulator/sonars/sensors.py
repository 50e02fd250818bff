"""Sonars that look at the sea floor with few beams: single beam, four-beam DVL.

Swaths: :mod:`simulator.sonars.swath`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from simulator.arrays import FloatArray
from simulator.floors.terrain import Terrain
from simulator.sonars.frames import to_local_frame
from simulator.sonars.mounting import STRAIGHT, SonarMounting
from simulator.sonars.raycasting import march
from simulator.vehicles.vehicle import Motion
from simulator.water_column import ASSUMED_MPS, WaterColumn

STEEP = 0.05
"""A beam that goes down less steeply than this part of its way is followed as if the water did not bend it."""
BENDS = 2
"""How often a beam is cast anew along where the water bends it to, by how deep it got before."""

DVL_TILT_RAD = math.radians(22.5)


class SensorKind(StrEnum):
    """The sonars a vehicle can carry."""

    SINGLE = "single"
    DVL = "dvl"
    MULTIBEAM = "multibeam"


@dataclass(frozen=True, slots=True)
class Beams:
    """Directions of a sonar's beams in the vehicle's body, each array of shape (n,).

    A beam leaves the vertical body axis by ``tilt_rad`` towards ``azimuth_rad`` (clockwise from the bow).
    """

    tilt_rad: FloatArray
    azimuth_rad: FloatArray

    def __len__(self) -> int:
        return len(self.tilt_rad)

    @property
    def body(self) -> FloatArray:
        """Unit vectors (forward, starboard, down), shape (n, 3)."""
        sin = np.sin(self.tilt_rad)
        return np.column_stack([sin * np.cos(self.azimuth_rad), sin * np.sin(self.azimuth_rad), np.cos(self.tilt_rad)])


@dataclass(frozen=True, slots=True)
class SonarNoise:
    """Errors of a sonar.

    Attributes
    ----------
    relative_sd
        Standard deviation of xi in ``y = r (1 + xi)`` (MED13, AURO15).
    outlier_rate
        Probability that a return is false: half of them come short (fish, bubbles), half as a double echo.
    dropout_rate
        Probability that there is no return.
    """

    relative_sd: float = 0.0
    outlier_rate: float = 0.0
    dropout_rate: float = 0.0

    def __post_init__(self) -> None:
        for name, value, most in (
            ("relative_sd", self.relative_sd, 1.0),
            ("outlier_rate", self.outlier_rate, 1.0),
            ("dropout_rate", self.dropout_rate, 1.0),
        ):
            if not 0.0 <= value <= most:
                raise ValueError(f"sonar noise: {name} is {value}; it must be within 0 to {most:g}")


def beams_of(kind: SensorKind) -> Beams:
    """The beams of a single beam sonar or a DVL.

    The DVL's beams 0 to 3 point to heading +0, 90, 180, 270 degrees, 22.5 degrees off the vertical.
    """
    if kind is SensorKind.SINGLE:
        return Beams(np.zeros(1), np.zeros(1))
    if kind is SensorKind.DVL:
        return Beams(np.full(4, DVL_TILT_RAD), np.radians([0.0, 90.0, 180.0, 270.0]))
    raise ValueError(f"sonar: kind is {kind}; it must be single or dvl")


def cast_rays(
    terrain: Terrain,
    east_m: float,
    north_m: float,
    depth_m: float,
    directions: FloatArray,
    max_range_m: float,
) -> FloatArray:
    """Distance along each ray to the sea floor.

    Marches in steps of half a cell to the first sample below the floor, then bisects to a millimetre. A ray
    that grazes a crest over less than half a cell may pass it.

    Parameters
    ----------
    directions
        Unit vectors (east, north, down), shape (n, 3).

    Returns
    -------
    Ranges in metres, shape (n,), NaN where nothing is hit within the range or the floor is unknown.
    """
    shoalest, deepest = terrain.min_depth_m, terrain.max_depth_m
    return march(terrain.z_m, terrain.cell_m, east_m, north_m, depth_m, directions, shoalest, deepest, max_range_m)


def told_ranges(
    terrain: Terrain, motion: Motion, directions: FloatArray, max_range_m: float, water: WaterColumn | None
) -> FloatArray:
    """Return what a sonar takes the distance along each beam for, shape (n,); NaN as by :func:`cast_rays`.

    Parameters
    ----------
    motion
        Of the sonar.
    directions
        In which beams leave it: unit vectors (east, north, down), shape (n, 3).
    water
        What bends them; None: sound is everywhere as fast as the sonar assumes.
    """

    def cast(along: FloatArray) -> FloatArray:
        return cast_rays(terrain, motion.east_m, motion.north_m, motion.depth_m, along, max_range_m)

    ranges = cast(directions)
    if water is None:
        return ranges
    told = ranges * (ASSUMED_MPS / water.speed_mps(motion.depth_m))
    steep = np.flatnonzero(np.isfinite(ranges) & (directions[:, 2] > STEEP) & (ranges > 0.0))
    if not steep.size:
        return told
    launch = np.arccos(np.minimum(directions[steep, 2], 1.0))
    aside = directions[steep, :2] / np.maximum(np.sin(launch), 1e-12)[:, None]
    down_m = ranges[steep] * directions[steep, 2]
    for _ in range(BENDS):
        bent, _range = water.beams(launch, motion.depth_m, down_m)
        along = np.column_stack([np.sin(bent)[:, None] * aside, np.cos(bent)])
        down_m = cast(along) * along[:, 2]
    told[steep] = water.beams(launch, motion.depth_m, down_m)[1]
    return told


class Sonar:
    """One sonar of few beams on one vehicle.

    Parameters
    ----------
    kind
        Which one: single beam or DVL.
    noise
        Its errors.
    rng
        Source of the errors.
    ping_period_s
        Simulated time between two pings.
    max_range_m, min_range_m
        Outside of which nothing is returned.
    mounting
        How it really sits in the vehicle.
    water
        What its sound goes through; None: it is everywhere as fast as the sonar assumes.
    """

    def __init__(
        self,
        kind: SensorKind,
        noise: SonarNoise,
        rng: np.random.Generator,
        *,
        ping_period_s: float = 0.2,
        max_range_m: float = 100.0,
        min_range_m: float = 0.1,
        mounting: SonarMounting = STRAIGHT,
        water: WaterColumn | None = None,
    ) -> None:
        if not ping_period_s > 0.0:
            raise ValueError(f"sonar: ping_period_s is {ping_period_s}; it must be positive")
        self.kind = kind
        self.noise = noise
        self.beams = beams_of(kind)
        self.ping_period_s = ping_period_s
        self.max_range_m = max_range_m
        self.min_range_m = min_range_m
        self._rng = rng
        self._mounting = mounting
        self._water = water
        self._body = mounting.turned(self.beams.body)

    def exact_ranges(self, terrain: Terrain, motion: Motion) -> FloatArray:
        """Ranges without any error but the water's, shape (n_beams,), NaN for no return."""
        motion = self._mounting.placed(motion)
        if self.kind is SensorKind.SINGLE:
            return np.array([self._below_m(terrain, motion)])
        directions = to_local_frame(self._body, motion.heading_rad, motion.pitch_rad, motion.roll_rad)
        return told_ranges(terrain, motion, directions, self.max_range_m, self._water)

    def _below_m(self, terrain: Terrain, motion: Motion) -> float:
        """What an altimeter takes its altitude for."""
        altitude_m = _altitude_m(terrain, motion)
        if self._water is None or not altitude_m > 0.0:
            return altitude_m
        return self._water.range_down_m(motion.depth_m, altitude_m)

    def ping_below(self, terrain: Terrain, motion: Motion) -> float:
        """The same as :meth:`ping` for a single beam, without numpy's overhead per call."""
        noise = self.noise
        if noise.outlier_rate > 0.0 or noise.dropout_rate > 0.0:
            return float(self.ping(terrain, motion)[0])
        measured = self._below_m(terrain, self._mounting.placed(motion))
        if noise.relative_sd > 0.0:
            measured *= 1.0 + noise.relative_sd * self._rng.standard_normal()
        return measured if self.min_range_m <= measured <= self.max_range_m else math.nan

    def ping(self, terrain: Terrain, motion: Motion) -> FloatArray:
        """Measured ranges, shape (n_beams,), NaN for no return."""
        ranges = self.exact_ranges(terrain, motion)
        n, noise = len(ranges), self.noise
        if noise.relative_sd > 0.0:
            ranges = ranges * (1.0 + noise.relative_sd * self._rng.standard_normal(n))
        if noise.outlier_rate > 0.0:
            false = self._rng.random(n) < noise.outlier_rate
            short = self._rng.random(n) < 0.5
            wrong = np.where(short, ranges * self._rng.uniform(0.1, 0.9, n), 2.0 * ranges)
            ranges = np.where(false, wrong, ranges)
        if noise.dropout_rate > 0.0:
            ranges = np.where(self._rng.random(n) < noise.dropout_rate, np.nan, ranges)
        with np.errstate(invalid="ignore"):
            inside = (ranges >= self.min_range_m) & (ranges <= self.max_range_m)
        return np.where(inside, ranges, np.nan)


def _altitude_m(terrain: Terrain, motion: Motion) -> float:
    """What an altimeter has below it: its cone is wider than the pitch of flight, so that counts, as in DUNE."""
    return terrain.depth_at_point(motion.east_m, motion.north_m) - motion.depth_m
