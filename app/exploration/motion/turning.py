"""The ground beside a leg that a vehicle passes over because it cannot turn on the spot."""

import numpy as np

from app.arrays import FloatArray

ARC_SAMPLES = 24
"""Places on a whole turning circle."""

NEAR, ON_RADII = 1.2, 4.0
"""Who has its target within so many radii of a turning circle's middle flies on for up to so many, and turns then."""

EITHER_WAY_RAD = np.radians(120.0)
"""Who has to turn farther than this may turn either way."""


def turned_over(start_m: FloatArray, heading_rad: float, target_m: FloatArray, radius_m: float) -> FloatArray:
    """Return places (n, 2) that a vehicle passes over while it turns towards its target; none where it need not.

    It turns towards the side where the target lies; where that is behind it, or inside of a turning circle, it may turn
    either way, or fly on before it turns.

    Parameters
    ----------
    start_m, target_m : (2,)
        Ends of its leg, east and north.
    heading_rad
        Where it heads at the start, clockwise from north; NaN: anywhere.
    radius_m
        Of its turning circle.
    """
    leg_m = target_m - start_m
    length_m = float(np.hypot(*leg_m))
    if length_m == 0.0 or radius_m <= 0.0:
        return np.zeros((0, 2))
    if np.isnan(heading_rad):
        return disc(start_m, 2.0 * radius_m)
    ahead = np.array([np.sin(heading_rad), np.cos(heading_rad)])
    starboard = np.array([ahead[1], -ahead[0]])
    side_m, along_m = float(leg_m @ starboard), float(leg_m @ ahead)
    off_rad = abs(float(np.arctan2(side_m, along_m)))
    towards = (1.0 if side_m >= 0.0 else -1.0) * starboard
    if min(float(np.hypot(*(target_m - start_m - side * radius_m * starboard))) for side in (1, -1)) < NEAR * radius_m:
        begins = [start_m + on * radius_m * ahead for on in np.linspace(0.0, ON_RADII, 5)]
        return np.vstack([_circle(here, ahead, side * towards, radius_m) for here in begins for side in (1, -1)])
    sides = [towards, -towards] if off_rad > EITHER_WAY_RAD else [towards]
    return np.vstack([_arc_and_on(start_m, ahead, side, target_m, radius_m) for side in sides])


def ahead_of_end(end_m: FloatArray, course_rad: float, radius_m: float) -> tuple[FloatArray, FloatArray]:
    """Return places (n, 2) that a vehicle may pass over while it turns into a leg that is not known yet.

    Also how far from the end they lie, (n,). They fill half a disc of two radii ahead of it.
    """
    bearings = course_rad + np.linspace(-0.5 * np.pi, 0.5 * np.pi, ARC_SAMPLES // 2 + 1)
    away_m = radius_m * np.repeat([0.5, 1.0, 1.5, 2.0], len(bearings))
    around = np.tile(bearings, 4)
    return end_m + away_m[:, None] * np.column_stack([np.sin(around), np.cos(around)]), away_m


def disc(centre_m: FloatArray, radius_m: float) -> FloatArray:
    """Return places (n, 2) all over a disc."""
    bearings = np.linspace(0.0, 2.0 * np.pi, ARC_SAMPLES, endpoint=False)
    away_m = radius_m * np.repeat([0.0, 0.5, 1.0], len(bearings))
    around = np.tile(bearings, 3)
    return np.asarray(centre_m + away_m[:, None] * np.column_stack([np.sin(around), np.cos(around)]))


def _circle(start_m: FloatArray, ahead: FloatArray, inwards: FloatArray, radius_m: float) -> FloatArray:
    turned = np.linspace(0.0, 2.0 * np.pi, ARC_SAMPLES + 1)[:, None]
    return np.asarray(start_m + radius_m * (np.sin(turned) * ahead + (1.0 - np.cos(turned)) * inwards))


def _arc_and_on(
    start_m: FloatArray, ahead: FloatArray, inwards: FloatArray, target_m: FloatArray, radius_m: float
) -> FloatArray:
    """Return the turning circle up to where it leads straight to the target, and the way from there."""
    circle = _circle(start_m, ahead, inwards, radius_m)
    # Where a tangent from the target meets it: the radius there and the one towards the target differ by so much.
    to_m = target_m - start_m - radius_m * inwards
    away_m = float(np.hypot(*to_m))
    lies_rad = float(np.arctan2(to_m @ ahead, -(to_m @ inwards)))
    leaves_rad = (lies_rad - float(np.arccos(min(radius_m / max(away_m, 1e-9), 1.0)))) % (2.0 * np.pi)
    last = min(int(np.ceil(leaves_rad / (2.0 * np.pi) * ARC_SAMPLES)), ARC_SAMPLES)
    on = np.linspace(0.0, 1.0, ARC_SAMPLES)[:, None]
    return np.vstack([circle[: last + 1], circle[last] + on * (target_m - circle[last])])
