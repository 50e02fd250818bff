"""What a simulated vehicle carries and can do: sonar, navigation, motor, battery."""

from __future__ import annotations

from dataclasses import dataclass, field

from simulator.sonars.mounting import STRAIGHT, SonarMounting
from simulator.sonars.sensors import SensorKind, SonarNoise
from simulator.sonars.swath import SwathSonar
from simulator.vehicles.battery import BatterySpec
from simulator.vehicles.vehicle import VehicleLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class Equipment:
    """One kind of vehicle; several vehicles may share it.

    Attributes
    ----------
    sensor
        Kind of sonar.
    noise
        Errors of its soundings; a swath sonar without any measures exactly.
    ping_period_s, max_range_m
        Simulated time between measurements, and how far they reach, of a sonar that is no swath sonar.
    swath
        What a swath sonar can do.
    mounting
        How the sonar really sits in the vehicle, which knows nothing of it.
    drift_m2ps
        Growth of the position variance under water.
    limits
        What it can do in motion; None: what an LAUV can.
    battery
        Once it is empty the motor is off: the vehicle drifts and floats up. None: energy without end.
    """

    sensor: SensorKind | str = SensorKind.SINGLE
    noise: SonarNoise = field(default_factory=SonarNoise)
    ping_period_s: float = 0.2
    max_range_m: float = 100.0
    swath: SwathSonar = field(default_factory=SwathSonar)
    mounting: SonarMounting = STRAIGHT
    drift_m2ps: float = 0.0
    limits: VehicleLimits | None = None
    battery: BatterySpec | None = None
