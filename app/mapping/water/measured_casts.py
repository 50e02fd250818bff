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

LEVEL_M = 0.05
"""What changes its depth by less from one sample to the next goes neither down nor up."""

LAG_MPS, LEAST_SHARED = 0.5, 3
"""Speeds on the way down and up that differ by more, in so many bins at least, come from a probe that lags behind."""

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
    bins
        For each entry of the profile how many speeds its bin has, and how far they lie from their median as a standard
        deviation, metres per second.
    lag_mps
        By how much speeds on the way down are larger than on the way up, median over bins that have both; None: too few
        have. Where that is much, only the way down counts, on which a probe meets water that nothing has stirred.
    """

    time_s: float
    lat_deg: float
    lon_deg: float
    profile: list[tuple[float, float]]
    sd_mps: float
    samples: int
    bins: list[tuple[int, float]]
    lag_mps: float | None = None


def is_possible(speed_mps: float) -> bool:
    """Tell whether sound in water can be so fast."""
    return SLOWEST_MPS <= speed_mps <= FASTEST_MPS


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
    """Return the cast of some samples in the order of their times; None where they cover too little of the water."""
    way = _way(samples)
    width_m = max(BIN_M, float(samples.depth_m.max()) / MOST_BINS)
    lag_mps = _lag_mps(samples.take(way > 0), samples.take(way < 0), width_m)
    found = None
    if lag_mps is not None and abs(lag_mps) > LAG_MPS:
        found = _profile(samples.take(way >= 0), width_m, lag_mps)
    return found or _profile(samples, width_m, lag_mps)


def _way(samples: SoundSpeedSamples) -> FloatArray:
    """Return 1 for each sample that was measured on the way down, -1 for one on the way up, 0 for neither."""
    if len(samples) < 2:
        return np.zeros(len(samples))
    padded = np.concatenate([samples.depth_m[:1], samples.depth_m, samples.depth_m[-1:]])
    gone_m = padded[2:] - padded[:-2]
    return np.where(np.abs(gone_m) < 2.0 * LEVEL_M, 0.0, np.sign(gone_m))


def _lag_mps(down: SoundSpeedSamples, up: SoundSpeedSamples, width_m: float) -> float | None:
    """Return by how much speeds on the way down are larger than on the way up; None where too few bins have both."""
    on_way_down, on_way_up = _binned(down, width_m), _binned(up, width_m)
    off = [
        float(np.median(down.speed_mps[own]) - np.median(up.speed_mps[on_way_up[one]]))
        for one, own in on_way_down.items()
        if one in on_way_up
    ]
    return float(np.median(off)) if len(off) >= LEAST_SHARED else None


def _binned(samples: SoundSpeedSamples, width_m: float) -> dict[int, BoolArray]:
    """Return which samples are in each bin of depth, by its number; bins of too few are left out."""
    number = np.floor(samples.depth_m / width_m).astype(np.int64)
    bins = {int(one): number == one for one in np.unique(number)}
    return {one: own for one, own in bins.items() if own.sum() >= LEAST_SAMPLES}


def _profile(samples: SoundSpeedSamples, width_m: float, lag_mps: float | None) -> MeasuredCast | None:
    """Return the cast of samples, all of which count; None where they cover too little of the water."""
    depth_m, speed = samples.depth_m, samples.speed_mps
    profile, bins, off = [], [], []
    for own in _binned(samples, width_m).values():
        median = float(np.median(speed[own]))
        away = np.abs(speed[own] - median)
        profile.append((round(float(depth_m[own].mean()), 2), round(median, 2)))
        bins.append((int(own.sum()), round(NORMAL * float(np.median(away)), 3)))
        off.append(away)
    if len(profile) < 2 or profile[-1][0] - profile[0][0] < LEAST_SPAN_M - BIN_M:
        return None
    return MeasuredCast(
        time_s=round(float(np.median(samples.time_s)), 1),
        lat_deg=round(float(np.median(samples.lat_deg)), 6),
        lon_deg=round(float(np.median(samples.lon_deg)), 6),
        profile=profile,
        sd_mps=round(NORMAL * float(np.median(np.concatenate(off))), 3),
        samples=len(samples),
        bins=bins,
        lag_mps=None if lag_mps is None else round(lag_mps, 3),
    )
