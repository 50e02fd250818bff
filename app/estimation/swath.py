"""What a swath sonar sees of the bottom below it."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray


@dataclass(frozen=True)
class SwathSonar:
    """A multibeam or interferometric sonar that looks to both sides.

    Attributes
    ----------
    aperture_rad
        Angle between its outermost usable beams.
    beams
        Beams of one ping.
    equidistant
        Whether they are evenly spaced on a flat bottom, as surveys usually have them, in place of evenly in angle.
    rate_hz
        Pings a second.
    range_m
        Largest slant range.
    """

    aperture_rad: float = np.radians(120.0)
    beams: int = 256
    rate_hz: float = 5.0
    range_m: float = 100.0
    equidistant: bool = True

    @property
    def angles_rad(self) -> FloatArray:
        """Angles of the beams from straight down, (beams,), positive to starboard."""
        if self.equidistant:
            return np.arctan(np.linspace(-self.reach, self.reach, self.beams))
        return np.linspace(-self.half_angle_rad, self.half_angle_rad, self.beams)

    @property
    def half_angle_rad(self) -> float:
        """Angle of the outermost beam from straight down."""
        return 0.5 * self.aperture_rad

    @property
    def reach(self) -> float:
        """Half the swath's width over the altitude, where the range does not end it."""
        return float(np.tan(self.half_angle_rad))

    def half_width_m(self, altitude_m: FloatArray) -> FloatArray:
        """Return how far to either side the bottom is seen; 0 where it is out of range."""
        altitude = np.maximum(altitude_m, 0.0)
        in_range = np.sqrt(np.maximum(self.range_m**2 - altitude**2, 0.0))
        return np.asarray(np.minimum(self.reach * altitude, in_range))

    def speed_mps(self, cell_m: float) -> float:
        """Return how fast a vehicle may be so that every cell is met by two pings at least."""
        return 0.5 * cell_m * self.rate_hz
