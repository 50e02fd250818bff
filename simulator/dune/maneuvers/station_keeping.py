"""The StationKeeping maneuver: motor off within a circle, back into it when the vehicle drifted out."""

from __future__ import annotations

import math

import imcpy

from simulator.dune.maneuvers.ending import EndingManeuver, speed_mps
from simulator.dune.maneuvers.follow_reference import ARRIVAL_TIME_S
from simulator.geodesy import LocalFrame
from simulator.vehicles.vehicle import SteeringTarget
from simulator.world import SimulatedVehicle

LEAST_RADIUS_M = 10.0
AT_SURFACE_WITHIN = 2.5
"""A vehicle that drifted no farther than this many radii comes back at the surface."""


class StationKeepingManeuver(EndingManeuver):
    """One execution of Station Keeping, made of what :class:`EndingManeuver` names.

    A vehicle within the circle floats up, whatever depth was asked for.
    """

    def __init__(self, spec: imcpy.StationKeeping, vehicle: SimulatedVehicle, frame: LocalFrame, now_s: float) -> None:
        self._vehicle = vehicle
        self._place = frame.to_local(math.degrees(spec.lat), math.degrees(spec.lon))
        self._depth_m = float(spec.z)
        self._radius_m = max(float(spec.radius), LEAST_RADIUS_M)
        self._speed_mps = speed_mps(spec)
        self._duration_s = float(spec.duration)
        self._end_s: float | None = None
        self._inside = self._distance_m() < self._radius_m
        if self._inside:
            vehicle.vehicle.idle()
        else:
            self._move(self._depth_m)

    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Nothing makes it fail."""
        return None

    def done(self, now_s: float) -> bool:
        """Whether the vehicle has been there for as long as asked; for ever when that is 0."""
        distance_m = self._distance_m()
        if self._inside:
            if self._end_s is None:
                self._end_s = now_s + self._duration_s
            if distance_m > self._radius_m:
                self._inside = False
                self._move(0.0 if distance_m < AT_SURFACE_WITHIN * self._radius_m else self._depth_m)
        elif distance_m < min(self._radius_m, ARRIVAL_TIME_S * max(self._vehicle.vehicle.motion.surge_mps, 0.1)):
            self._inside = True
            self._vehicle.vehicle.idle()
        return self._inside and self._duration_s > 0.0 and self._end_s is not None and now_s >= self._end_s

    def _distance_m(self) -> float:
        return self._vehicle.position.horizontal_distance_m(*self._place)

    def _move(self, depth_m: float) -> None:
        self._vehicle.vehicle.goto(SteeringTarget(*self._place, depth_m, self._speed_mps))
