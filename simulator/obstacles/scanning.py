"""A scanner on a simulated vehicle in a world of obstacles, and what happens when it runs into one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulator.arrays import FloatArray
from simulator.obstacles.obstacles import ObstacleWorld
from simulator.world import LocalPosition

HULL_M = 0.4
"""Half the length of the hull: closer than that to an obstacle is a collision."""


@dataclass(frozen=True)
class Scan:
    """One turn of a scanner.

    Attributes
    ----------
    time_s
        The vehicle's clock.
    ranges_m
        (n,) along bearings clockwise from north, the first one north; infinite without an echo.
    """

    time_s: float
    ranges_m: FloatArray


class Scanning:
    """Looks round at a steady rate.

    Parameters
    ----------
    world
        The truth, in the frame of the vehicle's terrain.
    reach_m, resolution_deg
        Of the scanner.
    noise_m
        Standard deviation of a range.
    rng
        Of the noise.
    start_s
        The vehicle's clock at the start.
    period_s
        Time between scans.
    """

    def __init__(
        self,
        world: ObstacleWorld,
        reach_m: float,
        resolution_deg: float,
        noise_m: float,
        rng: np.random.Generator,
        start_s: float,
        period_s: float = 1.0,
    ) -> None:
        self.world = world
        self.reach_m = reach_m
        self.resolution_deg = resolution_deg
        self.collided = False
        self._bearings = np.radians(np.arange(0.0, 360.0, resolution_deg))
        self._noise_m = noise_m
        self._rng = rng
        self._period_s = period_s
        self._next_s = start_s

    def step(self, time_s: float, true: LocalPosition) -> Scan | None:
        """Return a scan when one is due; notes whether the vehicle touches anything at its true place."""
        here = np.array([true.east_m, true.north_m])
        self.collided = self.collided or float(self.world.clearance_m(here[None])[0]) < HULL_M
        if time_s < self._next_s:
            return None
        self._next_s = max(self._next_s + self._period_s, time_s)
        ranges = self.world.scan(here, self._bearings, self.reach_m)
        return Scan(time_s, np.maximum(ranges + self._rng.normal(0.0, self._noise_m, len(ranges)), 0.0))
