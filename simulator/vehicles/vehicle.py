"""Motion of a torpedo-shaped AUV of the LAUV class: surge, turn and climb within limits, guided to a target.

The figures were read off a LAUV flown by DUNE's own simulation: full pitch of 0.26 rad (0.3 m/s of
descent at 1.25 m/s), turns of 0.35 rad/s, 0.13 m/s2 from standstill, loiter of 7.5 m radius clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

STEP_S = 0.1
"""Length of one integration step of simulated time."""

TOO_CLOSE = 0.98
"""A target nearer to the centre of the vehicle's turning circle than this share of its radius cannot be turned to."""

LEFT_BEHIND = 1.4
"""From this share of the radius on it can be turned to again, whatever the turn needs to build up."""


HOVER_M, AHEAD = 0.2, 0.95
"""Within this distance a hovering vehicle stays where it is; it goes once the cosine to its target is above that."""


class Guidance(StrEnum):
    """What the vehicle does about its target."""

    IDLE = "idle"
    """Motor off: drifts with the current and floats up."""
    GOTO = "goto"
    """Heads straight for the target."""
    LOITER = "loiter"
    """Circles around the target."""


@dataclass(frozen=True, slots=True)
class VehicleLimits:
    """What the vehicle can do. Defaults are those of a LAUV.

    Attributes
    ----------
    min_speed_mps, max_speed_mps
        Commanded speeds are brought within these (below the least speed the fins have no authority).
    acceleration_mps2
        Largest change of speed through the water.
    turn_rate_radps
        Largest rate of turn.
    pitch_rad, pitch_rate_radps
        Largest pitch and its rate of change.
    buoyancy_mps
        Ascent with the motor off.
    loiter_radius_m
        Circle flown around a reached target.
    hovers
        Whether it has thrusters for it: turns on the spot, slows down before its target and stays there.
    """

    min_speed_mps: float = 0.7
    max_speed_mps: float = 1.8
    acceleration_mps2: float = 0.13
    turn_rate_radps: float = 0.35
    pitch_rad: float = 0.26
    pitch_rate_radps: float = 0.15
    buoyancy_mps: float = 0.15
    loiter_radius_m: float = 7.5
    hovers: bool = False


BOAT = VehicleLimits(
    min_speed_mps=0.1, max_speed_mps=1.5, acceleration_mps2=0.5, turn_rate_radps=1.0, buoyancy_mps=0.0, hovers=True
)
"""A small boat with two thrusters, or a hovering underwater vehicle."""


@dataclass(slots=True)
class Motion:
    """Position in the local frame and attitude; the integrator changes it in place.

    ``heading_rad`` is clockwise from north within (-pi, pi], ``pitch_rad`` positive nose up, ``roll_rad``
    positive starboard down, ``surge_mps`` through the water, ``ve_mps``, ``vn_mps``, ``vd_mps`` over ground.
    """

    east_m: float = 0.0
    north_m: float = 0.0
    depth_m: float = 0.0
    heading_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    surge_mps: float = 0.0
    turn_rate_radps: float = 0.0
    ve_mps: float = 0.0
    vn_mps: float = 0.0
    vd_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class SteeringTarget:
    """Where to go: a place, a speed, and either a depth or an altitude above the bottom."""

    east_m: float
    north_m: float
    z_m: float
    speed_mps: float = 1.2
    by_altitude: bool = False


