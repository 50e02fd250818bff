"""How a sonar is mounted in its vehicle, and pings and single beams with that taken into account.

Body frame: forward, starboard, down (right-handed), of the vehicle and of the sonar; earth: north, east, down. Angles
are positive with starboard down (roll), bow up (pitch) and clockwise from above (heading), and turn in that order about
the axes of the vehicle (Fossen 2011, eq. 2.18).
"""

import threading
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from app.arrays import FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Pings

GAP_S = 5.0
"""Between positions farther apart in time than this nothing is interpolated: the vehicle may have turned there."""

SAME_S = 1e-3
"""Positions no farther apart in time than this are one: they tell no speed."""

STEADY_S = 0.5
"""Beyond the last position a vehicle goes on as it went for so long: one jump would be carried far."""

KEPT_S = 10.0
"""Positions are kept that are no farther in time from those asked for last than this and twice the latency."""


@dataclass(frozen=True)
class Mounting:
    """How a sonar sits in its vehicle.

    Attributes
    ----------
    roll_rad, pitch_rad, heading_rad
        How the sonar is turned from the vehicle's axes.
    latency_s
        How late positions are: one that is stated for a time is where the vehicle was so much earlier.
    offset_m
        Forward, starboard and down from the vehicle's reference point of position and depth to the sonar.
    """

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    heading_rad: float = 0.0
    latency_s: float = 0.0
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def is_turned(self) -> bool:
        """Whether the sonar's axes are not the vehicle's."""
        return self.roll_rad != 0.0 or self.pitch_rad != 0.0 or self.heading_rad != 0.0

    @property
    def is_offset(self) -> bool:
        """Whether the sonar is not at the vehicle's reference point."""
        return any(self.offset_m)

    @property
    def is_ideal(self) -> bool:
        """Whether there is nothing to take into account."""
        return not (self.is_turned or self.is_offset or self.latency_s)

    @property
    def rotation(self) -> Rotation:
        """Turns vectors of the sonar's frame into the vehicle's."""
        return rotation_of(self.heading_rad, self.pitch_rad, self.roll_rad)


STRAIGHT = Mounting()
"""A sonar at the vehicle's reference point, along its axes, with positions in time."""


def rotation_of(
    heading_rad: FloatArray | float, pitch_rad: FloatArray | float, roll_rad: FloatArray | float
) -> Rotation:
    """Return what turns body vectors (forward, starboard, down) into north, east, down; arrays (n,) make n of them."""
    return Rotation.from_euler("ZYX", np.stack([heading_rad, pitch_rad, roll_rad], axis=-1))


