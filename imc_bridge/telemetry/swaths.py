"""From the SonarData of a multibeam to pings: angles and ranges of their beams, and how the sonar stood.

The layout of IMC 5.4, little endian: how many points, the first one's angle, flags; where the flags say so a scale of
angle steps and one of intensities, and the steps; the ranges; where the flags say so the intensities, which are not
used here. Without steps the beams are as far apart as the beam configuration says that one is wide. DUNE's driver of
the Imagenex 837B sends that sonar's own frames under the same type: they have another length than this layout.

A Distance has one range however many beam configurations it carries, and is a sounding.
"""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import imcpy
import numpy as np
from numpy.typing import NDArray

from imc_bridge.events import PingRefused, SwathPing
from imc_bridge.network.codec import Message
from imc_bridge.telemetry.soundings import (
    NO_STATE,
    Awaiting,
    Beam,
    Repeats,
    StateHistory,
    StateSample,
    footprint,
)

HEADER = struct.Struct("<HfB")
SCALE = struct.Struct("<f")
INTENSITIES, STEPS = 1, 2
"""Bits of the flags."""
STEP_BYTES = 2
MOST_BYTES_PER_POINT = 4
MAX_BEAMS = 4096
LONGEST_SLANT_M = 2000.0
"""No multibeam of such vehicles reaches farther, whatever its message says."""
MAX_PENDING = 64
NO_ANGLES = "angles that are none"
NAMED, AHEAD = re.compile(r"multi[ -]?beam|mbes|bathymet|swath", re.I), re.compile("forward|ahead|fls|obstacle", re.I)
"""What the name of an entity contains that looks at the bottom, or that does not."""


class SwathError(ValueError):
    """A SonarData that does not hold the angles and ranges of beams."""


@dataclass(frozen=True, slots=True, eq=False)
class Swath:
    """A ping's beams (b,): angles from straight down in the vehicle, positive to starboard, and slant ranges or NaN."""

    angles_rad: NDArray[np.float32]
    ranges_m: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class PendingPing:
    """One swath that awaits its state."""

    time_s: float
    source: str
    swath: Swath


def read_swath(message: Message) -> Swath:
    """Return the beams of a SonarData of a multibeam.

    Raises
    ------
    SwathError
        When its data is not what its header says, or makes no sense.
    """
    data = bytes(message.data)
    if len(data) < HEADER.size:
        raise SwathError("shorter than its header")
    count, start_rad, flags = HEADER.unpack_from(data)
    point_bytes, odd_bits = divmod(int(message.bits_per_point), 8)
    scale = float(message.scale_factor)
    if flags & ~(INTENSITIES | STEPS):
        raise SwathError("flags that are not known")
    if not 1 <= count <= MAX_BEAMS:
        raise SwathError(f"no beams, or more than {MAX_BEAMS}")
    if odd_bits or not 1 <= point_bytes <= MOST_BYTES_PER_POINT:
        raise SwathError("bits per point other than 8, 16, 24 or 32")
    if not (math.isfinite(scale) and scale > 0.0):
        raise SwathError("scaling factor is no positive number")
    has_steps, has_intensities = bool(flags & STEPS), bool(flags & INTENSITIES)
    steps_at = HEADER.size + SCALE.size * (has_steps + has_intensities)
    ranges_at = steps_at + STEP_BYTES * count * has_steps
    if len(data) != ranges_at + point_bytes * count * (1 + has_intensities):
        raise SwathError("data of another length than its header says")
    if has_steps:
        (step_rad,) = SCALE.unpack_from(data, HEADER.size)
        steps = np.frombuffer(data, "<u2", count, steps_at).cumsum(dtype=np.int64)
    else:
        step_rad, steps = _beam_width_rad(message) if count > 1 else 0.0, np.arange(count)
    if not (math.isfinite(start_rad) and math.isfinite(step_rad)):
        raise SwathError(NO_ANGLES)
    angles = start_rad + steps * step_rad
    if not (np.abs(angles) <= math.pi).all():
        raise SwathError(NO_ANGLES)
    ranges = _points(data, ranges_at, count, point_bytes) * scale
    longest = min(float(message.max_range) or math.inf, LONGEST_SLANT_M)
    heard = (ranges > 0.0) & (ranges >= float(message.min_range)) & (ranges <= longest)
    heard &= np.abs(angles) < 0.5 * math.pi
    return Swath(angles.astype(np.float32), np.where(heard, ranges, np.nan).astype(np.float32))


