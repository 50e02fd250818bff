"""Targets that move about in the water and answer vehicles' acoustic modems, so that those can range to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simulator.floors.terrain import Terrain
from simulator.world import LocalPosition


@dataclass(frozen=True, slots=True)
class TargetSpec:
    """One target: the name that modems call it by, where it starts, and how it moves.

    ``start`` is (east, north, depth) in metres in the terrain's frame; ``heading_rad`` is clockwise from north.
    """

    name: str
    start: tuple[float, float, float]
    heading_rad: float = 0.0
    speed_mps: float = 0.3


@dataclass(frozen=True, slots=True)
class RangingNoise:
    """How well modems measure ranges, how often, and how far.

    Attributes
    ----------
    relative_sd, sd_m
        Errors: a part of the range, and one that is the same at any range.
    period_s
        Time between two ranges of one vehicle to one target.
    hearing_m
        Farther than this no answer comes.
    loss, outliers
        Shares of ranges that do not come, and that are false echoes.
    """

    relative_sd: float = 0.01
    sd_m: float = 0.3
    period_s: float = 2.0
    hearing_m: float = math.inf
    loss: float = 0.0
    outliers: float = 0.0


class Target:
    """A target on its way: straight on at a constant speed, turning back where the terrain ends.

    It keeps its depth, or stays just above the sea floor where that is shallower. Where it is follows from the time
    alone, so that every vehicle that asks finds it at the same place.
    """

    def __init__(self, spec: TargetSpec, terrain: Terrain, start_s: float) -> None:
        east, north, depth = spec.start
        if not terrain.contains(east, north):
            raise ValueError(
                f"target {spec.name}: start ({east:g}, {north:g}) lies outside of the terrain; "
                f"east must be 0 to {terrain.width_m:g} m and north 0 to {terrain.height_m:g} m"
            )
        if not (depth >= 0.0 and spec.speed_mps >= 0.0 and math.isfinite(spec.speed_mps)):
            raise ValueError(
                f"target {spec.name}: depth is {depth:g} m, speed {spec.speed_mps:g} m/s; both must be >= 0"
            )
        self.spec = spec
        self._terrain = terrain
        self._start_s = start_s

    @property
    def name(self) -> str:
        """What modems call it by."""
        return self.spec.name

    def at(self, time_s: float) -> LocalPosition:
        """Where it is at a time of the vehicles' clock."""
        spec = self.spec
        way_m = spec.speed_mps * max(0.0, time_s - self._start_s)
        east = _reflected(spec.start[0] + way_m * math.sin(spec.heading_rad), self._terrain.width_m)
        north = _reflected(spec.start[1] + way_m * math.cos(spec.heading_rad), self._terrain.height_m)
        floor_m = self._terrain.depth_at_point(east, north)
        return LocalPosition(east, north, min(spec.start[2], floor_m) if math.isfinite(floor_m) else spec.start[2])


class Ranging:
    """One vehicle's modem: asks the targets in turn.

    Parameters
    ----------
    targets
        Whom it asks.
    noise
        How well.
    rng
        Source of the errors.
    start_s
        When it begins.
    """

    def __init__(
        self, targets: Sequence[Target], noise: RangingNoise, rng: np.random.Generator, start_s: float
    ) -> None:
        if not noise.period_s > 0.0:
            raise ValueError(f"ranging: period_s is {noise.period_s}; it must be positive")
        self._targets = list(targets)
        self._noise = noise
        self._rng = rng
        # A modem asks one after the other: the answers of one period do not come at once.
        self._due_s = [start_s + (k + 1) * noise.period_s / max(len(targets), 1) for k in range(len(targets))]

    def step(self, time_s: float, here: LocalPosition) -> list[tuple[str, float]]:
        """Return the ranges, by target, that were measured until ``time_s`` from a true place."""
        found = []
        for k, target in enumerate(self._targets):
            if time_s < self._due_s[k] - 1e-6:
                continue
            self._due_s[k] = max(self._due_s[k] + self._noise.period_s, time_s + 0.5 * self._noise.period_s)
            measured = self._measure(target.at(time_s), here)
            if measured is not None:
                found.append((target.name, measured))
        return found

    def _measure(self, there: LocalPosition, here: LocalPosition) -> float | None:
        noise, rng = self._noise, self._rng
        true_m = math.dist((there.east_m, there.north_m, there.depth_m), (here.east_m, here.north_m, here.depth_m))
        lost, false, relative, absolute = rng.random(), rng.random(), rng.standard_normal(), rng.standard_normal()
        if true_m > noise.hearing_m or lost < noise.loss:
            return None
        if false < noise.outliers:
            return true_m * 1.5 + 20.0
        return max(0.01, true_m * (1.0 + noise.relative_sd * float(relative)) + noise.sd_m * float(absolute))


def _reflected(along_m: float, length_m: float) -> float:
    """Return a place on a line of some length, at whose ends ways turn back."""
    turned = along_m % (2.0 * length_m)
    return turned if turned <= length_m else 2.0 * length_m - turned
