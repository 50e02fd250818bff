"""From Distance messages to places on the sea floor.

A Distance says how far the bottom is along a beam at one instant. Where that is follows from the beam's direction
in the vehicle, the vehicle's attitude, and its position at that instant, taken from the two EstimatedStates around
it. Body axes: x forward, y to starboard, z down; local axes: north, east, down.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import imcpy
from imcpy.coordinates import WGS84

from imc_bridge.events import Sounding, SoundingRefused
from imc_bridge.network.codec import Message
from imc_bridge.settings import AltimeterGeometry

JANUS_ANGLE_RAD = math.radians(22.5)
"""Angle between each of a DVL's four beams and its axis."""
DVL_FILTERED_INDEX = 4
"""A number of its own: it comes at the same instant as the beams 0 to 3, and a time and a beam make one sounding."""
MAX_STATE_GAP_S = 2.0
"""States further apart than this are not interpolated (they come every 0.5 s by default)."""
MAX_EDGE_S = 0.6
"""A Distance this close to the last state before a gap, or to the first after it, is placed by carrying on."""
MAX_IGNORED = 256
LEAST_DIP_RAD = math.radians(10.0)
"""What points less than this below the horizon is not taken for a direction in which the bottom is measured."""
UNTOLD_DIRECTION = "its vehicle does not tell where the beam points"
MAX_WAIT_S = 3.0
"""How far the vehicle's clock may run on before a Distance without a following state is given up."""
LONGEST_LEVER_M = 20.0
"""No sonar sits farther from its vehicle's reference point than this; what says so is damaged."""
MAX_PENDING = 256
NO_STATE = "no state of the vehicle around its time"
HISTORY_LENGTH = 400
REMEMBERED_TIMES = 128


@dataclass(frozen=True, slots=True)
class Beam:
    """A beam's direction: ``azimuth_rad`` from the bow to starboard, ``off_nadir_rad`` from straight down."""

    index: int = 0
    azimuth_rad: float = 0.0
    off_nadir_rad: float = 0.0
    body_fixed: bool = True
    """False when the reported range is already the height above the bottom."""
    known: bool = True
    """False where the direction has to be told with each Distance, because makes differ."""


def beam_table(altimeter: AltimeterGeometry) -> dict[str, Beam]:
    """The bottom-looking beams by entity name; all others are ignored (``Echo Sounder`` looks forward).

    DUNE's simulated altimeter reports the height above the bottom whatever the attitude: in a vehicle's log with
    pitch up to 15 degrees, depth + range is off by 0.005 m on average and depth + range cos(pitch) by 0.46 m.
    """
    table = {
        "Altimeter": Beam(body_fixed=altimeter == "body"),
        "DVL Filtered": Beam(DVL_FILTERED_INDEX, body_fixed=altimeter == "body"),
    }
    for index in range(4):
        table[f"DVL Beam {index}"] = Beam(index, math.radians(90.0 * index), JANUS_ANGLE_RAD)
        # So does DUNE name the beams of WaterLinked and SonTek; these have four or three, at different angles.
        table[f"DVL - Beam {index}"] = Beam(index, known=False)
    return table


def told_direction(device: imcpy.DeviceState) -> tuple[float, float] | None:
    """Return azimuth and angle off nadir (radians) of a beam by its device's orientation; None where it tells none.

    DUNE turns a device from where its x axis is the vehicle's: an altimeter that looks down has a ``theta`` of -90
    degrees, and the beams of a DVL lie at ``theta`` + their angle, ``psi`` apart. Where the orientation of a DVL was
    left at zero its ``theta`` is the beams' angle alone, from straight down. All angles zero are an orientation that
    nobody entered.
    """
    theta, psi = float(device.theta), float(device.psi)
    if not (math.isfinite(theta) and math.isfinite(psi)):
        return None
    theta = math.remainder(theta, math.tau)
    off_nadir = theta if theta > 0.0 else theta + math.pi / 2
    if theta == 0.0 or abs(off_nadir) > math.pi / 2 - LEAST_DIP_RAD:
        return None
    return math.remainder(psi if off_nadir >= 0.0 else psi + math.pi, math.tau), abs(off_nadir)


