"""The FollowReference maneuver: flies the vehicle to the latest Reference of its controlling system."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import imcpy

from simulator.geodesy import LocalFrame
from simulator.vehicles.vehicle import SteeringTarget
from simulator.world import SimulatedVehicle

HORIZONTAL_TOLERANCE_M = 15.0
VERTICAL_TOLERANCE_M = 1.0
ARRIVAL_TIME_S = 5.0
"""The path controller calls a target near when it is this far ahead in time."""
NEW_PATH_TIMEOUT_S = 5.0
"""A path that ended must be followed by a new one within this time."""
DEFAULT_SPEED_MPS = 1.0

ANY_SYSTEM = 0xFFFF
ANY_ENTITY = 0xFF


class Flag(IntEnum):
    """Bits of ``Reference.flags``."""

    LOCATION = 0x01
    SPEED = 0x02
    Z = 0x04
    RADIUS = 0x08
    DONE = 0x80


class Proximity(IntEnum):
    """Bits of ``FollowRefState.proximity``."""

    FAR = 0x01
    XY_NEAR = 0x02
    Z_NEAR = 0x04


class State(IntEnum):
    """Values of ``FollowRefState.state``."""

    WAIT = 1
    GOTO = 2
    LOITER = 3
    HOVER = 4
    ELEVATOR = 5
    TIMEOUT = 6


@dataclass(frozen=True, slots=True)
class _Order:
    """What the latest references add up to."""

    east_m: float
    north_m: float
    z_m: float
    by_altitude: bool
    speed_mps: float
    radius_m: float


class FollowReference:
    """One execution of the maneuver.

    The circle flown on arrival has the Reference's radius, or the vehicle's own where that is zero. Like DUNE
    it takes no notice of the specification's ``loiter_radius``.

    Parameters
    ----------
    spec
        The maneuver's IMC specification.
    vehicle, frame
        Whom it steers, and where the vehicle's local frame lies.
    now_s
        The vehicle's clock at the start.
    """

    def __init__(self, spec: imcpy.FollowReference, vehicle: SimulatedVehicle, frame: LocalFrame, now_s: float) -> None:
        self.control_src = int(spec.control_src)
        self.control_ent = int(spec.control_ent)
        self.timeout_s = float(spec.timeout)
        self.state = State.WAIT
        self.proximity = int(Proximity.FAR)
        self.reference: imcpy.Reference | None = None
        self._vehicle = vehicle
        self._frame = frame
        self._order: _Order | None = None
        self._last_s = now_s
        self._near_since_s: float | None = None

    def accepts(self, reference: imcpy.Reference) -> bool:
        """Whether a Reference comes from the controlling system and entity."""
        return self.control_src in (ANY_SYSTEM, reference.src) and self.control_ent in (
            ANY_ENTITY,
            reference.src_ent,
        )

    def follow(self, reference: imcpy.Reference, now_s: float) -> bool:
        """Take an accepted Reference; True when it ends the maneuver."""
        self._last_s = now_s
        if reference.flags & Flag.DONE:
            return True
        self.reference = reference
        order = self._resolve(reference)
        changed = order != self._order
        self._order = order
        xy_near, z_near = self._nearness(order)
        if changed or self.state is State.WAIT:
            self.state = self._first_state(order, xy_near, z_near)
        else:
            self.state = self._next_state(order, xy_near, z_near)
        self.proximity = xy_near * Proximity.XY_NEAR | z_near * Proximity.Z_NEAR or int(Proximity.FAR)
        self._steer(order)
        return False

    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Why the maneuver fails now, None while it goes on.

        The flag says whether the vehicle goes through ERROR (a task failed) or straight into service.
        """
        if self.timeout_s > 0.0 and now_s - self._last_s > self.timeout_s:
            self.state = State.TIMEOUT
            return "FollowReference maneuver error: reference source timed out", False
        order = self._order
        if self.state is not State.GOTO or order is None:
            return None
        if not self._near(order):
            self._near_since_s = None
        elif self._near_since_s is None:
            self._near_since_s = now_s
        elif now_s - max(self._near_since_s, self._last_s) > NEW_PATH_TIMEOUT_S:
            return "Path Control: expected new path control reference", True
        return None

    def state_message(self) -> imcpy.FollowRefState:
        """The maneuver's FollowRefState."""
        message = imcpy.FollowRefState()
        message.control_src = self.control_src
        message.control_ent = self.control_ent
        message.state = imcpy.FollowRefState.StateEnum(int(self.state))
        message.proximity = self.proximity
        if self.reference is not None:
            message.reference = self.reference
        return message

    def _resolve(self, reference: imcpy.Reference) -> _Order:
        """Fill what a Reference leaves out from the earlier ones."""
        old, here = self._order, self._vehicle.position
        flags = reference.flags
        if flags & Flag.LOCATION:
            east, north = self._frame.to_local(math.degrees(reference.lat), math.degrees(reference.lon))
        elif old is not None:
            east, north = old.east_m, old.north_m
        else:
            east, north = here.east_m, here.north_m
        z, by_altitude = (old.z_m, old.by_altitude) if old is not None else (0.0, False)
        if flags & Flag.Z and reference.z is not None:
            z, by_altitude = float(reference.z.value), int(reference.z.z_units) == int(imcpy.ZUnits.ALTITUDE)
        speed = old.speed_mps if old is not None else DEFAULT_SPEED_MPS
        if flags & Flag.SPEED and reference.speed is not None:
            speed = _metres_per_second(reference.speed)
        return _Order(east, north, z, by_altitude, speed, float(reference.radius))

    def _distance_m(self, order: _Order) -> float:
        return self._vehicle.position.horizontal_distance_m(order.east_m, order.north_m)

    def _nearness(self, order: _Order) -> tuple[bool, bool]:
        vehicle = self._vehicle
        z = vehicle.bottom_m - vehicle.position.depth_m if order.by_altitude else vehicle.position.depth_m
        return (
            self._distance_m(order) < abs(order.radius_m) + HORIZONTAL_TOLERANCE_M,
            abs(z - order.z_m) < VERTICAL_TOLERANCE_M,
        )

    def _near(self, order: _Order) -> bool:
        return self._distance_m(order) <= ARRIVAL_TIME_S * max(self._vehicle.vehicle.motion.surge_mps, 0.1)

    def _first_state(self, order: _Order, xy_near: bool, z_near: bool) -> State:
        # DUNE does not fly to a reference that is within its tolerance already: it circles around it at once.
        return self._at_target(order, z_near) if xy_near else State.GOTO

    def _next_state(self, order: _Order, xy_near: bool, z_near: bool) -> State:
        if self.state is State.GOTO:
            return self._at_target(order, z_near) if self._near(order) else State.GOTO
        if self.state is State.HOVER and not xy_near:
            return State.GOTO
        if self.state is State.ELEVATOR:
            return self._at_target(order, z_near)
        return self.state

    @staticmethod
    def _at_target(order: _Order, z_near: bool) -> State:
        if not z_near:
            return State.ELEVATOR
        at_surface = order.z_m == 0.0 and not order.by_altitude
        return State.HOVER if at_surface else State.LOITER

    def _steer(self, order: _Order) -> None:
        craft = self._vehicle.vehicle
        if self.state is State.HOVER or order.speed_mps == 0.0:
            craft.idle()
            return
        target = SteeringTarget(order.east_m, order.north_m, order.z_m, order.speed_mps, order.by_altitude)
        craft.goto(target)
        if self.state is not State.GOTO:
            craft.loiter(abs(order.radius_m), clockwise=order.radius_m >= 0.0)


def _metres_per_second(speed: imcpy.DesiredSpeed) -> float:
    units = int(speed.speed_units)
    if units == int(imcpy.SpeedUnits.RPM):
        return float(speed.value) * 0.0012
    if units == int(imcpy.SpeedUnits.PERCENTAGE):
        return float(speed.value) * 0.02
    return float(speed.value)
