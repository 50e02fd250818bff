"""Simulated vehicles over a sea floor, without any network: motion, navigation and sonar in one.

The fake DUNE nodes and the service's in-process fleet link are two faces of :class:`SimulatedVehicle`.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from simulator.arrays import FloatArray
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain
from simulator.sonars.frames import to_local_frame
from simulator.sonars.sensors import SensorKind, Sonar
from simulator.sonars.swath import SwathErrors, SwathSounder
from simulator.vehicles.battery import Battery
from simulator.vehicles.navigation import Navigation
from simulator.vehicles.vehicle import STEP_S, Guidance, Motion, SteeringTarget, Vehicle
from simulator.water_column import WaterColumn

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LocalPosition:
    """A position in the local frame; depth positive down."""

    east_m: float
    north_m: float
    depth_m: float

    def horizontal_distance_m(self, east_m: float, north_m: float) -> float:
        """Distance in the plane to another place."""
        return math.hypot(self.east_m - east_m, self.north_m - north_m)


@dataclass(frozen=True, slots=True)
class BeamReturn:
    """One return of one beam.

    Attributes
    ----------
    vehicle, time_s, source, beam
        Vehicle, time (the vehicle's clock, seconds), device ("Altimeter", "DVL"), beam.
    range_m
        Along the beam; NaN when there was no return.
    position
        Where the vehicle believed to be.
    heading_rad, pitch_rad, roll_rad
        Its attitude.
    footprint
        Where the beam met the bottom by the vehicle's own estimate; None without a return.
    beam_rad
        Azimuth of the beam from the bow and angle from straight down in the vehicle; None: its range is vertical.
    true_position
        Where the vehicle really was.
    """

    vehicle: str
    time_s: float
    source: str
    beam: int
    range_m: float
    position: LocalPosition
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    footprint: LocalPosition | None
    true_position: LocalPosition
    beam_rad: tuple[float, float] | None = None

    @property
    def valid(self) -> bool:
        """Whether there was a return."""
        return self.footprint is not None


@dataclass(frozen=True, slots=True, eq=False)
class SwathPing:
    """One ping of a swath sonar, which by the vehicle's reckoning sits in its middle.

    Attributes
    ----------
    vehicle, time_s, source
        Vehicle, time (the vehicle's clock, seconds), device.
    position
        Where the vehicle believed to be, by its position's latency earlier.
    heading_rad, pitch_rad, roll_rad
        Its attitude.
    angles_rad : (b,)
        Of the beams from straight down in the vehicle, positive to starboard.
    ranges_m : (b,)
        Slant ranges, NaN where nothing was detected.
    true_position
        Where the vehicle really was.
    """

    vehicle: str
    time_s: float
    source: str
    position: LocalPosition
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    angles_rad: FloatArray
    ranges_m: FloatArray
    true_position: LocalPosition


SOURCES = {
    SensorKind.SINGLE: "Altimeter",
    SensorKind.DVL: "DVL",
    SensorKind.MULTIBEAM: "Multibeam",
}

DOWN = [[0.0, 0.0, 1.0]]

GLIDES_BESIDE_M = 2.0
"""A vehicle that is to stop somewhere switches its motor off where it glides past that place at most so far away."""
FLOATS_FROM_M = 5.0
"""It floats up from there, unless it is deeper than this."""
AT_REST_MPS = 0.05

PROBE_PERIOD_S = 0.25
"""A sound velocity probe measures so often."""
PROBE_SD_MPS = 0.05
"""Standard deviation of what it measures."""


@dataclass(frozen=True, slots=True)
class VehicleState:
    """A vehicle at one moment.

    ``position`` is its own estimate, ``true_position`` the truth; ``altitude_m`` is true and NaN over unknown
    floor; ``position_variance_m2`` is per axis, as the vehicle reports it.
    """

    time_s: float
    position: LocalPosition
    true_position: LocalPosition
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    speed_mps: float
    altitude_m: float
    position_variance_m2: float
    has_fix: bool
    guidance: Guidance
    collisions: int
    distance_m: float


class SimulatedVehicle:
    """A vehicle that swims over a terrain and measures it.

    Parameters
    ----------
    name
        Unique within the fleet.
    terrain
        The truth.
    start
        (east, north, depth) in metres, heading optional through ``heading_rad``.
    rng
        Source of all its randomness; the same generator state gives the same run.
    equipment
        What it carries and can do.
    current
        Water velocity (east, north), m/s.
    water
        How fast sound is in it, which vehicles have a probe for then; None: as fast as sonars assume, everywhere.
    start_time_s
        The vehicle's clock at the start.

    Raises
    ------
    ValueError
        When the start lies outside of the terrain or below its bottom.
    """

    def __init__(
        self,
        name: str,
        terrain: Terrain,
        start: Sequence[float],
        rng: np.random.Generator,
        equipment: Equipment | None = None,
        *,
        heading_rad: float = 0.0,
        current: tuple[float, float] = (0.0, 0.0),
        water: WaterColumn | None = None,
        start_time_s: float = 0.0,
    ) -> None:
        east, north, depth = (float(value) for value in start)
        if not terrain.contains(east, north):
            raise ValueError(
                f"{name}: start ({east:g}, {north:g}) lies outside of the terrain; "
                f"east must be 0 to {terrain.width_m:g} m and north 0 to {terrain.height_m:g} m"
            )
        floor = terrain.depth_at_point(east, north)
        if depth < 0.0 or depth > floor:
            raise ValueError(f"{name}: start depth {depth:g} m is not between the surface and {floor:.2f} m")
        carried = equipment or Equipment()
        self.name = name
        self.terrain = terrain
        self.time_s = float(start_time_s)
        self.vehicle = Vehicle(Motion(east, north, depth, heading_rad), carried.limits, current)
        sonar_rng, navigation_rng, self._probe_rng = rng.spawn(3)
        self.water = water
        self.battery = None if carried.battery is None else Battery(carried.battery)
        self.navigation = Navigation(carried.drift_m2ps, navigation_rng)
        self.sonar: Sonar | SwathSounder = (
            SwathSounder(carried.swath, SwathErrors.of(carried.noise), sonar_rng, carried.mounting, water)
            if carried.sensor == SensorKind.MULTIBEAM
            else Sonar(
                SensorKind(carried.sensor),
                carried.noise,
                sonar_rng,
                ping_period_s=carried.ping_period_s,
                max_range_m=carried.max_range_m,
                mounting=carried.mounting,
                water=water,
            )
        )
        self.collisions: list[tuple[float, LocalPosition]] = []
        """Time and place of every contact with the bottom (one entry per contact, not per step)."""
        self._latency_s = carried.mounting.latency_s
        self._places: deque[tuple[float, float, float]] = deque([(self.time_s, *self.en_m)])
        """Times and where it believed to be then, as far back as its positions are late."""
        self._arrival_radius_m = 0.0
        self._pass_within_m = -1.0
        self._stops = False
        self._set_out_m = (east, north)
        self._touching = False
        self._start_time_s = self.time_s
        self._steps = 0
        self._pending_s = 0.0
        self._pings = 0

    @property
    def collided(self) -> bool:
        """Whether it ever hit the bottom."""
        return bool(self.collisions)

    @property
    def true_position(self) -> LocalPosition:
        """Where it is."""
        m = self.vehicle.motion
        return LocalPosition(m.east_m, m.north_m, m.depth_m)

    @property
    def position(self) -> LocalPosition:
        """Where it believes to be (depth comes from a pressure sensor and is true)."""
        return LocalPosition(*self.en_m, self.vehicle.motion.depth_m)

    @property
    def en_m(self) -> tuple[float, float]:
        """Where it believes to be, east and north: most steps ask for no more."""
        m, (de, dn) = self.vehicle.motion, self.navigation.error_m
        return m.east_m + de, m.north_m + dn

    @property
    def late_position(self) -> LocalPosition:
        """Where it believed to be when its position was taken that goes with a ping of now; depth is that of now."""
        if not self._latency_s:
            return self.position
        time_s, east_m, north_m = np.array(self._places).T
        then_s = self.time_s - self._latency_s
        east, north = (float(np.interp(then_s, time_s, at_m)) for at_m in (east_m, north_m))
        return LocalPosition(east, north, self.vehicle.motion.depth_m)

    def _remember_place(self) -> None:
        self._places.append((self.time_s, *self.en_m))
        while self._places[1][0] <= self.time_s - self._latency_s:
            self._places.popleft()

    @property
    def bottom_m(self) -> float:
        """Depth of the sea floor below the vehicle, NaN where unknown."""
        m = self.vehicle.motion
        return self.terrain.depth_at_point(m.east_m, m.north_m)

    @property
    def state(self) -> VehicleState:
        """Everything about it now."""
        m = self.vehicle.motion
        return VehicleState(
            time_s=self.time_s,
            position=self.position,
            true_position=self.true_position,
            heading_rad=m.heading_rad,
            pitch_rad=m.pitch_rad,
            roll_rad=m.roll_rad,
            speed_mps=math.hypot(m.ve_mps, m.vn_mps),
            altitude_m=self.bottom_m - m.depth_m,
            position_variance_m2=self.navigation.variance_m2,
            has_fix=self.navigation.has_fix,
            guidance=self.vehicle.guidance,
            collisions=len(self.collisions),
            distance_m=self.vehicle.distance_m,
        )

    @property
    def arrived(self) -> bool:
        """Whether the last ``go_to`` has been reached (and the vehicle stays there), or passed as it allowed."""
        if self.vehicle.target is None:
            return False
        if self._stops and self.vehicle.guidance is Guidance.IDLE:
            return self._off_m(self.vehicle.target) <= self._arrival_radius_m + GLIDES_BESIDE_M
        return self.vehicle.guidance is Guidance.LOITER or self._passed(self.vehicle.target)

    def _off_m(self, target: SteeringTarget) -> float:
        east, north = self.en_m
        return math.hypot(east - target.east_m, north - target.north_m)

    def _passed(self, target: SteeringTarget) -> bool:
        """Whether it is beyond its target, as seen from where it set out, and not too far to the side."""
        (east, north), (from_e, from_n) = self.en_m, self._set_out_m
        off_e, off_n = east - target.east_m, north - target.north_m
        beyond = off_e * (target.east_m - from_e) + off_n * (target.north_m - from_n) >= 0.0
        return beyond and math.hypot(off_e, off_n) <= self._pass_within_m

    def go_to(
        self,
        east_m: float,
        north_m: float,
        depth_m: float,
        speed_mps: float = 1.2,
        *,
        arrival_radius_m: float = 5.0,
        pass_within_m: float | None = None,
        loiter_radius_m: float | None = None,
        by_altitude: bool = False,
        stops: bool = False,
    ) -> None:
        """Head for a place and stay there; replaces the present target.

        Parameters
        ----------
        east_m, north_m, depth_m
            The place by the vehicle's own reckoning; ``depth_m`` is an altitude with ``by_altitude``.
        speed_mps
            Through the water, brought within the vehicle's limits.
        arrival_radius_m
            Within this distance in the plane the target counts as reached.
        pass_within_m
            It counts as reached, too, once the vehicle is beyond it and no farther away than this; None: it does not.
        loiter_radius_m
            Circle flown after arrival; the vehicle's own when None.
        stops
            Whether its motor is off there, so that it floats up: it is switched off so early that the vehicle glides
            there. One that comes from too deep to float up circles.
        """
        values = (east_m, north_m, depth_m, speed_mps, arrival_radius_m)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"{self.name}: target {values} holds a value that is not finite")
        self._arrival_radius_m = arrival_radius_m
        self._pass_within_m = -1.0 if pass_within_m is None else pass_within_m
        self._stops = stops
        self._set_out_m = self.en_m
        self.vehicle.loiter_radius_m = loiter_radius_m or self.vehicle.limits.loiter_radius_m
        self.vehicle.goto(SteeringTarget(east_m, north_m, depth_m, speed_mps, by_altitude))

    def float_at(self, east_m: float, north_m: float) -> None:
        """Put it onto the surface somewhere, beside the terrain too."""
        motion = self.vehicle.motion
        motion.east_m, motion.north_m, motion.depth_m = east_m, north_m, 0.0
        self._set_out_m = (east_m, north_m)

    def stop(self) -> None:
        """Motor off: the vehicle floats up."""
        self.vehicle.idle()
        self.vehicle.target = None

    def advance(self, dt_s: float) -> list[BeamReturn]:
        """Let simulated time pass and return what a sonar of few beams measured, in time order.

        Whole steps of 0.1 s are integrated; a remainder is kept for the next call.
        """
        return [measured for _ in self._live(dt_s) for measured in self.measure()]

    def advance_swath(self, dt_s: float) -> list[SwathPing]:
        """Let simulated time pass as :meth:`advance` and return the pings of a swath sonar."""
        return [self.measure_swath() for _ in self._live(dt_s)]

    def _live(self, dt_s: float) -> Iterator[None]:
        """Let time pass; yields whenever a ping is due."""
        if not (math.isfinite(dt_s) and dt_s >= 0.0):
            raise ValueError(f"{self.name}: dt_s is {dt_s}; it must be a time of 0 or more seconds")
        self._pending_s += dt_s
        while self._pending_s >= STEP_S - 1e-9:
            self._pending_s -= STEP_S
            if self.step():
                yield

    def step(self) -> bool:
        """One step of 0.1 s; returns whether a ping is due."""
        vehicle = self.vehicle
        m = vehicle.motion
        if self.battery is not None:
            if self.battery.empty:
                self.stop()
            self.battery.drain(STEP_S, 0.0 if vehicle.guidance is Guidance.IDLE else m.surge_mps)
        hit = vehicle.step(self.navigation.error_m, self.bottom_m)
        self._steps += 1
        self.time_s = self._start_time_s + self._steps * STEP_S
        if hit and not self._touching:
            place = self.true_position
            self.collisions.append((self.time_s, place))
            log.warning(
                "%s hit the bottom at east %.1f m, north %.1f m, depth %.2f m",
                self.name,
                place.east_m,
                place.north_m,
                place.depth_m,
            )
        self._touching = hit
        self.navigation.step(m.depth_m, STEP_S)
        if self._latency_s:
            self._remember_place()
        target = vehicle.target
        if target is not None and self._stops and m.depth_m <= FLOATS_FROM_M:
            self._stop_in_time(target)
        on_its_way = vehicle.guidance is Guidance.GOTO and self._arrival_radius_m > 0.0
        if target is not None and on_its_way and self._off_m(target) <= self._arrival_radius_m:
            vehicle.loiter(vehicle.loiter_radius_m)
        due = int((self._steps * STEP_S + 1e-9) / self.sonar.ping_period_s)
        if due > self._pings:
            self._pings = due
            return True
        return False

    def _stop_in_time(self, target: SteeringTarget) -> None:
        """Switch the motor off where the vehicle glides to its place, and on again where it did not get near that."""
        vehicle, (east, north), off_m = self.vehicle, self.en_m, self._off_m(target)
        speed_mps = vehicle.motion.surge_mps
        if vehicle.guidance is Guidance.GOTO:
            course_rad = math.atan2(target.east_m - east, target.north_m - north) - vehicle.motion.heading_rad
            glides_m = speed_mps**2 / (2.0 * vehicle.limits.acceleration_mps2)
            in_line = math.cos(course_rad) > 0.0 and off_m * abs(math.sin(course_rad)) <= GLIDES_BESIDE_M
            if off_m <= self._arrival_radius_m or (in_line and off_m <= glides_m):
                vehicle.idle()
        elif vehicle.guidance is Guidance.IDLE and speed_mps < AT_REST_MPS and not self.arrived:
            vehicle.goto(target)

    def measure_sound_speed(self) -> float | None:
        """What its probe makes of the water now, metres per second; None: it has none."""
        if self.water is None:
            return None
        return self.water.speed_mps(self.vehicle.motion.depth_m) + PROBE_SD_MPS * self._probe_rng.standard_normal()

    def measure_swath(self) -> SwathPing:
        """One ping of a swath sonar now."""
        if not isinstance(self.sonar, SwathSounder):
            raise ValueError(f"{self.name}: its sonar is {self.sonar.kind}, not multibeam")
        m = self.vehicle.motion
        return SwathPing(
            vehicle=self.name,
            time_s=self.time_s,
            source=SOURCES[self.sonar.kind],
            position=self.late_position,
            heading_rad=m.heading_rad,
            pitch_rad=m.pitch_rad,
            roll_rad=m.roll_rad,
            angles_rad=self.sonar.angles_rad,
            ranges_m=self.sonar.ping(self.terrain, m),
            true_position=self.true_position,
        )

    def measure(self) -> list[BeamReturn]:
        """One ping of a sonar of few beams now: a measurement per beam."""
        if isinstance(self.sonar, SwathSounder):
            raise ValueError(f"{self.name}: its sonar is multibeam, which measures whole swaths")
        m = self.vehicle.motion
        here, true = self.late_position, self.true_position
        if self.sonar.kind is SensorKind.SINGLE:
            ranges, directions = [self.sonar.ping_below(self.terrain, m)], DOWN
            pointed: list[tuple[float, float] | None] = [None]
        else:
            ranges = self.sonar.ping(self.terrain, m).tolist()
            beams = self.sonar.beams
            pointed = list(zip(beams.azimuth_rad.tolist(), beams.tilt_rad.tolist(), strict=True))
            directions = to_local_frame(beams.body, m.heading_rad, m.pitch_rad, m.roll_rad).tolist()
        source = SOURCES[self.sonar.kind]
        out = []
        for beam, (r, (de, dn, dd)) in enumerate(zip(ranges, directions, strict=True)):
            footprint = (
                LocalPosition(here.east_m + r * de, here.north_m + r * dn, here.depth_m + r * dd)
                if math.isfinite(r)
                else None
            )
            out.append(
                BeamReturn(
                    vehicle=self.name,
                    time_s=self.time_s,
                    source=source,
                    beam=beam,
                    range_m=r,
                    position=here,
                    heading_rad=m.heading_rad,
                    pitch_rad=m.pitch_rad,
                    roll_rad=m.roll_rad,
                    footprint=footprint,
                    true_position=true,
                    beam_rad=pointed[beam],
                )
            )
        return out
