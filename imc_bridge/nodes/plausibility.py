"""Where a vehicle can be, by where it was: a forged position stands alone among those of the vehicle itself."""

from __future__ import annotations

import math
from enum import Enum

from imc_bridge.distances import Place, distance_m
from imc_bridge.telemetry.soundings import StateSample

FASTEST_MPS = 10.0
"""Faster than any vehicle, currents and noise included."""
ALLOWANCE_M = 20.0
"""A correction of the navigation, as by a GPS fix after a short dive, is believed at once up to this size."""
CONFIRMATIONS = 4
CONFIRM_S = 1.0
"""A position far away is believed when enough states over at least this time agree, and none came from the old one."""


class PositionVerdict(Enum):
    """The verdict on a position."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    """Too far from where it was, and not confirmed: not to be used."""
    MOVED = "moved"
    """It really is elsewhere; nothing lies between the places."""


class PlausiblePlace:
    """Judges the positions of one vehicle, in the order in which they arrive."""

    def __init__(self) -> None:
        self._last: StateSample | None = None
        self._odd: list[StateSample] = []

    @property
    def last(self) -> StateSample | None:
        """The newest position that was believed; None before there is any."""
        return self._last

    def take(self, sample: StateSample) -> PositionVerdict:
        """Say whether the vehicle can be there."""
        if self._last is None or _within_reach(self._last, sample):
            self._odd.clear()
            if self._last is None or sample.time_s >= self._last.time_s:
                self._last = sample
            return PositionVerdict.GOOD
        if self._odd and not _within_reach(self._odd[-1], sample):
            self._odd.clear()
        self._odd.append(sample)
        if len(self._odd) < CONFIRMATIONS or sample.time_s - self._odd[0].time_s < CONFIRM_S:
            return PositionVerdict.DOUBTFUL
        self._odd.clear()
        self._last = sample
        return PositionVerdict.MOVED

    def clear(self) -> None:
        """Forget where it was, as after a jump of its clock."""
        self._last = None
        self._odd.clear()


def moved_m(before: StateSample, after: StateSample) -> float:
    """Return how far two positions are from each other, depth included."""
    return math.hypot(distance_m(_place(before), _place(after)), after.depth_m - before.depth_m)


def _place(sample: StateSample) -> Place:
    return math.degrees(sample.lat_rad), math.degrees(sample.lon_rad)


def reach_m(before: StateSample, after: StateSample) -> float:
    """Return how far a vehicle can have come between two positions, by their times."""
    return ALLOWANCE_M + FASTEST_MPS * abs(after.time_s - before.time_s)


def _within_reach(before: StateSample, after: StateSample) -> bool:
    return moved_m(before, after) <= reach_m(before, after)