def _beam_width_rad(message: Message) -> float:
    for beam in message.beam_config:
        # The wire lets any message stand where a BeamConfig belongs.
        if isinstance(beam, imcpy.BeamConfig) and math.isfinite(beam.beam_width) and beam.beam_width > 0.0:
            return float(beam.beam_width)
        break
    raise SwathError("neither angle steps nor the width of a beam")


def _points(data: bytes, at: int, count: int, point_bytes: int) -> NDArray[np.int64]:
    octets = np.frombuffer(data, np.uint8, count * point_bytes, at).reshape(count, point_bytes).astype(np.int64)
    values: NDArray[Any] = octets @ (1 << 8 * np.arange(point_bytes))
    return values


def looks_down(source: str) -> bool:
    """Whether an entity is a multibeam that looks at the bottom, by its name."""
    return NAMED.search(source) is not None and AHEAD.search(source) is None


class PingIntake:
    """Turns one vehicle's SonarData into pings, or into refusals with their reason."""

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.heard: Counter[str] = Counter()
        self._pending: Awaiting[PendingPing] = Awaiting(MAX_PENDING)
        self._repeats = Repeats()

    def clear(self) -> None:
        """Forget what is pending, as after a jump of the vehicle's clock."""
        self._pending.clear()
        self._repeats.clear()

    def offer(self, source: str | None, message: Message) -> PingRefused | None:
        """Take a SonarData in; a refusal comes back at once, a ping later from :meth:`resolve`.

        ``source`` is the name of the entity that measured, None while names are unknown.
        """
        if message.type != imcpy.SonarData.TypeEnum.MULTIBEAM:
            return None
        time_s = float(message.timestamp)
        if source is None:
            return self._refuse(time_s, "?", "entity names not known yet")
        if not looks_down(source):
            return self._refuse(time_s, source, "its entity is not called a multibeam, or looks ahead")
        self.heard[source] += 1
        if self._repeats.has(source, time_s):
            return self._refuse(time_s, source, "repeated")
        try:
            swath = read_swath(message)
        except SwathError as error:
            return self._refuse(time_s, source, str(error))
        if not np.isfinite(swath.ranges_m).any():
            return self._refuse(time_s, source, "nothing detected")
        lost = self._pending.add(PendingPing(time_s, source, swath))
        return None if lost is None else self._refuse(lost.time_s, lost.source, NO_STATE)

    def resolve(self, history: StateHistory, position_sd_m: float | None = None) -> Iterator[SwathPing | PingRefused]:
        """Yield what became of the pending pings that ``history`` now decides."""
        for ping, state in self._pending.decided(history):
            if state is None:
                yield self._refuse(ping.time_s, ping.source, NO_STATE)
                continue
            self.accepted += 1
            yield SwathPing(
                vehicle=self.vehicle,
                time_s=ping.time_s,
                lat_deg=math.degrees(state.lat_rad),
                lon_deg=math.degrees(state.lon_rad),
                depth_m=state.depth_m,
                roll_rad=state.roll_rad,
                pitch_rad=state.pitch_rad,
                yaw_rad=state.yaw_rad,
                angles_rad=ping.swath.angles_rad,
                ranges_m=ping.swath.ranges_m,
                source=ping.source,
                position_sd_m=position_sd_m,
            )

    def give_up(self) -> Iterator[PingRefused]:
        """Refuse what is still pending: no further state will come, as at the end of a log."""
        for ping in self._pending.given_up():
            yield self._refuse(ping.time_s, ping.source, NO_STATE)

    def _refuse(self, time_s: float, source: str, reason: str) -> PingRefused:
        self.refused[reason] += 1
        return PingRefused(self.vehicle, time_s, source, reason)


def bottom_below(ping: SwathPing) -> tuple[float, float, float]:
    """Latitude and longitude (degrees) and depth of the bottom where the steepest beam met it."""
    off_nadir = np.where(np.isfinite(ping.ranges_m), np.abs(ping.angles_rad), np.inf)
    steepest = int(off_nadir.argmin())
    place = (math.radians(ping.lat_deg), math.radians(ping.lon_deg), ping.depth_m)
    state = StateSample(ping.time_s, *place, ping.roll_rad, ping.pitch_rad, ping.yaw_rad)
    beam = Beam(azimuth_rad=math.copysign(0.5 * math.pi, ping.angles_rad[steepest]), off_nadir_rad=off_nadir[steepest])
    return footprint(state, beam, float(ping.ranges_m[steepest]))
