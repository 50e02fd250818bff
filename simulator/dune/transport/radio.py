"""DUNE's simulation of a limited radio ("Communication Range" of its UDP transport)."""

from __future__ import annotations

import math

import imcpy

SUBMERGED_M = 0.5
"""Deeper than this nothing goes out or comes in."""
REFRESH_S = 3.0
_ALWAYS = frozenset({int(imcpy.SimulatedState().msg_id), int(imcpy.Abort().msg_id)})
_EARTH_M = 6_371_000.0


class Radio:
    """The systems within range of one vehicle.

    Parameters
    ----------
    range_m
        0: no limits at all, not even under water.
    """

    def __init__(self, range_m: float) -> None:
        self.range_m = range_m
        self.submerged = False
        self._places: dict[int, tuple[float, float]] = {}
        self._reached: dict[int, bool] = {}
        self._here = (0.0, 0.0)
        self._due_s = -math.inf

    def announced(self, imc_id: int, lat_rad: float, lon_rad: float) -> None:
        """Learn where a system is. As in DUNE only its first announce counts for good."""
        self._places.setdefault(imc_id, (lat_rad, lon_rad))
        self._reached[imc_id] = self._in_reach((lat_rad, lon_rad))

    def forget(self) -> None:
        """Forget all systems, as after a start."""
        self._places.clear()
        self._reached.clear()

    def moved(self, lat_rad: float, lon_rad: float, depth_m: float, now_s: float) -> None:
        """Take the vehicle's own position in; reaches are looked at every few seconds."""
        if self.range_m <= 0.0 or now_s < self._due_s:
            return
        self._due_s = now_s + REFRESH_S
        self._here, self.submerged = (lat_rad, lon_rad), depth_m > SUBMERGED_M
        self._reached = {imc_id: self._in_reach(place) for imc_id, place in self._places.items()}

    def reaches(self, imc_id: int, message_id: int) -> bool:
        """Whether a message gets through to or from a system."""
        return self.range_m <= 0.0 or message_id in _ALWAYS or self._reached.get(imc_id, False)

    def _in_reach(self, place: tuple[float, float]) -> bool:
        if self.submerged:
            return False
        north = place[0] - self._here[0]
        east = (place[1] - self._here[1]) * math.cos(self._here[0])
        return _EARTH_M * math.hypot(north, east) <= self.range_m
