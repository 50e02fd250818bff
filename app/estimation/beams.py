"""Sonars with beams of their own directions: four-beam DVL and multibeam swath (PCAO18 section II-B).

Angles are in radians; headings clockwise from north, pitch nose up, roll starboard down. Frame: east, north, depth.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray

Floor = Callable[[FloatArray], FloatArray]
"""Depths at positions (..., 2), for instance of a raster; NaN where unknown."""

BISECTIONS = 20


def noisy_ranges(
    position: FloatArray, landmarks: FloatArray, relative_noise: float, rng: np.random.Generator
) -> FloatArray:
    """Return ranges (n,) from ``position`` (3,) to ``landmarks`` (n, 3) with multiplicative noise (AURO15 eq. 5)."""
    ranges = np.linalg.norm(landmarks - position, axis=1)
    return np.asarray(ranges * (1.0 + relative_noise * rng.standard_normal(len(ranges))), dtype=np.float64)


@dataclass(frozen=True)
class Attitude:
    """How a vehicle lies in the water."""

    heading_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @property
    def rotation(self) -> FloatArray:
        """Matrix (3, 3) that turns (forward, starboard, down) into (east, north, down)."""
        (ch, cp, cr), (sh, sp, sr) = (f([self.heading_rad, self.pitch_rad, self.roll_rad]) for f in (np.cos, np.sin))
        # Forward, right, down from the level vehicle; pitch nose up, roll starboard down.
        roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        heading = np.array([[sh, ch, 0.0], [ch, -sh, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(heading @ pitch @ roll, dtype=np.float64)


@dataclass(frozen=True)
class Echoes:
    """Soundings of one ping, (k,) each: where the beams seem to have met the bottom, and how sure the depth is.

    ``beam`` is the number of the beam; beams without an echo are missing.
    """

    east_m: FloatArray
    north_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray
    beam: IntArray


@dataclass(frozen=True)
class BeamSonar(ABC):
    """What all such sonars do; a kind of sonar adds its beams.

    Attributes
    ----------
    relative_noise : float
        Standard deviation of the multiplicative noise, ``y = r (1 + noise xi)`` (PCAO18 eq. 2).
    max_range_m : float
        Beyond it there is no echo.
    beam_width_rad : float
        Full width of a beam's cone, for which landmarks it meets.
    """

    relative_noise: float = 0.01
    max_range_m: float = 100.0
    beam_width_rad: float = float(np.radians(3.0))

    @property
    @abstractmethod
    def beams(self) -> FloatArray:
        """Unit vectors (n_beams, 3): forward, starboard, down."""

    def ranges(self, position: FloatArray, attitude: Attitude, floor: Floor, resolution_m: float) -> FloatArray:
        """Return the true range of every beam, (n_beams,); NaN where there is no echo.

        Parameters
        ----------
        position : (3,)
            Of the sonar.
        floor : callable
            The true depths.
        resolution_m : float
            Length over which the sea floor is smooth; beams are followed in steps of half of it, then bisected.
        """
        return cast(np.asarray(position), self.beams @ attitude.rotation.T, floor, self.max_range_m, resolution_m / 2)

    def sound(
        self, position: FloatArray, attitude: Attitude, floor: Floor, resolution_m: float, rng: np.random.Generator
    ) -> Echoes:
        """Return the noisy soundings of one ping; arguments as for :meth:`ranges`."""
        directions = self.beams @ attitude.rotation.T
        ranges = self.ranges(position, attitude, floor, resolution_m)
        noisy = ranges * (1.0 + self.relative_noise * rng.standard_normal(len(ranges)))
        beam = np.flatnonzero(np.isfinite(noisy))
        points = position + noisy[beam, None] * directions[beam]
        # An error along a slanted beam moves the footprint too; of the depth it is the part along the vertical.
        sd = np.maximum(1e-3, self.relative_noise * np.abs(noisy[beam] * directions[beam, 2]))
        return Echoes(points[:, 0], points[:, 1], points[:, 2], sd, beam)

    def meets(self, position: FloatArray, attitude: Attitude, landmarks: FloatArray) -> BoolArray:
        """Return which landmarks (n, 3) lie within a beam's cone and in range, (n,); those of unknown depth do not."""
        offset = landmarks - position
        r = np.linalg.norm(offset, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = (offset / r[:, None]) @ (self.beams @ attitude.rotation.T).T
            hit = (cosine >= np.cos(self.beam_width_rad / 2.0)).any(axis=1)
        return np.asarray(hit & (r < self.max_range_m), dtype=np.bool_)

    def measure(self, position: FloatArray, landmarks: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return noisy ranges (n,) to landmarks (n, 3) that the beams meet."""
        return noisy_ranges(position, landmarks, self.relative_noise, rng)


@dataclass(frozen=True)
class Dvl(BeamSonar):
    """Four beams, ``tilt_rad`` off the vertical, towards heading +0, 90, 180 and 270 degrees (beams 0 to 3)."""

    tilt_rad: float = float(np.radians(22.5))

    @property
    def beams(self) -> FloatArray:
        """Unit vectors (4, 3): forward, starboard, down."""
        s, c = np.sin(self.tilt_rad), np.cos(self.tilt_rad)
        return np.array([[s, 0.0, c], [0.0, s, c], [-s, 0.0, c], [0.0, -s, c]])


@dataclass(frozen=True)
class Multibeam(BeamSonar):
    """``count`` (R) beams across the heading, evenly from port to starboard over ``swath_rad``; one looks down."""

    count: int = 32
    swath_rad: float = float(np.radians(120.0))

    @property
    def beams(self) -> FloatArray:
        """Unit vectors (count, 3): forward, starboard, down."""
        across = np.linspace(-0.5, 0.5, self.count) * self.swath_rad if self.count > 1 else np.zeros(1)
        return np.column_stack([np.zeros(self.count), np.sin(across), np.cos(across)])


def cast(position: FloatArray, directions: FloatArray, floor: Floor, max_range_m: float, step_m: float) -> FloatArray:
    """Return how far rays (k, 3) from ``position`` (3,) go until they meet the floor, (k,); NaN where they do not.

    A ray that grazes a crest over less than ``step_m`` may pass it; one that comes out of unknown ground hits nothing.
    """
    along = np.append(np.arange(0.0, max_range_m, step_m), max_range_m)
    points = position + along[:, None, None] * directions
    gap = floor(points[..., :2]) - points[..., 2]
    below = gap <= 0.0
    first = np.argmax(below, axis=0)
    rays = np.arange(len(directions))
    hit = below[first, rays] & (first > 0) & np.isfinite(gap[np.maximum(first - 1, 0), rays])
    near, far, toward = along[first[hit] - 1], along[first[hit]], directions[hit]
    for _ in range(BISECTIONS):
        middle = (near + far) / 2.0
        point = position + middle[:, None] * toward
        deeper = floor(point[:, :2]) <= point[:, 2]
        near, far = np.where(deeper, near, middle), np.where(deeper, middle, far)
    result = np.full(len(directions), np.nan)
    result[hit] = (near + far) / 2.0
    return result
