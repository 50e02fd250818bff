"""How a simulated sonar really sits in its vehicle, which its vehicle knows nothing of."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from simulator.arrays import FloatArray
from simulator.sonars.frames import to_local_frame
from simulator.vehicles.vehicle import Motion


@dataclass(frozen=True, slots=True)
class SonarMounting:
    """How a sonar sits in its vehicle; forward, starboard, down.

    Attributes
    ----------
    roll_deg, pitch_deg, heading_deg
        How it is turned: starboard side down, bow side up, clockwise as seen from above.
    latency_s
        How old the positions are that go with what it measures.
    offset_m
        Forward, starboard and down from where the vehicle is.
    """

    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    heading_deg: float = 0.0
    latency_s: float = 0.0
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        values = (self.roll_deg, self.pitch_deg, self.heading_deg, *self.offset_m)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"sonar mounting: {values} holds a value that is not finite")
        if not (math.isfinite(self.latency_s) and self.latency_s >= 0.0):
            raise ValueError(f"sonar mounting: latency_s is {self.latency_s}; it must be 0 or more seconds")

    def turned(self, body: FloatArray) -> FloatArray:
        """Return in the vehicle's frame what is given in the sonar's, (n, 3) each."""
        if not (self.roll_deg or self.pitch_deg or self.heading_deg):
            return body
        angles = (math.radians(angle) for angle in (self.heading_deg, self.pitch_deg, self.roll_deg))
        starboard, forward, down = to_local_frame(body, *angles).T
        return np.column_stack([forward, starboard, down])

    def placed(self, motion: Motion) -> Motion:
        """Return a vehicle's motion with the place of the sonar."""
        if not any(self.offset_m):
            return motion
        arm = to_local_frame(np.array([self.offset_m]), motion.heading_rad, motion.pitch_rad, motion.roll_rad)
        east, north, down = arm[0].tolist()
        return replace(
            motion, east_m=motion.east_m + east, north_m=motion.north_m + north, depth_m=motion.depth_m + down
        )


STRAIGHT = SonarMounting()
"""A sonar in the middle of its vehicle, along its axes, with positions in time."""
