"""Messages in which a DUNE node reports on its vehicle."""

from __future__ import annotations

import math
import struct
from datetime import UTC, datetime

import imcpy
import numpy as np

from simulator.geodesy import LocalFrame
from simulator.sonars.sensors import DVL_TILT_RAD
from simulator.vehicles.battery import Battery
from simulator.vehicles.navigation import SURFACE_DEPTH_M
from simulator.world import BeamReturn, SimulatedVehicle, SwathPing

GPS_VALIDITY = 511
ALTITUDE_FILTER_S = 1.0
"""Time constant of ``EstimatedState.alt``, which lags behind the altimeter as DUNE's does."""


class Telemetry:
    """Fills the messages of one vehicle. They are reused from call to call: serialise before the next.

    ``EstimatedState.lat/lon`` is the origin of the terrain's frame, x and y the offsets north and east.
    """

    def __init__(self, vehicle: SimulatedVehicle, frame: LocalFrame, name: str, services: str) -> None:
        self._vehicle = vehicle
        self._frame = frame
        self._lat = math.radians(frame.lat_deg)
        self._lon = math.radians(frame.lon_deg)
        self._altitude_m = -1.0
        self._altitude_s = vehicle.time_s
        self._fix_deg = (frame.lat_deg, frame.lon_deg)
        self._estimated = imcpy.EstimatedState()
        self._estimated.lat, self._estimated.lon = self._lat, self._lon
        self._simulated = imcpy.SimulatedState()
        self._simulated.lat, self._simulated.lon = self._lat, self._lon
        self._distances: dict[tuple[str, int], imcpy.Distance] = {}
        self.navigation_failed = False
        """Whether the states hold no numbers where the position should be."""
        self._announce = imcpy.Announce()
        self._announce.sys_name = name
        self._announce.sys_type = imcpy.SystemType.UUV
        self._announce.owner = 0xFFFF
        self._announce.services = services

    def announce(self) -> imcpy.Announce:
        """Its name, position and addresses."""
        here = self._vehicle.position
        lat, lon = self._frame.to_geodetic(here.east_m, here.north_m)
        message = self._announce
        message.lat, message.lon = math.radians(lat), math.radians(lon)
        message.height = -here.depth_m
        return message

    def estimated_state(self) -> imcpy.EstimatedState:
        """Where the vehicle believes to be."""
        vehicle = self._vehicle
        m, here = vehicle.vehicle.motion, vehicle.position
        message = self._estimated
        message.x = math.nan if self.navigation_failed else here.north_m
        message.y, message.z = here.east_m, here.depth_m
        message.phi, message.theta, message.psi = m.roll_rad, m.pitch_rad, m.heading_rad
        message.u = m.surge_mps
        message.vx, message.vy, message.vz = m.vn_mps, m.ve_mps, m.vd_mps
        message.r = m.turn_rate_radps
        message.depth = here.depth_m
        message.alt = self._filtered_altitude()
        return message

    def simulated_state(self) -> imcpy.SimulatedState:
        """Where the vehicle really is."""
        m = self._vehicle.vehicle.motion
        message = self._simulated
        message.x, message.y, message.z = m.north_m, m.east_m, m.depth_m
        message.phi, message.theta, message.psi = m.roll_rad, m.pitch_rad, m.heading_rad
        message.u, message.r = m.surge_mps, m.turn_rate_radps
        message.svx, message.svy = self._vehicle.vehicle.current[1], self._vehicle.vehicle.current[0]
        return message

    def navigation_uncertainty(self) -> imcpy.NavigationUncertainty:
        """Variances of the position."""
        message = imcpy.NavigationUncertainty()
        message.x = message.y = self._vehicle.navigation.variance_m2
        return message

    def gps_fix(self) -> imcpy.GpsFix:
        """The fix at the surface; under water the last one goes on, marked invalid and ever less accurate."""
        vehicle, message = self._vehicle, imcpy.GpsFix()
        fixed = vehicle.navigation.has_fix
        if fixed:
            here = vehicle.position
            self._fix_deg = self._frame.to_geodetic(here.east_m, here.north_m)
        message.validity = GPS_VALIDITY if fixed else 0
        message.lat, message.lon = (math.radians(value) for value in self._fix_deg)
        message.satellites = 8 if fixed else 0
        message.sog = math.hypot(vehicle.vehicle.motion.ve_mps, vehicle.vehicle.motion.vn_mps) if fixed else 0.0
        message.hdop = 0.9 if fixed else 0.0
        message.hacc = 2.0 + vehicle.navigation.submerged_s
        moment = datetime.fromtimestamp(vehicle.time_s, UTC)
        message.utc_year, message.utc_month, message.utc_day = moment.year, moment.month, moment.day
        message.utc_time = moment.hour * 3600.0 + moment.minute * 60.0 + moment.second
        return message

    def fuel_level(self, battery: Battery) -> imcpy.FuelLevel:
        """What is left of the energy, and for how many hours that lasts in each mode of operation."""
        message = imcpy.FuelLevel()
        message.value, message.confidence = battery.level_pct, battery.spec.confidence_pct
        hours = {"Hotel": battery.time_left_s(0.0) / 3600.0, "Motion": battery.time_left_s() / 3600.0}
        message.opmodes = "".join(f"{mode}={left:g};" for mode, left in hours.items())
        return message

    def stream_velocity(self) -> imcpy.EstimatedStreamVelocity:
        """Velocity of the water: x north, y east."""
        message = imcpy.EstimatedStreamVelocity()
        message.y, message.x = self._vehicle.vehicle.current
        return message

    def sound_speed(self) -> imcpy.SoundSpeed:
        """How fast its probe says that sound is where it is; a negative speed is DUNE's word for none."""
        message = imcpy.SoundSpeed()
        measured = self._vehicle.measure_sound_speed()
        message.value = -1.0 if measured is None else measured
        return message

    def medium(self) -> imcpy.VehicleMedium:
        """At the surface or under water."""
        message = imcpy.VehicleMedium()
        submerged = self._vehicle.vehicle.motion.depth_m > SURFACE_DEPTH_M
        kinds = imcpy.VehicleMedium.MediumEnum
        message.medium = kinds.UNDERWATER if submerged else kinds.WATER
        return message

    def distance(self, measurement: BeamReturn) -> imcpy.Distance:
        """One beam's range.

        The device's rotation is the beam's direction: theta from the bow (-90 degrees is down), then psi
        around the hull, clockwise from above.
        """
        key = (measurement.source, measurement.beam)
        message = self._distances.get(key)
        if message is None:
            dvl = measurement.source == "DVL"
            message = _distance(
                theta=(DVL_TILT_RAD if dvl else 0.0) - 0.5 * math.pi,
                psi=math.radians(90.0 * measurement.beam) if dvl else 0.0,
                width=math.radians(3.8) if dvl else math.radians(1.0),
            )
            self._distances[key] = message
        kinds = imcpy.Distance.ValidityEnum
        message.validity = kinds.VALID if measurement.valid else kinds.INVALID
        message.value = measurement.range_m if measurement.valid else 0.0
        return message

    def forward_distance(self, range_m: float) -> imcpy.Distance:
        """The echo sounder in the bow, which looks forward and says nothing about the depth."""
        key = ("Echo Sounder", 0)
        if key not in self._distances:
            self._distances[key] = _distance(theta=0.0, psi=0.0, width=math.radians(10.0), x=1.0)
        message = self._distances[key]
        message.validity = imcpy.Distance.ValidityEnum.VALID
        message.value = range_m
        return message

    def acoustic_range(self, system: str, range_m: float) -> imcpy.AcousticOperation:
        """The answer to a range request: of DUNE's messages on ranges the one that its radio carries by default."""
        message = imcpy.AcousticOperation()
        message.op = imcpy.AcousticOperation.OperationEnum.RANGE_RECVED
        message.system = system
        message.range = range_m
        return message

    def sonar_data(self, ping: SwathPing, max_range_m: float) -> imcpy.SonarData:
        """One multibeam ping in IMC's format: count, start angle, flags, 16-bit ranges (0 for no return)."""
        message = imcpy.SonarData()
        message.type = imcpy.SonarData.TypeEnum.MULTIBEAM
        message.frequency = 400_000
        message.max_range = math.ceil(max_range_m)
        message.bits_per_point = 16
        message.scale_factor = max_range_m / 0xFFFF
        beam = imcpy.BeamConfig()
        beam.beam_width = float(ping.angles_rad[1] - ping.angles_rad[0])
        message.beam_config.append(beam)
        units = np.nan_to_num(ping.ranges_m / message.scale_factor).round().astype("<u2")
        message.data = struct.pack("<HfB", len(units), ping.angles_rad[0], 0) + units.tobytes()
        return message

    def _filtered_altitude(self) -> float:
        vehicle = self._vehicle
        altitude = vehicle.bottom_m - vehicle.vehicle.motion.depth_m
        if not math.isfinite(altitude):
            self._altitude_m = -1.0
        elif self._altitude_m < 0.0:
            self._altitude_m = altitude
        else:
            passed = vehicle.time_s - self._altitude_s
            self._altitude_m += (altitude - self._altitude_m) * -math.expm1(-passed / ALTITUDE_FILTER_S)
        self._altitude_s = vehicle.time_s
        return self._altitude_m


def _distance(*, theta: float, psi: float, width: float, x: float = 0.0) -> imcpy.Distance:
    message = imcpy.Distance()
    device = imcpy.DeviceState()
    device.x, device.theta, device.psi = x, theta, psi
    message.location.append(device)
    beam = imcpy.BeamConfig()
    beam.beam_width = beam.beam_height = width
    message.beam_config.append(beam)
    return message
