"""Soundings of a file as beams of a sonar: from where they lie to where the sonar was and how it looked at them."""

import math
from dataclasses import dataclass

import numpy as np
import pyproj

from app.arrays import FloatArray
from app.mapping.readers.multibeam.types import FilePing

_GEOD = pyproj.Geod(ellps="WGS84")
_MAX_TURN, _MAX_TILT = math.tan(math.radians(20.0)), math.tan(math.radians(30.0))
"""More than this no swath is turned or tilted on purpose."""
_PLAIN = 0.03
"""Directions in which a swath is so much narrower than in the widest tell nothing of the plane that it lies in."""


@dataclass(frozen=True, slots=True, eq=False)
class BeamPing:
    """A ping as one sonar's: all beams in a plane through it; n beams, NaN where there is no sounding.

    Attributes
    ----------
    lat_deg, lon_deg, depth_m
        Place of the sonar, WGS 84, and its depth below the water surface.
    pitch_rad, heading_rad
        Attitude of that plane: nose up, clockwise from north. It does not roll.
    angle_rad, range_m : (n,)
        From straight down in the plane, positive to starboard, and slant range.
    moved_m
        How far the beam that lies farthest from the plane is moved along the track.
    """

    lat_deg: float
    lon_deg: float
    depth_m: float
    pitch_rad: float
    heading_rad: float
    angle_rad: FloatArray
    range_m: FloatArray
    moved_m: float


def beams_of(ping: FilePing) -> BeamPing | None:
    """Return a ping as beams whose footprints are its soundings; None where none of them lies below the sonar.

    Depths are taken back to below the water surface. Where the sonar's depth is not stated it is at the surface: the
    footprints are the same. Swaths that a sonar steers, or that sectors bend, get the plane nearest to them; across the
    track and in depth nothing moves.
    """
    sonar_m = ping.sonar_depth_m if math.isfinite(ping.sonar_depth_m) else 0.0
    below = ping.depth_m - ping.level_m - sonar_m
    usable = ping.detected & ~ping.rejected & (below > 0.0)
    if not usable.any():
        return None
    ahead, forward_by, tilt = _plane(ping.forward_m[usable], ping.starboard_m[usable], below[usable])
    turn = math.atan(forward_by)
    forward, starboard = ping.forward_m - ahead, ping.starboard_m
    across = math.sin(turn) * forward + math.cos(turn) * starboard
    along = math.cos(turn) * forward - math.sin(turn) * starboard
    pitch = math.atan(tilt * math.cos(turn))
    upright = below / math.cos(pitch)
    lon, lat, _ = _GEOD.fwd(ping.lon_deg, ping.lat_deg, ping.heading_deg, ahead)
    return BeamPing(
        lat_deg=float(lat),
        lon_deg=float(lon),
        depth_m=sonar_m,
        pitch_rad=pitch,
        heading_rad=math.radians(ping.heading_deg) - turn,
        angle_rad=np.where(usable, np.arctan2(across, upright), np.nan),
        range_m=np.where(usable, np.hypot(across, upright), np.nan),
        moved_m=float(np.abs(along - math.tan(pitch) * below)[usable].max()),
    )


def _plane(forward: FloatArray, starboard: FloatArray, below: FloatArray) -> tuple[float, float, float]:
    """Return a, b, c of the plane forward = a + b starboard + c below that is nearest to some points, (n,) each."""
    means = [float(values.mean()) for values in (forward, starboard, below)]
    sides = np.column_stack([starboard - means[1], below - means[2]])
    (by_starboard, by_depth), *_ = np.linalg.lstsq(sides, forward - means[0], rcond=_PLAIN)
    if abs(by_starboard) > _MAX_TURN or abs(by_depth) > _MAX_TILT:
        by_starboard = by_depth = 0.0
    ahead = means[0] - by_starboard * means[1] - by_depth * means[2]
    return float(ahead), float(by_starboard), float(by_depth)