@dataclass(frozen=True, slots=True)
class StateSample:
    """Position (radians, metres) and attitude (radians) of a vehicle at its own time."""

    time_s: float
    lat_rad: float
    lon_rad: float
    depth_m: float
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


def interpolate(before: StateSample, after: StateSample, time_s: float) -> StateSample:
    """The state between two samples; angles turn the short way round."""
    span = after.time_s - before.time_s
    w = (time_s - before.time_s) / span if span > 0.0 else 0.0

    def line(a: float, b: float) -> float:
        return a + w * (b - a)

    def turn(a: float, b: float) -> float:
        return a + w * math.remainder(b - a, math.tau)

    return StateSample(
        time_s,
        line(before.lat_rad, after.lat_rad),
        turn(before.lon_rad, after.lon_rad),
        line(before.depth_m, after.depth_m),
        turn(before.roll_rad, after.roll_rad),
        turn(before.pitch_rad, after.pitch_rad),
        math.remainder(turn(before.yaw_rad, after.yaw_rad), math.tau),
    )


def rotate_to_local(state: StateSample, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A body vector in north, east, down: R_z(yaw) R_y(pitch) R_x(roll), Fossen (2011) eq. 2.18."""
    cr, sr = math.cos(state.roll_rad), math.sin(state.roll_rad)
    cp, sp = math.cos(state.pitch_rad), math.sin(state.pitch_rad)
    cy, sy = math.cos(state.yaw_rad), math.sin(state.yaw_rad)
    north = cy * cp * x + (cy * sp * sr - sy * cr) * y + (cy * sp * cr + sy * sr) * z
    east = sy * cp * x + (sy * sp * sr + cy * cr) * y + (sy * sp * cr - cy * sr) * z
    down = -sp * x + cp * sr * y + cp * cr * z
    return north, east, down


def footprint(
    state: StateSample, beam: Beam, range_m: float, lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float, float]:
    """Where a beam meets the bottom.

    Parameters
    ----------
    state
        The vehicle at the instant of the ping.
    beam
    range_m
        Along the beam, or straight down when the beam is not fixed to the body.
    lever_arm_m
        The transducer's place in the body frame.

    Returns
    -------
    lat_deg, lon_deg, bottom_depth_m : float
    """
    x, y, z = lever_arm_m
    down = range_m
    if beam.body_fixed:
        radial = range_m * math.sin(beam.off_nadir_rad)
        x += radial * math.cos(beam.azimuth_rad)
        y += radial * math.sin(beam.azimuth_rad)
        z += range_m * math.cos(beam.off_nadir_rad)
        down = 0.0
    north, east, offset_down = rotate_to_local(state, x, y, z)
    lat, lon = WGS84.displace(state.lat_rad, state.lon_rad, north, east)
    return math.degrees(lat), math.degrees(lon), state.depth_m + down + offset_down


class StateHistory:
    """The last states of a vehicle in the order of its own clock."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._samples: list[StateSample] = []

    def __len__(self) -> int:
        return len(self._samples)

    @property
    def latest(self) -> StateSample | None:
        """The newest sample by the vehicle's clock."""
        return self._samples[-1] if self._samples else None

    def add(self, sample: StateSample) -> bool:
        """Insert a sample in its place in time; False when that time is already there."""
        times = self._times
        if not times or sample.time_s > times[-1]:
            times.append(sample.time_s)
            self._samples.append(sample)
        else:
            place = bisect_left(times, sample.time_s)
            if times[place] == sample.time_s:
                return False
            times.insert(place, sample.time_s)
            self._samples.insert(place, sample)
        if len(times) > HISTORY_LENGTH + 100:
            del times[:100]
            del self._samples[:100]
        return True

    def clear(self) -> None:
        """Forget everything, as after a jump of the vehicle's clock."""
        self._times.clear()
        self._samples.clear()

    def at(self, time_s: float) -> StateSample | None:
        """The state at an instant: between two samples, or carried on a little from the edge of a gap; else None."""
        before, after = self.around(time_s)
        if before is not None and after is not None and after.time_s - before.time_s <= MAX_STATE_GAP_S:
            return interpolate(before, after, time_s)
        edges = []
        if before is not None:
            edges.append((time_s - before.time_s, bisect_right(self._times, time_s) - 2))
        if after is not None:
            edges.append((after.time_s - time_s, bisect_left(self._times, time_s)))
        for away_s, first in sorted(edges):
            if away_s <= MAX_EDGE_S and 0 <= first < len(self._samples) - 1:
                a, b = self._samples[first], self._samples[first + 1]
                if b.time_s - a.time_s <= MAX_STATE_GAP_S:
                    return interpolate(a, b, time_s)
        return None

    def around(self, time_s: float) -> tuple[StateSample | None, StateSample | None]:
        """The samples at or before and at or after an instant."""
        after = bisect_left(self._times, time_s)
        before = bisect_right(self._times, time_s) - 1
        return (
            self._samples[before] if before >= 0 else None,
            self._samples[after] if after < len(self._samples) else None,
        )


class Timed(Protocol):
    """Something measured at a time of the vehicle's clock."""

    @property
    def time_s(self) -> float:
        """Unix seconds."""
        ...


Measured = TypeVar("Measured", bound=Timed)


class Awaiting(Generic[Measured]):
    """Measurements of one vehicle that await the states around their time; at most ``most`` of them."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._pending: deque[Measured] = deque()

    def clear(self) -> None:
        """Forget them."""
        self._pending.clear()

    def add(self, measured: Measured) -> Measured | None:
        """Take one in; returns the oldest one where there are too many."""
        self._pending.append(measured)
        return self._pending.popleft() if len(self._pending) > self._most else None

    def decided(self, history: StateHistory) -> Iterator[tuple[Measured, StateSample | None]]:
        """Yield those that need to wait no longer, with the state at their time; None: there will be none."""
        latest = history.latest
        if latest is None:
            return
        for _ in range(len(self._pending)):
            measured = self._pending.popleft()
            if latest.time_s < measured.time_s < latest.time_s + MAX_WAIT_S:
                self._pending.append(measured)
            else:
                yield measured, history.at(measured.time_s)

    def given_up(self) -> Iterator[Measured]:
        """Yield what is left: no further state will come."""
        while self._pending:
            yield self._pending.popleft()


class Repeats:
    """The last times at which each sensor measured, to know what comes twice."""

    def __init__(self) -> None:
        self._times: dict[str, deque[float]] = {}

    def clear(self) -> None:
        """Forget them."""
        self._times.clear()

    def has(self, source: str, time_s: float) -> bool:
        """Whether this one came before; notes it if not."""
        times = self._times.setdefault(source, deque(maxlen=REMEMBERED_TIMES))
        if time_s in times:
            return True
        times.append(time_s)
        return False


@dataclass(frozen=True, slots=True)
class Ping:
    """One Distance that awaits its state."""

    time_s: float
    source: str
    beam: Beam
    range_m: float
    lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


class SoundingIntake:
    """Turns one vehicle's Distances into soundings, or into refusals with their reason.

    Parameters
    ----------
    vehicle
    beams
        Bottom-looking beams by entity name, see :func:`beam_table`.
    max_range_m
    """

    def __init__(self, vehicle: str, beams: dict[str, Beam], max_range_m: float) -> None:
        self.vehicle = vehicle
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.ignored: Counter[str] = Counter()
        self.heard: Counter[str] = Counter()
        self._beams = beams
        self._max_range_m = max_range_m
        self._pending: Awaiting[Ping] = Awaiting(MAX_PENDING)
        self._repeats = Repeats()

    def clear(self) -> None:
        """Forget what is pending, as after a jump of the vehicle's clock."""
        self._pending.clear()
        self._repeats.clear()

    def offer(
        self,
        time_s: float,
        source: str | None,
        valid: bool,
        range_m: float,
        lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        direction: tuple[float, float] | None = None,
    ) -> SoundingRefused | None:
        """Take a Distance in; a refusal comes back at once, a sounding later from :meth:`resolve`.

        ``source`` is the name of the entity that measured, None while names are unknown. ``direction`` is told of the
        beam, see :func:`told_direction`; None: it is as its name says.
        """
        if source is None:
            return self._refuse(time_s, "?", range_m, "entity names not known yet")
        beam = self._beams.get(source)
        if beam is None:
            if source in self.ignored or len(self.ignored) < MAX_IGNORED:
                self.ignored[source] += 1
            return None
        self.heard[source] += 1
        if self._repeats.has(source, time_s):
            return self._refuse(time_s, source, range_m, "repeated")
        if not valid:
            return self._refuse(time_s, source, range_m, "marked invalid by the sensor")
        if not math.isfinite(range_m):
            return self._refuse(time_s, source, range_m, "not a number")
        if range_m <= 0.0:
            return self._refuse(time_s, source, range_m, "zero or negative range")
        if range_m > self._max_range_m:
            return self._refuse(time_s, source, range_m, f"beyond {self._max_range_m:g} m")
        if beam.body_fixed and direction is not None:
            beam = replace(beam, azimuth_rad=direction[0], off_nadir_rad=direction[1], known=True)
        if not beam.known:
            return self._refuse(time_s, source, range_m, UNTOLD_DIRECTION)
        if not all(abs(offset_m) <= LONGEST_LEVER_M for offset_m in lever_arm_m):
            lever_arm_m = (0.0, 0.0, 0.0)
        lost = self._pending.add(Ping(time_s, source, beam, range_m, lever_arm_m))
        return None if lost is None else self._refuse(lost.time_s, lost.source, lost.range_m, NO_STATE)

    def resolve(
        self, history: StateHistory, position_sd_m: float | None = None
    ) -> Iterator[Sounding | SoundingRefused]:
        """Yield what became of the pending Distances that ``history`` now decides."""
        for ping, state in self._pending.decided(history):
            if state is None:
                yield self._refuse(ping.time_s, ping.source, ping.range_m, NO_STATE)
                continue
            lat, lon, depth = footprint(state, ping.beam, ping.range_m, ping.lever_arm_m)
            self.accepted += 1
            yield Sounding(
                vehicle=self.vehicle,
                time_s=ping.time_s,
                lat_deg=lat,
                lon_deg=lon,
                bottom_depth_m=depth,
                vehicle_depth_m=state.depth_m,
                range_m=ping.range_m,
                source=ping.source,
                beam=ping.beam.index,
                position_sd_m=position_sd_m,
                vehicle_lat_deg=math.degrees(state.lat_rad),
                vehicle_lon_deg=math.degrees(state.lon_rad),
                roll_rad=state.roll_rad,
                pitch_rad=state.pitch_rad,
                yaw_rad=state.yaw_rad,
                beam_azimuth_rad=ping.beam.azimuth_rad if ping.beam.body_fixed else None,
                beam_off_nadir_rad=ping.beam.off_nadir_rad if ping.beam.body_fixed else None,
            )

    def give_up(self) -> Iterator[SoundingRefused]:
        """Refuse what is still pending: no further state will come, as at the end of a log."""
        for ping in self._pending.given_up():
            yield self._refuse(ping.time_s, ping.source, ping.range_m, NO_STATE)

    def _refuse(self, time_s: float, source: str, range_m: float, reason: str) -> SoundingRefused:
        self.refused[reason] += 1
        return SoundingRefused(self.vehicle, time_s, source, range_m, reason)


def offer_distance(intake: SoundingIntake, source: str | None, message: Message) -> SoundingRefused | None:
    """Hand a Distance of the entity named ``source`` to its vehicle's intake."""
    lever_arm, direction = (0.0, 0.0, 0.0), None
    for device in message.location:
        # The wire lets any message stand where a DeviceState belongs.
        if isinstance(device, imcpy.DeviceState):
            lever_arm = (float(device.x), float(device.y), float(device.z))
            direction = told_direction(device)
        break
    valid = message.validity == imcpy.Distance.ValidityEnum.VALID
    return intake.offer(message.timestamp, source, valid, float(message.value), lever_arm, direction)
