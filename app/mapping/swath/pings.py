"""Pings of swath sonars as columns, and where their beams met the bottom."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.water.casts import Casts

BeamArray = NDArray[np.float32]


@dataclass(frozen=True)
class Pings:
    """Pings of one vehicle, in the order they came; n pings of at most b beams.

    Attributes
    ----------
    time_s : (n,)
        The vehicle's clock, Unix seconds.
    lat_deg, lon_deg, depth_m : (n,)
        Place of the sonar, WGS 84, and its depth below the water surface.
    roll_rad, pitch_rad, heading_rad : (n,)
        Attitude: starboard down, nose up, clockwise from north.
    position_sd_m : (n,)
        How well the vehicle says that it knows its place; NaN: it does not say.
    angle_rad : (n, b)
        Of each beam across the track, from straight down in the vehicle; positive to starboard. NaN: no such beam.
    range_m : (n, b)
        Slant range; NaN: nothing was detected.
    """

    time_s: FloatArray
    lat_deg: FloatArray
    lon_deg: FloatArray
    depth_m: FloatArray
    roll_rad: FloatArray
    pitch_rad: FloatArray
    heading_rad: FloatArray
    position_sd_m: FloatArray
    angle_rad: BeamArray
    range_m: BeamArray

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def beams(self) -> int:
        """Footprints that detected something."""
        return int(np.isfinite(self.range_m).sum())

    @classmethod
    def joined(cls, parts: Sequence["Pings"]) -> "Pings":
        """Return all pings of the parts in their order; those with fewer beams are filled up with NaN."""
        most = max((part.angle_rad.shape[1] for part in parts), default=0)
        columns: dict[str, Any] = {}
        for column in fields(cls):
            arrays = [getattr(part, column.name) for part in parts]
            if column.name in ("angle_rad", "range_m"):
                arrays = [np.pad(a, ((0, 0), (0, most - a.shape[1])), constant_values=np.nan) for a in arrays]
                columns[column.name] = np.concatenate(arrays) if arrays else np.zeros((0, 0), np.float32)
            else:
                columns[column.name] = np.concatenate(arrays) if arrays else np.zeros(0)
        return cls(**columns)

    def take(self, rows: slice | IntArray | NDArray[np.bool_]) -> "Pings":
        """Return some of the pings."""
        return Pings(**{column.name: getattr(self, column.name)[rows] for column in fields(self)})


@dataclass(frozen=True)
class Footprints:
    """Footprints that met the bottom, each array of shape (m,), in the order of pings and across the track.

    Attributes
    ----------
    ping
        Row of the ping.
    east_m, north_m, depth_m
        Place on the bottom in the local frame; depth below the water surface.
    angle_rad
        Angle from straight down in the vehicle, positive to starboard.
    range_m
        Slant range.
    """

    ping: IntArray
    east_m: FloatArray
    north_m: FloatArray
    depth_m: FloatArray
    angle_rad: FloatArray
    range_m: FloatArray

    def __len__(self) -> int:
        return len(self.ping)

    def take(self, rows: IntArray | NDArray[np.bool_]) -> "Footprints":
        """Return some of them."""
        return Footprints(**{column.name: getattr(self, column.name)[rows] for column in fields(self)})


@dataclass(frozen=True)
class PlacedPings:
    """Pings of one vehicle, place and attitude being the sonar's, and where their beams met the bottom.

    ``rejected`` and ``restored``, (m,) each, tell which of the m footprints an operator took out, and which count
    whatever their neighbours are like; None: nobody said so of any.
    """

    pings: Pings
    footprints: Footprints
    rejected: BoolArray | None = None
    restored: BoolArray | None = None


def reach_m(pings: Pings) -> FloatArray:
    """Return how far each ping's beams met the bottom to port and to starboard, level, (n, 2); NaN without any."""
    across = pings.range_m * np.sin(pings.angle_rad - pings.roll_rad[:, None])
    met = np.isfinite(across)
    sides = [np.where(met, side, 0.0).max(axis=1, initial=0.0) for side in (-across, across)]
    return np.where(met.any(axis=1, keepdims=True), np.column_stack(sides), np.nan)


def placed(pings: Pings, frame: LocalFrame, casts: Casts | None = None) -> Footprints:
    """Return where the beams of pings met the bottom.

    A beam lies in the vehicle's plane of starboard and down; it is turned by roll, pitch and heading (Fossen 2011,
    eq. 2.18). With ``casts`` its way is followed, for the time that was measured, through the water of the cast that
    their rule gives for its ping.

    Raises
    ------
    ValueError
        When a vehicle's place is not finite or far from the frame's origin.
    """
    east, north = frame.to_local(pings.lat_deg, pings.lon_deg)
    ping, beam = np.nonzero(np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad))
    angle = pings.angle_rad[ping, beam].astype(np.float64)
    slant = pings.range_m[ping, beam].astype(np.float64)
    starboard, below = slant * np.sin(angle), slant * np.cos(angle)
    sin_roll, cos_roll = np.sin(pings.roll_rad)[ping], np.cos(pings.roll_rad)[ping]
    sin_pitch, cos_pitch = np.sin(pings.pitch_rad)[ping], np.cos(pings.pitch_rad)[ping]
    sin_heading, cos_heading = np.sin(pings.heading_rad)[ping], np.cos(pings.heading_rad)[ping]
    levelled = cos_roll * starboard - sin_roll * below
    upright = sin_roll * starboard + cos_roll * below
    forward, down = sin_pitch * upright, cos_pitch * upright
    to_east = sin_heading * forward + cos_heading * levelled
    to_north = cos_heading * forward - sin_heading * levelled
    if casts is not None:
        across = np.hypot(to_east, to_north)
        cast = casts.chosen(pings.time_s, east, north)[ping]
        true_across, true_down = casts.trace(cast, pings.depth_m[ping], across, np.maximum(down, 0.0))
        stretch = np.divide(true_across, across, out=np.ones_like(across), where=across > 0.0)
        to_east, to_north, down = to_east * stretch, to_north * stretch, np.where(down > 0.0, true_down, down)
    return Footprints(
        ping=ping.astype(np.int64),
        east_m=east[ping] + to_east,
        north_m=north[ping] + to_north,
        depth_m=pings.depth_m[ping] + down,
        angle_rad=angle,
        range_m=slant,
    )
