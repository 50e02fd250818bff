"""Keeps references off the sea floor: DUNE follows a reference into the ground.

A reference goes on being flown to when the link breaks, so its depth must be safe on the whole way to it and not only
where the vehicle is.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from imc_bridge.control.seabed import Seabed
from imc_bridge.distances import Place, distance_m, offset_m
from imc_bridge.events import BottomPoint

MAX_KEPT = 120
SHALLOW_QUANTILE = 0.1
MIN_FOR_QUANTILE = 10
CONFIRMING_SOUNDINGS = 3
CORRIDOR_M = 10.0
"""Half the width of the way on which the bottom counts: errors of position, and DUNE does not fly on rails."""
FARTHEST_M = 300.0
"""No farther along the leg than this: soundings come in long before the vehicle is there."""
TREND_BACK_M = 8.0
TREND_AHEAD_M = 12.0
"""A bottom that rises is expected to go on rising for this long; the vehicle needs it to climb."""
STEEPEST = 1.0


@dataclass(frozen=True, slots=True)
class DepthLimit:
    """The depth a reference may have; ``reason`` is filled when it is less than what was asked."""

    depth_m: float
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _Sounding:
    time_s: float
    place: Place
    depth_m: float


class AltitudeGuard:
    """Limits a vehicle's depth by the bottom near it, ahead of it and where it is going.

    The bottom near the vehicle is the 10 % quantile of the soundings within ``radius_m`` and ``window_s``, so
    that one false echo does not lift the vehicle; three shallower ones in a row do. Where it rises it is taken to go
    on rising for a few metres.

    Parameters
    ----------
    radius_m, window_s
        What counts as near and as recent.
    unknown_bottom_depth_m
        The deepest reference while nothing near is known.
    seabed
        What all vehicles have measured.
    """

    def __init__(
        self, radius_m: float, window_s: float, unknown_bottom_depth_m: float, seabed: Seabed | None = None
    ) -> None:
        self._radius_m = radius_m
        self._window_s = window_s
        self._unknown_bottom_depth_m = unknown_bottom_depth_m
        self._seabed = seabed if seabed is not None else Seabed()
        self._soundings: deque[_Sounding] = deque(maxlen=MAX_KEPT)

    def add(self, time_s: float, lat_deg: float, lon_deg: float, bottom_depth_m: float, now: float = 0.0) -> None:
        """Take a sounding in; ``time_s`` is the vehicle's clock, ``now`` the bridge's."""
        self._soundings.append(_Sounding(time_s, (lat_deg, lon_deg), bottom_depth_m))
        self._seabed.add(now, lat_deg, lon_deg, bottom_depth_m)

    def clear(self) -> None:
        """Forget what counts by the vehicle's clock, as after a jump of it."""
        self._soundings.clear()

    def bottom_near_m(self, time_s: float, lat_deg: float, lon_deg: float) -> float | None:
        """Depth of the bottom near a place and just ahead, None when nothing recent was measured there."""
        here = (lat_deg, lon_deg)
        recent = [s for s in self._soundings if time_s - s.time_s <= self._window_s]
        near = [s for s in recent if distance_m(here, s.place) <= self._radius_m]
        if not near:
            return None
        confirmed = max(s.depth_m for s in near[-CONFIRMING_SOUNDINGS:])
        lowest = confirmed
        if len(near) >= MIN_FOR_QUANTILE:
            lowest = min(confirmed, sorted(s.depth_m for s in near)[int(SHALLOW_QUANTILE * len(near))])
        return lowest + _rise_ahead_m(recent)

    def limit(
        self,
        asked_depth_m: float,
        min_altitude_m: float,
        time_s: float,
        lat_deg: float,
        lon_deg: float,
        *,
        now: float = 0.0,
        towards: Sequence[Place] = (),
        mapped: Sequence[BottomPoint] = (),
    ) -> DepthLimit:
        """The depth to send instead of ``asked_depth_m`` for a vehicle at a place and time.

        Parameters
        ----------
        asked_depth_m, min_altitude_m
        time_s
            The vehicle's clock.
        lat_deg, lon_deg
            Where it is.
        now
            The bridge's clock.
        towards
            Where it is going: the corners of its way.
        mapped
            Bottom that a map knows on that way, already made pessimistic by its owner.
        """
        asked = max(asked_depth_m, 0.0)
        here = (lat_deg, lon_deg)
        way = _shortened([here, *towards])
        measured = self.bottom_near_m(time_s, lat_deg, lon_deg)
        ahead = [
            depth
            for a, b in (itertools.pairwise(way) if len(way) > 1 else [(here, here)])
            if (depth := self._seabed.shallowest(now, a, b, CORRIDOR_M)) is not None
        ]
        charted = [point for point in mapped if _off_way_m(way, (point.lat_deg, point.lon_deg)) <= CORRIDOR_M]
        known_here = (
            measured is not None
            or self._seabed.shallowest(now, here, here, CORRIDOR_M) is not None
            or any(distance_m(here, (p.lat_deg, p.lon_deg)) <= self._radius_m for p in charted)
        )
        found = [
            (depth, words)
            for depth, words in (
                (measured, "measured"),
                (min(ahead, default=None), "measured on the way"),
                (min((point.depth_m for point in charted), default=None), "mapped on the way"),
            )
            if depth is not None
        ]
        limits = [
            (max(bottom - min_altitude_m, 0.0), f"{min_altitude_m:g} m above the bottom {words} at {bottom:.1f} m")
            for bottom, words in found
        ]
        if not known_here:
            limits.append((self._unknown_bottom_depth_m, "no bottom measured near the vehicle"))
        deepest, reason = min(limits)
        return DepthLimit(asked) if asked <= deepest else DepthLimit(deepest, f"held at {deepest:.1f} m: {reason}")


def _shortened(way: list[Place]) -> list[Place]:
    """The first metres of a way, as far as anyone looks."""
    short, left = way[:1], FARTHEST_M
    for a, b in itertools.pairwise(way):
        length = distance_m(a, b)
        if length > left:
            share = left / length
            return [*short, (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))]
        short.append(b)
        left -= length
    return short


def _off_way_m(way: list[Place], place: Place) -> float:
    """How far a place lies from a way."""
    nearest = distance_m(way[0], place)
    for a, b in itertools.pairwise(way):
        leg, to = offset_m(a, b), offset_m(a, place)
        square = leg[0] ** 2 + leg[1] ** 2
        share = 0.0 if square == 0.0 else min(max((to[0] * leg[0] + to[1] * leg[1]) / square, 0.0), 1.0)
        nearest = min(nearest, math.hypot(to[0] - share * leg[0], to[1] - share * leg[1]))
    return nearest


def _rise_ahead_m(recent: list[_Sounding]) -> float:
    """How much shallower (negative) the bottom will be a few metres on if it goes on as it has lately; 0 if not."""
    if len(recent) < 2 * CONFIRMING_SOUNDINGS:
        return 0.0
    here = recent[-1].place
    newest = sorted(s.depth_m for s in recent[-CONFIRMING_SOUNDINGS:])[1]
    for sounding, before, after in zip(recent[-2:0:-1], recent[-3::-1], recent[:1:-1], strict=False):
        back = distance_m(here, sounding.place)
        if back >= TREND_BACK_M:
            # The middle of three, so that one false echo makes no slope.
            then = sorted((before.depth_m, sounding.depth_m, after.depth_m))[1]
            slope = min(max((newest - then) / back, -STEEPEST), 0.0)
            return slope * TREND_AHEAD_M
    return 0.0
