"""The Elevator maneuver: circles a place until a depth is reached."""

from __future__ import annotations

import math
from enum import Enum

import imcpy

from simulator.dune.maneuvers.ending import EndingManeuver, speed_mps
from simulator.dune.maneuvers.follow_reference import ARRIVAL_TIME_S
from simulator.geodesy import LocalFrame
from simulator.vehicles.vehicle import SteeringTarget
from simulator.world import SimulatedVehicle

LEAST_RADIUS_M = 10.0
"""A LAUV circles no tighter, whatever is asked."""
DEPTH_TOLERANCE_M = 0.3
SLOWEST_MPS = 0.1
PROGRESS_TIMEOUT_S = 20.0
"""A vehicle that stays slower for this long, up or down, fails."""


class _Phase(Enum):
    GO_TO = "go to"
    HELICOID = "helicoid"
    DONE = "done"


class ElevatorManeuver(EndingManeuver):
    """One execution of Elevator, made of what :class:`EndingManeuver` names."""

    def __init__(self, spec: imcpy.Elevator, vehicle: SimulatedVehicle, frame: LocalFrame, now_s: float) -> None:
        self._vehicle = vehicle
        self._end_m = float(spec.end_z)
        self._radius_m = max(float(spec.radius), LEAST_RADIUS_M)
        self._speed_mps = speed_mps(spec)
        self._progress_s = now_s
        here = vehicle.position
        # Down it goes anticlockwise, up clockwise.
        self._clockwise = here.depth_m >= self._end_m
        if int(spec.flags) & int(imcpy.Elevator.FlagsBits.CURR_POS):
            self._centre = here.east_m, here.north_m
            self._phase = _Phase.HELICOID
            self._circle()
        else:
            self._centre = frame.to_local(math.degrees(spec.lat), math.degrees(spec.lon))
            self._phase = _Phase.GO_TO
            vehicle.vehicle.goto(SteeringTarget(*self._centre, float(spec.start_z), self._speed_mps))

    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Why the maneuver fails now, None while it goes on; the flag as in FollowReference."""
        if self._phase is not _Phase.HELICOID or abs(self._vehicle.vehicle.motion.vd_mps) >= SLOWEST_MPS:
            self._progress_s = now_s
        if now_s - self._progress_s > PROGRESS_TIMEOUT_S:
            return "Elevator maneuver error: vertical progress is too slow", False
        return None

    def done(self, now_s: float) -> bool:
        """Whether the depth is reached; how far the vehicle is from the place does not count."""
        here = self._vehicle.position
        if self._phase is _Phase.GO_TO:
            to_circle_m = abs(here.horizontal_distance_m(*self._centre) - self._radius_m)
            if to_circle_m <= ARRIVAL_TIME_S * max(self._vehicle.vehicle.motion.surge_mps, 0.1):
                self._phase = _Phase.HELICOID
                self._circle()
        elif self._phase is _Phase.HELICOID and abs(here.depth_m - self._end_m) <= DEPTH_TOLERANCE_M:
            self._phase = _Phase.DONE
        return self._phase is _Phase.DONE

    def _circle(self) -> None:
        self._vehicle.vehicle.goto(SteeringTarget(*self._centre, self._end_m, self._speed_mps))
        self._vehicle.vehicle.loiter(self._radius_m, clockwise=self._clockwise)
