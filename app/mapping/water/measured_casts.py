"""Sound speed casts from what a vehicle measured on its way: how fast sound was where it was."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray

SLOWEST_MPS, FASTEST_MPS = 1350.0, 1650.0
"""What sound in water is never slower, or faster, than."""

LEAST_DEPTH_M = 0.3
"""Nearer to the surface a probe may be in the air."""

LEAST_SPAN_M = 2.0
"""What covers less of the water is no cast."""

PART_OF_SPAN = 0.5
"""A cast covers at least this part of the depths that were measured in all: vehicles survey long at one depth."""

LONGEST_S, PAUSE_S = 3600.0, 600.0
"""After so long another cast begins, and after nothing was measured for so long."""

MOST_CASTS = 24

BIN_M, MOST_BINS = 0.5, 100
LEAST_SAMPLES = 3
"""Fewer in a bin tell no median."""

NORMAL = 1.4826
"""The standard deviation of normal errors, in medians of their sizes."""


@dataclass(frozen=True)
class SoundSpeedSamples:
    """Sound speeds and where they were measured, each of shape (n,).

    Attributes
    ----------
    time_s
        The vehicle's clock, Unix seconds.
    depth_m
        Below the surface.
    speed_mps
    lat_deg, lon_deg
        WGS 84.
    """

    time_s: FloatArray
    depth_m: FloatArray
    speed_mps: FloatArray
    lat_deg: FloatArray
    lon_deg: FloatArray

    def take(self, rows: BoolArray | slice) -> "SoundSpeedSamples":
        """Return some of them."""
        columns = (self.time_s, self.depth_m, self.speed_mps, self.lat_deg, self.lon_deg)
        return SoundSpeedSamples(*(column[rows] for column in columns))

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True)
class MeasuredCast:
    """A cast that a vehicle measured.

    Attributes
    ----------
    time_s, lat_deg, lon_deg
        The middle of when and where.
    profile
        Depths, metres, and speeds, metres per second, from top to bottom: means and medians of bins of depth.
    sd_mps
        How far single speeds lie from those of their bins, as a standard deviation.
    samples
        How many speeds it is made of.
    """

    time_s: float
    lat_deg: float
    lon_deg: float
    profile: list[tuple[float, float]]
    sd_mps: float
    samples: int


def measured_casts(samples: SoundSpeedSamples) -> list[MeasuredCast]:
    """Return the casts in what a vehicle measured, in the order of their times; impossible speeds are left out.

    A new one begins each hour, and after a pause, where it covers the water as the whole does.
    """
    speed = samples.speed_mps
    with np.errstate(invalid="ignore"):
        good = (speed >= SLOWEST_MPS) & (speed <= FASTEST_MPS) & (samples.depth_m >= LEAST_DEPTH_M)
    for column in (samples.time_s, samples.lat_deg, samples.lon_deg):
        good &= np.isfinite(column)
    samples = samples.take(good)
    if len(samples) < LEAST_SAMPLES:
        return []
    order = np.argsort(samples.time_s, kind="stable")
    samples = SoundSpeedSamples(
        *(
            column[order]
            for column in (samples.time_s, samples.depth_m, samples.speed_mps, samples.lat_deg, samples.lon_deg)
        )
    )
    casts = (_cast(samples.take(part)) for part in _parts(samples))
    return [cast for cast in casts if cast is not None]


def _parts(samples: SoundSpeedSamples) -> list[slice]:
    """Return which samples, in the order of their times, belong to one cast."""
    time_s, depth_m = samples.time_s, samples.depth_m
    longest_s = max(LONGEST_S, float(np.ptp(time_s)) / MOST_CASTS)
    least_m = max(LEAST_SPAN_M, PART_OF_SPAN * float(np.ptp(depth_m)))
    edges, begin = [0], 0
    pauses = set((np.flatnonzero(np.diff(time_s) > PAUSE_S) + 1).tolist())
    for at in sorted(pauses | set(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], longest_s)).tolist())):
        is_due = at in pauses or time_s[at] - time_s[begin] >= longest_s
        if at > begin and is_due and np.ptp(depth_m[begin:at]) >= least_m:
            edges.append(at)
            begin = at
    if len(edges) > 1 and np.ptp(depth_m[begin:]) < least_m:
        # What came after the last whole one belongs to it.
        edges.pop()
    edges = edges[:MOST_CASTS]
    return [slice(a, b) for a, b in zip(edges, [*edges[1:], len(time_s)], strict=True)]


def _cast(samples: SoundSpeedSamples) -> MeasuredCast | None:
    """Return the cast of some samples; None where they cover too little of the water."""
    depth_m, speed = samples.depth_m, samples.speed_mps
    width_m = max(BIN_M, float(depth_m.max()) / MOST_BINS)
    number = np.floor(depth_m / width_m).astype(np.int64)
    profile, off = [], []
    for one in np.unique(number):
        own = number == one
        if own.sum() >= LEAST_SAMPLES:
            median = float(np.median(speed[own]))
            profile.append((round(float(depth_m[own].mean()), 2), round(median, 2)))
            off.append(np.abs(speed[own] - median))
    if len(profile) < 2 or profile[-1][0] - profile[0][0] < LEAST_SPAN_M - BIN_M:
        return None
    return MeasuredCast(
        time_s=round(float(np.median(samples.time_s)), 1),
        lat_deg=round(float(np.median(samples.lat_deg)), 6),
        lon_deg=round(float(np.median(samples.lon_deg)), 6),
        profile=profile,
        sd_mps=round(NORMAL * float(np.median(np.concatenate(off))), 3),
        samples=len(samples),
    )
