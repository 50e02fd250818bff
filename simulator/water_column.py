"""How fast sound is in simulated water, and what that does to a beam and to what a sonar takes for its range.

Between two depths of a profile the speed changes linearly: a ray is an arc of a circle there (Medwin & Clay 1998,
section 3.3). The straight line between two of its places, its chord, leaves the vertical by half the sum of the ray's
angles at both, and a ray needs ``2 / g arsinh(g chord / (2 sqrt(v1 v2)))`` for it, with v the speeds and g their
gradient.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simulator.arrays import FloatArray

ASSUMED_MPS = 1500.0
"""What sonars multiply a sound's time with."""

SLOWEST_MPS, FASTEST_MPS = 1350.0, 1650.0
"""What sound in water is never slower, or faster, than."""

MOST_ENTRIES = 200


@dataclass(frozen=True, slots=True)
class WaterColumn:
    """Sound speed over depth: entries of depth, metres, and speed, metres per second.

    Linear between them, and constant above the first and below the last.

    Raises
    ------
    ValueError
        When there is no entry, depths do not ascend from 0 or more, or a speed is none of water's.
    """

    entries: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.entries) <= MOST_ENTRIES:
            raise ValueError(f"water column: it has {len(self.entries)} entries; use 1 to {MOST_ENTRIES}")
        above_m = -math.inf
        for depth_m, speed_mps in self.entries:
            if not (math.isfinite(depth_m) and depth_m >= 0.0 and depth_m > above_m):
                raise ValueError(f"water column: depth {depth_m:g} m must be 0 or more and below the entry before it")
            if not SLOWEST_MPS <= speed_mps <= FASTEST_MPS:
                raise ValueError(
                    f"water column: sound speed {speed_mps:g} m/s must be {SLOWEST_MPS:g} to {FASTEST_MPS:g} m/s"
                )
            above_m = depth_m

    @classmethod
    def of(cls, entries: Sequence[Sequence[float]]) -> WaterColumn | None:
        """Return the column of entries (depth, speed); None for none: then sound is as fast as sonars assume."""
        return cls(tuple((float(depth_m), float(speed_mps)) for depth_m, speed_mps in entries)) if entries else None

    def speed_mps(self, depth_m: float) -> float:
        """How fast sound is at a depth."""
        depths, speeds = zip(*self.entries, strict=True)
        return float(np.interp(depth_m, depths, speeds))

    def range_down_m(self, depth_m: float, down_m: float) -> float:
        """Return what a sonar takes a vertical distance for."""
        _, range_m = self.beams(np.zeros(1), depth_m, np.array([down_m]))
        return float(range_m[0])

    def beams(self, launch_rad: FloatArray, depth_m: float, down_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Follow beams down to where they are so much deeper.

        Parameters
        ----------
        launch_rad : (n,)
            Angles from straight down at which they leave the sonar, 0 or more.
        depth_m
            Of the sonar.
        down_m : (n,)
            How far below the sonar they are followed, above 0.

        Returns
        -------
        Angles from straight down of the straight lines to there, and the ranges that the sonar tells; NaN for beams
        that the water turns back before they are there.
        """
        steps_m, above_mps, below_mps = self._layers(depth_m, down_m)
        sines = np.sin(launch_rad) / above_mps[:, 0]
        with np.errstate(invalid="ignore"):
            # NaN where a ray would have to be flatter than level.
            upper, lower = (np.arcsin(sines[:, None] * speeds) for speeds in (above_mps, below_mps))
            chord = 0.5 * (upper + lower)
            across_m = (steps_m * np.tan(chord)).sum(axis=1)
            length_m = steps_m / np.cos(chord)
            mean_mps = np.sqrt(above_mps * below_mps)
            bend = np.where(steps_m > 0.0, np.abs(below_mps - above_mps) / np.maximum(steps_m, 1e-12), 0.0) * (
                0.5 * length_m / mean_mps
            )
            time_s = (length_m / mean_mps * np.where(bend > 1e-9, np.arcsinh(bend) / np.maximum(bend, 1e-12), 1.0)).sum(
                axis=1
            )
        return np.arctan2(across_m, down_m), ASSUMED_MPS * time_s

    def _layers(self, depth_m: float, down_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """How thick each layer is that beams cross, and the speeds at its upper and lower edge; (n, layers) each."""
        depths, speeds = (np.array(column) for column in zip(*self.entries, strict=True))
        end_m = depth_m + down_m[:, None]
        edges = np.concatenate([[depth_m], depths[depths > depth_m], [np.inf]])
        upper, lower = np.minimum(edges[:-1], end_m), np.minimum(edges[1:], end_m)
        return lower - upper, np.interp(upper, depths, speeds), np.interp(lower, depths, speeds)


@dataclass(frozen=True, slots=True)
class SeaWater:
    """Water that vehicles swim in.

    Attributes
    ----------
    current_mps
        Its velocity over ground, (east, north).
    column
        How fast sound is in it; None: as fast as sonars assume, and no vehicle has a probe.
    """

    current_mps: tuple[float, float] = (0.0, 0.0)
    column: WaterColumn | None = None


STILL = SeaWater()