class StatedTrack:
    """Where a vehicle was stated to be lately, to be read at other times. Threads may share one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._time_s = np.zeros(0)
        self._en_m = np.zeros((0, 2))

    def later(self, time_s: FloatArray, en_m: FloatArray, latency_s: float) -> FloatArray:
        """Return the positions that are stated for ``latency_s`` later than some times.

        Straight between stated positions. Beyond the last one, and where the next one is more than ``GAP_S`` away, the
        vehicle goes on as straight as it came; a position without any other near it in time stays as it is.

        Parameters
        ----------
        time_s : (n,)
            Of positions in any order.
        en_m : (n, 2)
            East and north that are stated for them. They are kept for what is asked next.

        Returns
        -------
        (n, 2)
        """
        with self._lock:
            known_s = np.concatenate([self._time_s, time_s])
            known_m = np.concatenate([self._en_m, en_m])
            order = np.argsort(known_s, kind="stable")
            known_s, known_m = known_s[order], known_m[order]
            apart = np.diff(known_s, prepend=-np.inf) > SAME_S
            known_s, known_m = known_s[apart], known_m[apart]
            kept = np.abs(known_s - time_s.max(initial=-np.inf)) <= KEPT_S + 2.0 * abs(latency_s)
            self._time_s, self._en_m = known_s[kept], known_m[kept]
        if len(known_s) < 2:
            return en_m
        own = _row_at(known_s, time_s)
        first, last = _runs(known_s)
        later_s, latest = time_s + latency_s, np.maximum(last[own] - 1, first[own])
        # The piece of the track that the later time lies in, or the nearest one of the same run.
        begin = np.clip(_row_at(known_s, later_s), first[own], latest)
        end = np.minimum(begin + 1, last[own])
        onwards = later_s > known_s[last[own]]
        steady = np.searchsorted(known_s, known_s[last[own]] - STEADY_S, side="left")
        begin = np.where(onwards, np.clip(steady, first[own], latest), begin)
        alone = begin == end
        span_s = np.where(alone, 1.0, known_s[end] - known_s[begin])
        speed_mps = (known_m[end] - known_m[begin]) / span_s[:, None]
        there = known_m[end] + speed_mps * (later_s - known_s[end])[:, None]
        return np.where(alone[:, None], en_m, there)


def _row_at(known_s: FloatArray, time_s: FloatArray) -> IntArray:
    """Return the last of some ascending times that is no later than each of others."""
    return np.asarray(np.clip(np.searchsorted(known_s, time_s, side="right") - 1, 0, len(known_s) - 1))


def _runs(known_s: FloatArray) -> tuple[IntArray, IntArray]:
    """Return of each of some ascending times the first and the last one of those without a gap around it."""
    number = np.cumsum(np.diff(known_s, prepend=known_s[:1]) > GAP_S)
    first = np.searchsorted(number, number, side="left")
    return np.asarray(first), np.asarray(np.searchsorted(number, number, side="right") - 1)


def mounted(pings: Pings, mounting: Mounting, frame: LocalFrame, track: StatedTrack | None = None) -> Pings:
    """Return pings with place and attitude of the sonar in place of its vehicle's.

    Parameters
    ----------
    track
        Positions of the same vehicle from before; None: there are none.

    Raises
    ------
    ValueError
        When a place is far from the frame's origin.
    """
    if mounting.is_ideal or not len(pings):
        return pings
    vehicle = rotation_of(pings.heading_rad, pings.pitch_rad, pings.roll_rad)
    if mounting.is_turned:
        heading, pitch, roll = (vehicle * mounting.rotation).as_euler("ZYX").T
        pings = replace(pings, heading_rad=heading, pitch_rad=pitch, roll_rad=roll)
    if not (mounting.is_offset or mounting.latency_s):
        return pings
    en_m = np.column_stack(frame.to_local(pings.lat_deg, pings.lon_deg))
    if mounting.latency_s:
        en_m = (track or StatedTrack()).later(pings.time_s, en_m, mounting.latency_s)
    arm = vehicle.apply(mounting.offset_m)
    lat, lon = frame.to_geographic(en_m[:, 0] + arm[:, 1], en_m[:, 1] + arm[:, 0])
    return replace(pings, lat_deg=lat, lon_deg=lon, depth_m=pings.depth_m + arm[:, 2])


@dataclass(frozen=True)
class BeamVectors:
    """Single beams as they were taken, n of them.

    Attributes
    ----------
    roll_rad, pitch_rad, heading_rad : (n,)
        Attitude of the vehicle; NaN: not known.
    azimuth_rad, off_nadir_rad : (n,)
        Direction in the vehicle, from the bow to starboard and from straight down; NaN: the range is vertical whatever
        the attitude.
    range_m : (n,)
        Along the beam.
    """

    roll_rad: FloatArray
    pitch_rad: FloatArray
    heading_rad: FloatArray
    azimuth_rad: FloatArray
    off_nadir_rad: FloatArray
    range_m: FloatArray


@dataclass(frozen=True)
class Displacement:
    """By how much a mounting moves single beams, (n, 3) each: east, north, down.

    Attributes
    ----------
    sonar_m
        The place that the beam is sent from.
    footprint_m
        The place that it met.
    """

    sonar_m: FloatArray
    footprint_m: FloatArray


def displaced(beams: BeamVectors, mounting: Mounting) -> Displacement:
    """Return by how much a mounting moves single beams, latency left aside.

    A vertical range stays vertical and moves with its sonar. A vehicle of unknown roll and pitch is level; where its
    heading is unknown nothing moves aside.
    """
    known = np.isfinite(beams.heading_rad)
    heading, pitch, roll = (np.nan_to_num(a) for a in (beams.heading_rad, beams.pitch_rad, beams.roll_rad))
    vehicle = rotation_of(heading, pitch, roll)
    arm = vehicle.apply(mounting.offset_m)
    aside = beams.range_m * np.sin(beams.off_nadir_rad)
    straight = np.column_stack(
        [
            aside * np.cos(beams.azimuth_rad),
            aside * np.sin(beams.azimuth_rad),
            beams.range_m * np.cos(beams.off_nadir_rad),
        ]
    )
    straight = np.where(np.isfinite(straight).all(axis=1, keepdims=True), straight, 0.0)
    turned = vehicle.apply(mounting.rotation.apply(straight) - straight)

    def seen(ned: FloatArray) -> FloatArray:
        level = np.where(known[:, None], ned[:, [1, 0]], 0.0)
        return np.column_stack([level, ned[:, 2]])

    return Displacement(seen(arm), seen(arm + turned))
