"""The gate every measurement passes: what is plausible enters the map, the rest is kept with the reason."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import shapely
from shapely.geometry import Polygon

from app.mapping.types import MAX_SD_M
from app.missions.fleet.interface import SoundingReport
from app.missions.soundings.corrections import Corrections, PlacedSounding, no_tracks

MAX_OCEAN_DEPTH_M = 11_100.0
MAX_VEHICLE_SPEED_MPS = 6.0
"""Faster than any survey AUV; a faster move between two soundings is a jump of the navigation."""

MIN_SD_M = 1e-4
"""A standard deviation below this says nothing true, and a map cannot be computed with it."""

JUMP_ALLOWANCE_M = 10.0
"""A GPS fix at the surface may correct the position by this much at once."""


class Gate:
    """Checks soundings of one mission; remembers each vehicle's last accepted place to notice jumps.

    Parameters
    ----------
    corrections
        They place soundings in the mission's local frame, too.
    area
        The mission's area polygon in that frame.
    margin_m
        How far outside the area soundings still help the map's edge.
    noise
        Standard deviation of a range as a fraction of it, used where the vehicle states none.
    """

    def __init__(self, corrections: Corrections, area: Polygon, *, margin_m: float, noise: float) -> None:
        self.corrections = corrections
        self._tracks = no_tracks()
        self._zone = area.buffer(margin_m)
        self._margin_m = margin_m
        self._noise = noise
        self._last: dict[str, tuple[float, float, float, float]] = {}
        """By vehicle the time of its last accepted sounding, where that was, east and north, and its own depth."""
        shapely.prepare(self._zone)

    def check(self, reports: Iterable[SoundingReport]) -> list[PlacedSounding]:
        """Return one result per report, in their order; depths are corrected, the report stays raw."""
        listed = [(report, implausible_value(report)) for report in reports]
        placed = iter(self.corrections.apply([report for report, reason in listed if not reason], self._tracks))
        return [
            PlacedSounding(report, reason=reason) if reason else self._check(next(placed)) for report, reason in listed
        ]

    def _check(self, found: PlacedSounding) -> PlacedSounding:
        report = found.report
        sd_m = report.depth_sd_m if report.depth_sd_m is not None else self.deviation_m(report.range_m)
        if found.reason:
            return replace(found, sd_m=sd_m)
        reason = self.outside(found.east_m, found.north_m) or self._jump(found)
        if not reason:
            self._last[report.vehicle] = report.time_s, found.east_m, found.north_m, report.vehicle_depth_m
        return replace(found, sd_m=sd_m, reason=reason)

    def deviation_m(self, range_m: float) -> float:
        """Return the standard deviation of a range for which the vehicle states none."""
        return max(self._noise * range_m, 0.01)

    def outside(self, east: float, north: float) -> str:
        """Return why a place is too far from the area; empty when it is not."""
        if shapely.contains_xy(self._zone, east, north):
            return ""
        return (
            f"position: {east:.1f} m east, {north:.1f} m north of the area's origin lies more than "
            f"{self._margin_m:g} m outside the area"
        )

    def _jump(self, found: PlacedSounding) -> str:
        report = found.report
        last = self._last.get(report.vehicle)
        if last is None:
            return ""
        time_s, last_east, last_north, last_depth = last
        deeper = report.vehicle_depth_m - last_depth
        distance = math.hypot(found.east_m - last_east, found.north_m - last_north, deeper)
        # Footprints of slanted beams lie beside the vehicle, by at most about the range.
        allowed = JUMP_ALLOWANCE_M + report.range_m + MAX_VEHICLE_SPEED_MPS * abs(report.time_s - time_s)
        if distance <= allowed:
            return ""
        return (
            f"position: jumped {distance:.1f} m in {abs(report.time_s - time_s):.1f} s; "
            f"at most {allowed:.1f} m is plausible"
        )


def implausible_value(report: SoundingReport) -> str:
    """Return which value of a sounding cannot be; empty when all can."""
    place = report.footprint
    values = {
        "time_s": report.time_s,
        "lat_deg": place.lat_deg,
        "lon_deg": place.lon_deg,
        "depth_m": place.depth_m,
        "vehicle_depth_m": report.vehicle_depth_m,
        "range_m": report.range_m,
    }
    reason = not_finite(values) or impossible_place(place.lat_deg, place.lon_deg, report.vehicle_depth_m)
    if reason:
        return reason
    if report.range_m <= 0:
        return f"range_m: {report.range_m:g} is not positive"
    if not 0 < place.depth_m <= MAX_OCEAN_DEPTH_M:
        return f"depth_m: {place.depth_m:g} is not between 0 and {MAX_OCEAN_DEPTH_M:g}"
    if report.depth_sd_m is not None and not MIN_SD_M <= report.depth_sd_m <= MAX_SD_M:
        return f"depth_sd_m: {report.depth_sd_m} is not between {MIN_SD_M:g} and {MAX_SD_M:g}"
    return ""


def not_finite(values: Mapping[str, float]) -> str:
    """Return which of the values is not a finite number; empty when all are."""
    for name, value in values.items():
        if not math.isfinite(value):
            return f"{name}: {value} is not a finite number"
    return ""


def impossible_coordinates(lat_deg: float, lon_deg: float) -> str:
    """Return why there is no such place on the Earth; empty when there is."""
    if not -90 <= lat_deg <= 90:
        return f"lat_deg: {lat_deg} is not between -90 and 90"
    if not -180 <= lon_deg <= 180:
        return f"lon_deg: {lon_deg} is not between -180 and 180"
    return ""


def impossible_place(lat_deg: float, lon_deg: float, vehicle_depth_m: float) -> str:
    """Return why no vehicle can be at a place; empty when one can."""
    if reason := impossible_coordinates(lat_deg, lon_deg):
        return reason
    if not -2 <= vehicle_depth_m <= MAX_OCEAN_DEPTH_M:
        return f"vehicle_depth_m: {vehicle_depth_m:g} is not between -2 and {MAX_OCEAN_DEPTH_M:g}"
    return ""