class Vehicle:
    """Integrates the motion of one vehicle in steps of :data:`STEP_S`.

    Parameters
    ----------
    motion
        Where it starts.
    limits
        What it can do.
    current
        Velocity of the water, (east, north) in m/s.
    """

    def __init__(
        self,
        motion: Motion | None = None,
        limits: VehicleLimits | None = None,
        current: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.motion = motion or Motion()
        self.limits = limits or VehicleLimits()
        self.current = current
        self.guidance = Guidance.IDLE
        self.target: SteeringTarget | None = None
        self._leaving = False
        self.loiter_radius_m = self.limits.loiter_radius_m
        self.clockwise = True
        self.distance_m = 0.0

    def goto(self, target: SteeringTarget) -> None:
        """Head straight for a target."""
        if target != self.target:
            self._leaving = False
        self.target = target
        self.guidance = Guidance.GOTO

    def loiter(self, radius_m: float | None = None, *, clockwise: bool = True) -> None:
        """Circle around the present target."""
        self.loiter_radius_m = radius_m if radius_m else self.limits.loiter_radius_m
        self.clockwise = clockwise
        self.guidance = Guidance.LOITER

    def idle(self) -> None:
        """Motor off."""
        self.guidance = Guidance.IDLE

    def step(self, error_m: tuple[float, float], bottom_m: float) -> bool:
        """Advance by one step.

        Parameters
        ----------
        error_m
            Error (east, north) of the vehicle's own position estimate: it steers by where it believes to be.
        bottom_m
            Depth of the sea floor below the vehicle, NaN where unknown.

        Returns
        -------
        Whether the vehicle hit the bottom in this step (it then lies on it).
        """
        m, lim = self.motion, self.limits
        target = self.target
        if target is None or self.guidance is Guidance.IDLE:
            wanted_speed, wanted_turn, wanted_pitch = 0.0, 0.0, 0.0
        else:
            wanted_speed = min(max(target.speed_mps, lim.min_speed_mps), lim.max_speed_mps)
            wanted_turn = self._turn_rate(target, m.east_m + error_m[0], m.north_m + error_m[1])
            wanted_pitch = self._pitch(target, bottom_m)
            if lim.hovers:
                wanted_speed = self._hovering_speed(target, wanted_speed, error_m)

        m.surge_mps += _clip(wanted_speed - m.surge_mps, lim.acceleration_mps2 * STEP_S)
        # Fins need flow: no turning on the spot.
        authority = 1.0 if lim.hovers else min(1.0, m.surge_mps / lim.min_speed_mps)
        m.turn_rate_radps = _clip(wanted_turn, lim.turn_rate_radps * authority)
        m.heading_rad = wrap(m.heading_rad + m.turn_rate_radps * STEP_S)
        m.pitch_rad += _clip(wanted_pitch * authority - m.pitch_rad, lim.pitch_rate_radps * STEP_S)
        m.roll_rad = 0.15 * m.turn_rate_radps

        forward = m.surge_mps * math.cos(m.pitch_rad)
        m.ve_mps = forward * math.sin(m.heading_rad) + self.current[0]
        m.vn_mps = forward * math.cos(m.heading_rad) + self.current[1]
        m.vd_mps = -m.surge_mps * math.sin(m.pitch_rad)
        if self.guidance is Guidance.IDLE and m.depth_m > 0.0:
            m.vd_mps -= lim.buoyancy_mps * (1.0 - authority)

        before = m.depth_m
        m.east_m += m.ve_mps * STEP_S
        m.north_m += m.vn_mps * STEP_S
        m.depth_m = max(0.0, m.depth_m + m.vd_mps * STEP_S)
        hit = m.depth_m >= bottom_m
        if hit:
            m.depth_m = max(0.0, bottom_m)
        m.vd_mps = (m.depth_m - before) / STEP_S
        self.distance_m += math.hypot(m.ve_mps, m.vn_mps, m.vd_mps) * STEP_S
        return hit

    def _hovering_speed(self, target: SteeringTarget, cruise_mps: float, error_m: tuple[float, float]) -> float:
        """Return the speed of a vehicle that turns before it goes, brakes in time and stays where it arrived."""
        m = self.motion
        de, dn = target.east_m - m.east_m - error_m[0], target.north_m - m.north_m - error_m[1]
        left_m = math.hypot(de, dn)
        if left_m < HOVER_M:
            return 0.0
        ahead = math.cos(wrap(math.atan2(de, dn) - m.heading_rad))
        return min(cruise_mps, math.sqrt(self.limits.acceleration_mps2 * left_m)) * (ahead if ahead > AHEAD else 0.0)

    def _turn_rate(self, target: SteeringTarget, east_m: float, north_m: float) -> float:
        de, dn = target.east_m - east_m, target.north_m - north_m
        course = math.atan2(de, dn)
        if self.limits.hovers:
            near = math.hypot(de, dn) < HOVER_M
            return 0.0 if near else 1.2 * wrap(self._heading_for(course) - self.motion.heading_rad)
        if self.guidance is Guidance.LOITER:
            side = 1.0 if self.clockwise else -1.0
            # Vector field around a circle: tangential on it, steeper inwards or outwards the farther away.
            radial = math.atan(2.0 * (math.hypot(de, dn) - self.loiter_radius_m) / self.loiter_radius_m)
            course += side * (radial - 0.5 * math.pi)
            feed_forward = side * self.motion.surge_mps / self.loiter_radius_m
        else:
            if self._too_close_to_turn(de, dn):
                return 0.0
            feed_forward = 0.0
        heading = self._heading_for(course)
        return 1.2 * wrap(heading - self.motion.heading_rad) + feed_forward

    def _too_close_to_turn(self, de: float, dn: float) -> bool:
        """Whether a target is too close at the side to be reached by turning: first leave it behind.

        It is left behind by some margin: at the very edge of the turning circle a vehicle would for ever alternate
        between turning and leaving.
        """
        m = self.motion
        radius = m.surge_mps / self.limits.turn_rate_radps
        close = (LEFT_BEHIND if self._leaving else TOO_CLOSE) * radius
        if math.hypot(de, dn) >= close + radius:  # no centre can be so near
            self._leaving = False
            return False
        aside_e, aside_n = radius * math.cos(m.heading_rad), -radius * math.sin(m.heading_rad)
        nearest = min(math.hypot(de - aside_e, dn - aside_n), math.hypot(de + aside_e, dn + aside_n))
        self._leaving = nearest < close
        return self._leaving

    def _heading_for(self, course: float) -> float:
        """Heading that makes good a course in the current, as far as the vehicle is fast enough."""
        speed = self.motion.surge_mps
        east, north = self.current
        if speed <= 0.05 or (east == 0.0 and north == 0.0):
            return course
        cross = east * math.cos(course) - north * math.sin(course)
        return course - math.asin(max(-0.95, min(0.95, cross / speed)))

    def _pitch(self, target: SteeringTarget, bottom_m: float) -> float:
        m, lim = self.motion, self.limits
        wanted = target.z_m
        if target.by_altitude:
            wanted = max(0.0, bottom_m - target.z_m) if math.isfinite(bottom_m) else m.depth_m
        # Braking distance of the pitch: level off early enough not to overshoot.
        return _clip(0.18 * (m.depth_m - wanted), lim.pitch_rad)


def wrap(angle_rad: float) -> float:
    """The same angle within (-pi, pi]."""
    if -math.pi < angle_rad <= math.pi:
        return angle_rad
    wrapped = math.remainder(angle_rad, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


def _clip(value: float, limit: float) -> float:
    return limit if value > limit else -limit if value < -limit else value
