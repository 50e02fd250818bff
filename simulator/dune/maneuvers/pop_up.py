"""The PopUp maneuver: up by the motor, until the vehicle knows itself at the surface; then it waits, or gets a fix."""

from __future__ import annotations

import math
from enum import Enum

import imcpy

from simulator.dune.maneuvers.elevator import ElevatorManeuver
from simulator.dune.maneuvers.ending import EndingManeuver, speed_mps
from simulator.dune.maneuvers.follow_reference import ARRIVAL_TIME_S
from simulator.dune.maneuvers.station_keeping import StationKeepingManeuver
from simulator.geodesy import LocalFrame
from simulator.vehicles.navigation import SURFACE_DEPTH_M
from simulator.vehicles.vehicle import SteeringTarget
from simulator.world import SimulatedVehicle

RADIUS_M = 15.0
"""Of its circles, by the vehicle's configuration."""


class _Phase(Enum):
    GO_TO = "go to"
    GO_UP = "go up"
    NEAR_SURFACE = "near the surface"
    GET_FIX = "get a fix"
    STATION_KEEPING = "station keeping"
    GO_DOWN = "go down"
    DONE = "done"


class PopUpManeuver(EndingManeuver):
    """One execution of Pop Up, made of what :class:`EndingManeuver` names."""

    def __init__(self, spec: imcpy.PopUp, vehicle: SimulatedVehicle, frame: LocalFrame, now_s: float) -> None:
        self._spec = spec
        self._vehicle = vehicle
        self._frame = frame
        bits = imcpy.PopUp.FlagsBits
        flags = int(spec.flags)
        self._waits = bool(flags & (int(bits.WAIT_AT_SURFACE) | int(bits.STATION_KEEP)))
        self._speed_mps = speed_mps(spec)
        self._part: ElevatorManeuver | StationKeepingManeuver | None = None
        self._until_s = math.inf
        self._place = frame.to_local(math.degrees(spec.lat), math.degrees(spec.lon))
        if flags & int(bits.CURR_POS):
            self._phase = _Phase.GO_UP
            self._part = self._elevator(0.0, now_s)
        else:
            self._phase = _Phase.GO_TO
            vehicle.vehicle.goto(SteeringTarget(*self._place, float(spec.z), self._speed_mps))

    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Nothing makes it fail."""
        return None

    def done(self, now_s: float) -> bool:
        """Whether it has been at the surface, and at its depth again."""
        match self._phase:
            case _Phase.GO_TO:
                near_m = ARRIVAL_TIME_S * max(self._vehicle.vehicle.motion.surge_mps, 0.1)
                if self._vehicle.position.horizontal_distance_m(*self._place) <= near_m:
                    self._enter(_Phase.GO_UP, self._elevator(0.0, now_s))
            case _Phase.GO_UP if self._ended(now_s):
                self._vehicle.vehicle.idle()
                self._enter(_Phase.NEAR_SURFACE)
            case _Phase.NEAR_SURFACE if self._vehicle.vehicle.motion.depth_m <= SURFACE_DEPTH_M:
                if self._waits:
                    self._until_s = now_s + float(self._spec.duration)
                    self._enter(_Phase.STATION_KEEPING, self._station(now_s))
                else:
                    self._enter(_Phase.GET_FIX)
            case _Phase.GET_FIX if self._vehicle.navigation.has_fix:
                self._enter(_Phase.GO_DOWN, self._elevator(float(self._spec.z), now_s))
            case _Phase.STATION_KEEPING if not self._ended(now_s) and now_s >= self._until_s:
                self._enter(_Phase.GO_DOWN, self._elevator(float(self._spec.z), now_s))
            case _Phase.GO_DOWN if self._ended(now_s):
                self._enter(_Phase.DONE)
        return self._phase is _Phase.DONE

    def _enter(self, phase: _Phase, part: ElevatorManeuver | StationKeepingManeuver | None = None) -> None:
        self._phase, self._part = phase, part

    def _ended(self, now_s: float) -> bool:
        return self._part is not None and self._part.done(now_s)

    def _elevator(self, depth_m: float, now_s: float) -> ElevatorManeuver:
        spec = imcpy.Elevator()
        spec.flags = int(imcpy.Elevator.FlagsBits.CURR_POS)
        spec.end_z, spec.end_z_units = depth_m, imcpy.ZUnits.DEPTH
        spec.radius = RADIUS_M
        spec.speed, spec.speed_units = self._speed_mps, imcpy.SpeedUnits.METERS_PS
        return ElevatorManeuver(spec, self._vehicle, self._frame, now_s)

    def _station(self, now_s: float) -> StationKeepingManeuver:
        here = self._vehicle.position
        lat, lon = self._frame.to_geodetic(here.east_m, here.north_m)
        spec = imcpy.StationKeeping()
        spec.lat, spec.lon, spec.radius = math.radians(lat), math.radians(lon), RADIUS_M
        spec.speed, spec.speed_units = self._speed_mps, imcpy.SpeedUnits.METERS_PS
        return StationKeepingManeuver(spec, self._vehicle, self._frame, now_s)
