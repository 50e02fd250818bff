"""The Goto maneuver: flies the vehicle to a place and is done a few seconds before it gets there."""

from __future__ import annotations

import math

import imcpy

from simulator.dune.maneuvers.ending import EndingManeuver, speed_mps
from simulator.dune.maneuvers.follow_reference import ARRIVAL_TIME_S
from simulator.geodesy import LocalFrame
from simulator.vehicles.vehicle import SteeringTarget
from simulator.world import SimulatedVehicle


class GotoManeuver(EndingManeuver):
    """One execution of Goto, made of what :class:`EndingManeuver` names."""

    def __init__(self, spec: imcpy.Goto, vehicle: SimulatedVehicle, frame: LocalFrame, now_s: float) -> None:
        self._vehicle = vehicle
        self._timeout_s = float(spec.timeout)
        self._started_s = now_s
        self._east_m, self._north_m = frame.to_local(math.degrees(spec.lat), math.degrees(spec.lon))
        by_altitude = int(spec.z_units) == int(imcpy.ZUnits.ALTITUDE)
        speed = speed_mps(spec)
        vehicle.vehicle.goto(SteeringTarget(self._east_m, self._north_m, float(spec.z), speed, by_altitude))

    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Why the maneuver fails now, None while it goes on; the flag as in FollowReference."""
        if self._timeout_s > 0.0 and now_s - self._started_s > self._timeout_s:
            return "Goto maneuver error: maneuver timed out", False
        return None

    def done(self, now_s: float) -> bool:
        """Whether the path controller calls the target near: it does so ahead in time, whatever the depth."""
        speed = max(self._vehicle.vehicle.motion.surge_mps, 0.1)
        distance = self._vehicle.position.horizontal_distance_m(self._east_m, self._north_m)
        return distance <= ARRIVAL_TIME_S * speed
