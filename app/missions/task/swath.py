"""What a mission has to ensonify, and the swath sonars that it has for that."""

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import shapely
from shapely.geometry import Polygon

from app.arrays import BoolArray
from app.estimation.swath import SwathSonar
from app.exploration.core.coverage import Coverage, SwathTask
from app.missions.spec.mission import MissionSpec
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.vehicle import Sensor, VehicleSpec


def swath_task(spec: MissionSpec, vehicles: Iterable[VehicleSpec], coverage: Coverage) -> SwathTask:
    """Return what the swath sonars of a mission's vehicles have to ensonify: the area but for its keep-out zones."""
    team = list(vehicles)
    coverage = without_zones(spec, coverage)
    sonars = {vehicle.name: sonar for vehicle in team if (sonar := swath_sonar(vehicle)) is not None}
    altitudes_m = {vehicle.name: vehicle.altitude_m for vehicle in team if vehicle.altitude_m is not None}
    asked = spec.coverage
    return SwathTask(coverage, sonars, asked.overlap_pct / 100.0, altitudes_m)


def swath_sonar(vehicle: VehicleSpec) -> SwathSonar | None:
    """Return the swath sonar of a vehicle; None where it has none."""
    if vehicle.sensor is not Sensor.MULTIBEAM:
        return None
    sonar = vehicle.sonar or SwathSonarSpec()
    return SwathSonar(math.radians(sonar.aperture_deg), sonar.beams, sonar.rate_hz, sonar.range_m, equidistant=False)


def without_zones(spec: MissionSpec, coverage: Coverage) -> Coverage:
    """Return what there is to ensonify without a mission's keep-out zones."""
    if not spec.keep_out:
        return coverage
    zones = tuple(spec.to_local(zone).tobytes() for zone in spec.keep_out)
    inside = _cells_in(zones, coverage.west_m, coverage.south_m, coverage.cell_m, *coverage.wanted.shape)
    return replace(coverage, wanted=coverage.wanted & ~inside)


@lru_cache(maxsize=32)
def _cells_in(
    zones: tuple[bytes, ...], west_m: float, south_m: float, cell_m: float, rows: int, cols: int
) -> BoolArray:
    east_m, north_m = np.meshgrid(west_m + (np.arange(cols) + 0.5) * cell_m, south_m + (np.arange(rows) + 0.5) * cell_m)
    inside = np.zeros((rows, cols), dtype=bool)
    # Their corners are bytes, so that what was found for them is found again.
    for corners in zones:
        inside |= shapely.contains_xy(Polygon(np.frombuffer(corners).reshape(-1, 2)), east_m, north_m)
    return inside
