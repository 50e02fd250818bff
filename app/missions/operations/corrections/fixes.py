"""How far off a vehicle's own position was at its fixes: those that were sent, and jumps of its positions."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.errors import InvalidRequestError
from app.missions.views.measurements.adjustment import FixRequest

SURFACE_M = 0.5
JUMP_M, FASTEST_MPS = 1.5, 3.0
"""A position at the surface that is farther from the last one than a vehicle can have moved is a fix."""
JUMP_WITHIN_S = 30.0
FIX_SD_M = 1.0

STEADY_S = 2.0
"""How fast a vehicle goes is taken from its positions over so long, or from two of them."""

TURNS, BETWEEN = 0.3, 0.1
"""Deviations of where a vehicle is that goes on as it went, and between two of its positions, in parts of the way."""

Fix = tuple[float, float, float, float, bool]
"""Time; what the vehicle reckoned less where it was, east and north; deviation of each; whether it begins anew."""


def in_order(parts: Sequence[FloatArray]) -> FloatArray:
    """Return positions (n, 4) in the order of their times: time, east, north, depth."""
    table = np.concatenate([np.zeros((0, 4)), *parts])
    return np.asarray(table[np.argsort(table[:, 0], kind="stable")])


def sent_fixes(
    asked: Sequence[FixRequest], told: Mapping[str, FloatArray], sounded: Mapping[str, FloatArray], frame: LocalFrame
) -> Iterator[tuple[FixRequest, Fix]]:
    """Yield fixes that were sent, each with how far off its vehicle was.

    Raises InvalidRequestError where nothing is known of a vehicle at the time of a fix, or where a fix is nowhere near
    the mission.

    Parameters
    ----------
    told, sounded : dict of (n, 4)
        Positions by the vehicles' own reckoning, in order: time, east, north, depth. ``sounded`` has those of every
        vehicle where it sounded: they count where no position is told for a while.
    """
    both = {name: in_order([told.get(name, track), track]) for name, track in sounded.items()}
    for k, fix in enumerate(asked):
        track = both.get(fix.vehicle)
        if track is None:
            names = ", ".join(sorted(both))
            raise InvalidRequestError(
                f"fixes.{k}.vehicle", f"{fix.vehicle!r} sounded nothing", f"it must be one of {names}"
            )
        before = int(np.searchsorted(track[:, 0], fix.time_s, side="right")) - 1
        if before < 0 or fix.time_s - track[before, 0] > JUMP_WITHIN_S:
            raise InvalidRequestError(
                f"fixes.{k}.time_s",
                f"{fix.time_s:.1f} is not within {JUMP_WITHIN_S:g} s after a position of {fix.vehicle}",
                "send a time of its own clock at which its reckoned position is known",
            )
        own = told.get(fix.vehicle, track)
        own = own[own[:, 0] <= fix.time_s] if fix.resets else own
        if ((own[:, 0] <= fix.time_s) & (own[:, 0] >= fix.time_s - STEADY_S)).any():
            track = own
        try:
            east, north = frame.to_local(fix.lat_deg, fix.lon_deg)
        except ValueError as error:
            raise InvalidRequestError(
                f"fixes.{k}.lat_deg", str(error), f"send where {fix.vehicle} was, in degrees, north and east positive"
            ) from error
        reckoned, sd_m = reckoned_at(track, fix.time_s, resets=fix.resets)
        off = float(reckoned[0] - east), float(reckoned[1] - north)
        yield fix, (fix.time_s, *off, math.hypot(fix.sd_m, sd_m), fix.resets)


def reckoned_at(track: FloatArray, time_s: float, *, resets: bool) -> tuple[FloatArray, float]:
    """Return where a vehicle took itself to be at a time, (2,), and how uncertain that is, metres.

    Between two positions it is on the way from one to the other. One that reckons on from a fix is elsewhere after it:
    until then it went on as it went before.

    Parameters
    ----------
    track : (n, 4)
        Positions in order: time, east, north, depth; at least one is not after ``time_s``.
    """
    before = int(np.searchsorted(track[:, 0], time_s, side="right")) - 1
    last_s, place = track[before, 0], track[before, 1:3]
    gap_s = time_s - last_s
    if gap_s <= 0.0:
        return place, 0.0
    if not resets and before + 1 < len(track):
        next_s, there = track[before + 1, 0], track[before + 1, 1:3]
        if next_s - last_s <= JUMP_WITHIN_S:
            nearest = min(gap_s, next_s - time_s) / (next_s - last_s)
            share = gap_s / (next_s - last_s)
            return place + share * (there - place), BETWEEN * nearest * float(np.hypot(*(there - place)))
    velocity = _velocity(track[: before + 1])
    return place + gap_s * velocity, TURNS * gap_s * float(np.hypot(*velocity))


def _velocity(track: FloatArray) -> FloatArray:
    """Return how a vehicle went before its last position, (2,), m/s; zeros where it jumped there, or nobody knows."""
    earlier = np.flatnonzero((track[:, 0] <= track[-1, 0] - STEADY_S) & (track[:, 0] >= track[-1, 0] - JUMP_WITHIN_S))
    if not len(earlier):
        return np.zeros(2)
    step_s = track[-1, 0] - track[earlier[-1], 0]
    way_m = track[-1, 1:3] - track[earlier[-1], 1:3]
    return np.zeros(2) if np.hypot(*way_m) > JUMP_M + FASTEST_MPS * step_s else np.asarray(way_m / step_s)


def jumps(track: FloatArray) -> list[Fix]:
    """Return when a vehicle's position jumped at the surface: there it was told where it is.

    What it had reckoned until then, less that, is its error.

    Parameters
    ----------
    track : (n, 4)
        Positions in order: time, east, north, depth.
    """
    if len(track) < 2:
        return []
    step_s = np.diff(track[:, 0])
    away_m = np.hypot(*np.diff(track[:, 1:3], axis=0).T)
    found = (away_m > JUMP_M + FASTEST_MPS * step_s) & (step_s <= JUMP_WITHIN_S) & (track[1:, 3] < SURFACE_M)
    fixes: list[Fix] = []
    for k in np.flatnonzero(found).tolist():
        # It went on meanwhile as it went before.
        reckoned, _ = reckoned_at(track[: k + 1], float(track[k + 1, 0]), resets=True)
        off = reckoned - track[k + 1, 1:3]
        fixes.append((float(track[k, 0]), float(off[0]), float(off[1]), FIX_SD_M, True))
    return fixes
