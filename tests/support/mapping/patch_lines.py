"""Pings of lines over a floor that is a function, of a sonar that is mounted in a known way; and what is told of it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.mounting import STRAIGHT, Mounting, StatedTrack, mounted, rotation_of
from app.mapping.swath.patch_test import (
    LineErrors,
    MountingEstimate,
    NoOverlapError,
    PatchBeams,
    SharedGround,
    block_size_m,
    estimate,
    passes_of,
    with_only,
)
from app.mapping.swath.pings import Pings, placed

FRAME = LocalFrame(41.185, -8.705)
BEAMS, APERTURE_DEG, RATE_HZ, SONAR_M, LONG_M = 64, 120.0, 3.0, 2.0, 50.0

Floor = Callable[[FloatArray, FloatArray], FloatArray]
Line = tuple[float, float, float, float, float]
"""East and north of its begin and of its end, and the speed."""

THERE_AND_BACK: list[Line] = [(30, 0, 30, LONG_M, 1.5), (30, LONG_M, 30, 0, 1.5)]
PATCH: list[Line] = [
    *THERE_AND_BACK,
    (30, 0, 30, LONG_M, 0.75),
    (42, 0, 42, LONG_M, 1.5),
    (42, LONG_M, 42, 0, 1.5),
    (18, 0, 18, LONG_M, 1.5),
    (18, LONG_M, 18, 0, 1.5),
    (30, LONG_M, 30, 0, 0.75),
]
"""All that a patch test takes."""


def flat(east: FloatArray, north: FloatArray) -> FloatArray:
    """A level floor."""
    return np.full(np.broadcast(east, north).shape, 14.0)


def slope(east: FloatArray, north: FloatArray) -> FloatArray:
    """A floor that falls to the north, the same everywhere."""
    return np.asarray(14.0 + 0.1 * north + 0.0 * east)


def bumpy(seed: int) -> Floor:
    """A floor of waves of 10 to 60 m in all directions."""
    rng = np.random.default_rng(seed)
    number, course, phase = rng.uniform(0.1, 0.6, 12), rng.uniform(0.0, 2.0 * np.pi, 12), rng.uniform(0, 2 * np.pi, 12)

    def depth(east: FloatArray, north: FloatArray) -> FloatArray:
        down = 14.0 + 0.03 * east - 0.02 * north
        for k, at, begin in zip(number.tolist(), course.tolist(), phase.tolist(), strict=True):
            along = math.cos(at) * east + math.sin(at) * north
            down = down + 0.06 / k * np.sin(k * along + begin)
        return np.asarray(down)

    return depth


@dataclass(frozen=True)
class Errors:
    """Of ranges, as a share, and of lines as a whole."""

    ranges: float = 0.003
    position_m: float = 0.0
    level_m: float = 0.0


def lines(floor: Floor, mounting: Mounting, flown: Sequence[Line], seed: int, errors: Errors | None = None) -> Pings:
    """Pings along lines, a minute between them, of a vehicle that rolls and pitches a little."""
    rng, start_s, parts, wrong = np.random.default_rng(seed), 0.0, [], errors or Errors()
    for line in flown:
        pings = _line(floor, mounting, line, rng, start_s, wrong)
        parts.append(pings)
        start_s = float(pings.time_s[-1]) + 60.0
    return Pings.joined(parts)


def _line(
    floor: Floor, mounting: Mounting, line: Line, rng: np.random.Generator, start_s: float, errors: Errors
) -> Pings:
    begin, end, speed = np.array(line[:2]), np.array(line[2:4]), line[4]
    long_m = float(np.hypot(*(end - begin)))
    along = (end - begin) / long_m
    time_s = np.arange(0.0, long_m / speed, 1.0 / RATE_HZ)
    at = begin + speed * time_s[:, None] * along
    stated = at - speed * mounting.latency_s * along + errors.position_m * rng.standard_normal(2)
    roll, pitch = (0.02 * np.sin(rate * time_s + rng.uniform(0.0, 6.0)) for rate in (1.3, 0.9))
    heading = math.atan2(along[0], along[1]) + 0.02 * np.sin(0.5 * time_s)
    angle = np.radians(np.linspace(-0.5 * APERTURE_DEG, 0.5 * APERTURE_DEG, BEAMS))
    vehicle = rotation_of(heading, pitch, roll)
    arm = vehicle.apply(mounting.offset_m)
    beams = np.stack([np.zeros(BEAMS), np.sin(angle), np.cos(angle)], axis=1)
    ned = np.einsum("kij,bj->kbi", (vehicle * mounting.rotation).as_matrix(), beams)
    sonar = np.column_stack([at[:, 0] + arm[:, 1], at[:, 1] + arm[:, 0], SONAR_M + arm[:, 2]])
    ranges = met(floor, sonar[:, None, :], ned[..., [1, 0, 2]])
    ranges = ranges * (1.0 + errors.ranges * rng.standard_normal(ranges.shape) / np.cos(angle))
    lat, lon = FRAME.to_geographic(*stated.T)
    count = len(time_s)
    return Pings(
        start_s + time_s,
        np.asarray(lat),
        np.asarray(lon),
        np.full(count, SONAR_M + errors.level_m * rng.standard_normal()),
        roll,
        pitch,
        heading,
        np.full(count, np.nan),
        np.tile(angle, (count, 1)).astype(np.float32),
        ranges.astype(np.float32),
    )


def met(floor: Floor, sonar: FloatArray, direction: FloatArray) -> FloatArray:
    """Ranges at which rays meet the floor, by steps that become ever smaller."""
    found = (floor(sonar[..., 0], sonar[..., 1]) - sonar[..., 2]) / direction[..., 2]
    for _ in range(25):
        at = sonar + found[..., None] * direction
        found = found + 0.8 * (floor(at[..., 0], at[..., 1]) - at[..., 2]) / direction[..., 2]
    return np.asarray(found)


def told(
    pings: Pings,
    now: Mounting = STRAIGHT,
    errors: LineErrors | None = None,
    is_wanted: Callable[[], bool] = lambda: True,
) -> MountingEstimate:
    """What these pings say when the sonar is taken to be mounted like ``now``. Raises NoOverlapError."""
    errors = errors or LineErrors(0.3, 0.05)
    track = np.column_stack(FRAME.to_local(pings.lat_deg, pings.lon_deg))
    line = passes_of(pings.time_s, track, pings.heading_rad).of(pings.time_s, pings.heading_rad)
    height_m = float(np.nanmedian(pings.range_m * np.cos(pings.angle_rad)))
    at = placed(mounted(pings, now, FRAME, StatedTrack()), FRAME)
    places = np.column_stack([at.east_m, at.north_m])
    shared, rng = SharedGround(block_size_m(height_m)), np.random.default_rng(1)
    shared.add(places, line[at.ping])
    ground = shared.chosen(rng)
    if ground is None:
        raise NoOverlapError("nothing is shared")
    kept = np.isfinite(pings.range_m)
    kept[kept] = ground.takes(places, line[at.ping], rng)
    rows = np.flatnonzero(kept.any(axis=1))
    beams = PatchBeams(with_only(pings, kept), line[rows], rows, np.zeros((len(rows), 3)), pings.time_s, track, FRAME)
    return estimate(beams, now, height_m, errors, is_wanted)
