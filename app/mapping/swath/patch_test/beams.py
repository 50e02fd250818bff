"""The beams that a patch test compares, and where they are with one mounting or another."""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.mounting import Mounting, StatedTrack, mounted
from app.mapping.swath.pings import BeamArray, Pings, placed
from app.mapping.water.casts import Casts


@dataclass(frozen=True)
class PatchBeams:
    """Beams of one vehicle as they were taken, k pings.

    Attributes
    ----------
    pings
        Place and attitude of the vehicle, as it states them; beams that are not compared are NaN.
    line : (k,)
        Number of the line of each.
    row : (k,)
        Of each in the track.
    shift_m : (k, 3)
        East, north and down: added to the places of its beams, for drift and water level.
    track_s : (t,), track_m : (t, 2)
        Times and stated positions, east and north, of all pings of the vehicle.
    frame
    casts
        Sound speed; None: the sonar's own ranges count.
    """

    pings: Pings
    line: IntArray
    row: IntArray
    shift_m: FloatArray
    track_s: FloatArray
    track_m: FloatArray
    frame: LocalFrame
    casts: Casts | None = None

    def bent(self, by: float) -> "PatchBeams":
        """Return the same beams steered by a sonar at which sound is faster by a share."""
        angle = np.arcsin(np.clip(np.sin(self.pings.angle_rad.astype(np.float64)) * (1.0 + by), -1.0, 1.0))
        return replace(self, pings=replace(self.pings, angle_rad=angle.astype(np.float32)))

    def placed(self, mounting: Mounting) -> tuple[FloatArray, IntArray]:
        """Return where beams met the bottom, (n, 3) east, north and down, and the ping of each, (n,).

        Their order does not depend on the mounting.
        """
        at_m = self.track_m
        if mounting.latency_s:
            at_m = StatedTrack().later(self.track_s, at_m, mounting.latency_s)
        lat, lon = self.frame.to_geographic(*at_m[self.row].T)
        pings = replace(self.pings, lat_deg=np.asarray(lat), lon_deg=np.asarray(lon))
        found = placed(mounted(pings, replace(mounting, latency_s=0.0), self.frame), self.frame, self.casts)
        where = np.column_stack([found.east_m, found.north_m, found.depth_m])
        return where + self.shift_m[found.ping], found.ping


def with_only(pings: Pings, kept: BoolArray) -> Pings:
    """Return pings with some of their beams, (n, b), which are moved together; those without any are left out."""
    rows: BoolArray = np.asarray(kept.any(axis=1))
    pings, kept = pings.take(rows), kept[rows]
    width = int(kept.sum(axis=1).max(initial=0))
    first = np.argsort(~kept, axis=1, kind="stable")[:, :width]
    there = np.take_along_axis(kept, first, axis=1)

    def moved(values: BeamArray) -> BeamArray:
        return np.where(there, np.take_along_axis(values, first, axis=1), np.float32(np.nan))

    return replace(pings, angle_rad=moved(pings.angle_rad), range_m=moved(pings.range_m))
