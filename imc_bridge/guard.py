"""Keeps references off the sea floor: DUNE follows a reference into the ground when it is told to."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from imcpy.coordinates import WGS84

MAX_KEPT = 120
SHALLOW_QUANTILE = 0.1
MIN_FOR_QUANTILE = 10
CONFIRMING_SOUNDINGS = 3


@dataclass(frozen=True, slots=True)
class DepthLimit:
    """The depth a reference may have; ``reason`` is filled when it is less than what was asked."""

    depth_m: float
    reason: str = ""


class AltitudeGuard:
    """Limits a vehicle's depth by the bottom measured near it.

    The bottom near the vehicle is the 10 % quantile of the soundings within ``radius_m`` and ``window_s``, so
    that one false echo does not lift the vehicle; three shallower ones in a row do.

    Parameters
    ----------
    radius_m, window_s
        What counts as near and as recent.
    unknown_bottom_depth_m
        The deepest reference while nothing near is measured.
    """

    def __init__(self, radius_m: float, window_s: float, unknown_bottom_depth_m: float) -> None:
        self._radius_m = radius_m
        self._window_s = window_s
        self._unknown_bottom_depth_m = unknown_bottom_depth_m
        self._soundings: deque[tuple[float, float, float, float]] = deque(maxlen=MAX_KEPT)

    def add(self, time_s: float, lat_deg: float, lon_deg: float, bottom_depth_m: float) -> None:
        """Take a sounding in; ``time_s`` is the vehicle's clock."""
        self._soundings.append((time_s, math.radians(lat_deg), math.radians(lon_deg), bottom_depth_m))

    def clear(self) -> None:
        """Forget the bottom, as after a jump of the vehicle's clock."""
        self._soundings.clear()

    def bottom_near_m(self, time_s: float, lat_deg: float, lon_deg: float) -> float | None:
        """Depth of the bottom near a place, None when nothing recent was measured there."""
        lat, lon = math.radians(lat_deg), math.radians(lon_deg)
        near = [
            depth
            for at_s, at_lat, at_lon, depth in self._soundings
            if time_s - at_s <= self._window_s
            and math.hypot(*WGS84.displacement(lat, lon, 0.0, at_lat, at_lon, 0.0)[:2]) <= self._radius_m
        ]
        if not near:
            return None
        confirmed = max(near[-CONFIRMING_SOUNDINGS:])
        if len(near) < MIN_FOR_QUANTILE:
            return confirmed
        return min(confirmed, sorted(near)[int(SHALLOW_QUANTILE * len(near))])

    def limit(
        self, asked_depth_m: float, min_altitude_m: float, time_s: float, lat_deg: float, lon_deg: float
    ) -> DepthLimit:
        """The depth to send instead of ``asked_depth_m`` for a vehicle at a place and time."""
        asked = max(asked_depth_m, 0.0)
        bottom = self.bottom_near_m(time_s, lat_deg, lon_deg)
        if bottom is None:
            if asked <= self._unknown_bottom_depth_m:
                return DepthLimit(asked)
            return DepthLimit(
                self._unknown_bottom_depth_m,
                f"held at {self._unknown_bottom_depth_m:.1f} m: no bottom measured near the vehicle",
            )
        deepest = max(bottom - min_altitude_m, 0.0)
        if asked <= deepest:
            return DepthLimit(asked)
        return DepthLimit(
            deepest,
            f"held at {deepest:.1f} m: {min_altitude_m:g} m above the bottom measured at {bottom:.1f} m",
        )
