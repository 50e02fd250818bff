"""What is adjusted: soundings along vehicles' ways, and fixes that say how far off a position was."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class TrackSoundings:
    """Soundings of a fleet, n of them, of each vehicle in the order of time.

    Attributes
    ----------
    vehicle : (n,)
        Number of the vehicle.
    time_s : (n,)
        The vehicle's clock.
    east_m, north_m, depth_m : (n,)
        Where the bottom was met by the vehicle's own position, local frame, positive down.
    sd_m : (n,)
        Standard deviation of the depth.
    """

    vehicle: IntArray
    time_s: FloatArray
    east_m: FloatArray
    north_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray

    def __len__(self) -> int:
        return len(self.time_s)

    def take(self, rows: IntArray | BoolArray | slice) -> "TrackSoundings":
        """Return some of them."""
        return TrackSoundings(**{column.name: getattr(self, column.name)[rows] for column in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence["TrackSoundings"]) -> "TrackSoundings":
        """Return the soundings of all parts, in the order of vehicle and time."""
        columns: dict[str, Any] = {}
        for column in fields(cls):
            kind = np.int64 if column.name == "vehicle" else np.float64
            columns[column.name] = np.concatenate([np.zeros(0, kind), *(getattr(part, column.name) for part in parts)])
        found = cls(**columns)
        return found.take(np.lexsort((found.time_s, found.vehicle)))


@dataclass(frozen=True)
class Fixes:
    """Moments at which it was known how far off a vehicle's position was, k of them.

    Attributes
    ----------
    vehicle, time_s : (k,)
    east_m, north_m : (k,)
        The position that the vehicle had reckoned until then, minus the fix.
    sd_m : (k,)
        Of each coordinate of the fix.
    resets : (k,)
        Whether the vehicle reckons from the fix on, so that the error begins anew.
    """

    vehicle: IntArray
    time_s: FloatArray
    east_m: FloatArray
    north_m: FloatArray
    sd_m: FloatArray
    resets: BoolArray

    def __len__(self) -> int:
        return len(self.time_s)

    @classmethod
    def none(cls) -> "Fixes":
        """Return no fix at all."""
        empty = np.zeros(0)
        return cls(np.zeros(0, np.int64), empty, empty, empty, empty, np.zeros(0, bool))


def thinned(soundings: TrackSoundings, cell_m: float, period_s: float) -> TrackSoundings:
    """Return the mean of the soundings that a vehicle made in a square within a period.

    Millions of beams become some thousand places. Of more than four soundings those are left out that are far from
    their median. The deviation is that of the mean, and never less than a third of the smallest of them.
    """
    if not len(soundings):
        return soundings
    keys = np.column_stack(
        [
            soundings.vehicle,
            np.floor(soundings.time_s / period_s).astype(np.int64),
            np.floor(soundings.east_m / cell_m).astype(np.int64),
            np.floor(soundings.north_m / cell_m).astype(np.int64),
        ]
    )
    order = np.lexsort((soundings.depth_m, *keys.T[::-1]))
    keys, ordered = keys[order], soundings.take(order)
    begins = np.concatenate([[True], (np.diff(keys, axis=0) != 0).any(axis=1)])
    first = np.flatnonzero(begins)
    group = np.cumsum(begins) - 1
    count = np.diff(np.append(first, len(order)))
    median = 0.5 * (ordered.depth_m[first + (count - 1) // 2] + ordered.depth_m[first + count // 2])
    away = np.abs(ordered.depth_m - median[group])
    quarter = ordered.depth_m[first + (3 * (count - 1)) // 4] - ordered.depth_m[first + (count - 1) // 4]
    far = (away > 3.0 * (quarter[group] + ordered.sd_m)) & (count[group] > 4)
    weight = np.where(far, 0.0, ordered.sd_m**-2)
    total = np.bincount(group, weight)

    def mean(values: FloatArray) -> FloatArray:
        # Times are large numbers: their differences are what is averaged.
        begin = values[first]
        return np.asarray(begin + np.bincount(group, weight * (values - begin[group])) / total)

    least = np.minimum.reduceat(ordered.sd_m, first)
    places = TrackSoundings(
        vehicle=ordered.vehicle[first],
        time_s=mean(ordered.time_s),
        east_m=mean(ordered.east_m),
        north_m=mean(ordered.north_m),
        depth_m=mean(ordered.depth_m),
        sd_m=np.maximum(1.0 / np.sqrt(total), least / 3.0),
    )
    return places.take(np.lexsort((places.time_s, places.vehicle)))
