"""The gate for pings: what is plausible counts, the rest is kept with the reason."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import PingReport
from app.missions.soundings.gate import MAX_OCEAN_DEPTH_M, impossible_place, not_finite

MAX_TIME_S = 1e11
"""Beyond it no vehicle's clock is, in the year 5138."""
MAX_BEAMS = 8192


class PingGate:
    """Checks pings of one mission.

    Parameters
    ----------
    outside
        Tells why a place, east and north in the frame, is too far from the mission's area; empty when it is not.
    """

    def __init__(self, frame: LocalFrame, outside: Callable[[float, float], str]) -> None:
        self._frame = frame
        self._outside = outside

    def check(self, report: PingReport) -> tuple[PingReport, str]:
        """Return a ping and why it is refused. Of one that is not, ranges that cannot be are NaN now."""
        reason = self.refusal(report)
        if reason:
            return report, reason
        ranges = report.ranges_m
        # Comparisons with NaN are false, and no fault.
        is_range = (ranges > 0.0) & (ranges <= MAX_OCEAN_DEPTH_M) & np.isfinite(report.angles_rad)
        return replace(report, ranges_m=np.where(is_range, ranges, np.float32(np.nan))), ""

    def refusal(self, report: PingReport) -> str:
        """Return why a ping is refused; empty when it is not."""
        place = report.position
        values = {
            "time_s": report.time_s,
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "vehicle_depth_m": place.depth_m,
            "roll_rad": report.roll_rad,
            "pitch_rad": report.pitch_rad,
            "heading_rad": report.heading_rad,
        }
        reason = not_finite(values) or impossible_place(place.lat_deg, place.lon_deg, place.depth_m)
        if reason:
            return reason
        if not 0.0 <= report.time_s < MAX_TIME_S:
            return f"time_s: {report.time_s:g} is not between 0 and {MAX_TIME_S:g}"
        if report.position_sd_m is not None and not 0.0 <= report.position_sd_m < math.inf:
            return f"position_sd_m: {report.position_sd_m} is not a standard deviation"
        return _wrong_beams(report) or self._too_far(place.lat_deg, place.lon_deg)

    def _too_far(self, lat_deg: float, lon_deg: float) -> str:
        try:
            east, north = self._frame.to_local(lat_deg, lon_deg)
        except ValueError as error:
            return f"position: {error}"
        return self._outside(float(east), float(north))


def storable(report: PingReport) -> bool:
    """Tell whether a ping can be told from others and its beams from each other; else only the verdict goes out."""
    return math.isfinite(report.time_s) and 0 < len(report.angles_rad) == len(report.ranges_m) <= MAX_BEAMS


def _wrong_beams(report: PingReport) -> str:
    angles, ranges = report.angles_rad, report.ranges_m
    if len(angles) != len(ranges):
        return f"beams: there are {len(angles)} angles and {len(ranges)} ranges"
    if len(angles) > MAX_BEAMS:
        return f"beams: {len(angles)} are more than {MAX_BEAMS}"
    if not np.isfinite(angles).any():
        return "beams: there is none"
    too_far = np.abs(angles) >= np.float32(math.pi / 2)
    if too_far.any():
        beam = int(too_far.argmax())
        return f"angle: beam {beam} points {math.degrees(float(angles[beam])):.1f} degrees aside, not within 90"
    return ""
