"""Sea floors that nobody develops on: many families, each member by a seed, for figures that hold elsewhere too.

Development looks at even seeds; figures of odd seeds are reported. Depths are metres, positive down, and follow the
extent: a floor drawn twice as wide has the same forms twice as large, and as high as before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from simulator.arrays import FloatArray
from simulator.floors.relief import distance_along, fractal, smooth_field
from simulator.floors.seafloors import Family, check_extent
from simulator.floors.terrain import Terrain, TerrainError

SHOALEST_M = 3.0
"""What rises higher is worn down: vehicles pass over every unseen floor."""

MIXED = 2
"""Families in a mixture."""


def fractal_relief(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Fractal relief of a random spectrum (amplitude as frequency to -1.3 to -2.4) stretched up to four times."""
    field = fractal(east.shape, rng.uniform(1.3, 2.4), rng, rng.uniform(1.0, 4.0), rng.uniform(0.0, math.pi))
    return rng.uniform(10.0, 25.0) + rng.uniform(1.0, 4.0) * field


def canyons(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """One to three winding valleys 4 to 14 m deep in a tilted shelf, each with walls of its own steepness."""
    shelf = rng.uniform(6.0, 12.0) + rng.uniform(0.0, 5.0) * _lengthwise(east, north, extent, rng)
    cut = np.zeros(east.shape)
    for _ in range(int(rng.integers(1, 4))):
        angle = rng.uniform(0.0, math.pi)
        along = distance_along(east, north, angle) / extent
        across = distance_along(east, north, angle + 0.5 * math.pi) / extent - rng.uniform(-0.3, 0.3)
        axis = rng.uniform(0.05, 0.16) * np.sin(2.0 * math.pi * rng.uniform(0.6, 1.6) * along + rng.uniform(0.0, 6.3))
        axis = axis + 0.03 * np.sin(2.0 * math.pi * rng.uniform(2.0, 4.0) * along + rng.uniform(0.0, 6.3))
        deepening = 1.0 + 0.4 * np.clip(along, -0.7, 0.7)
        valley = 1.0 / (1.0 + (np.abs(across - axis) / rng.uniform(0.05, 0.13)) ** rng.uniform(2.0, 6.0))
        cut = np.maximum(cut, rng.uniform(4.0, 14.0) * deepening * valley)
    return np.asarray(shelf + cut + rng.uniform(0.1, 0.4) * smooth_field(east, north, 0.15 * extent, rng), dtype=float)


def terraces(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Three to seven flat steps of 1 to 3 m, their edges wavering, some sharp and some worn."""
    height = _lengthwise(east, north, extent, rng) + rng.uniform(0.08, 0.25) * smooth_field(
        east, north, rng.uniform(0.3, 0.7) * extent, rng
    )
    count = int(rng.integers(3, 8))
    levels = (height - height.min()) / np.ptp(height) * count
    floor = np.floor(levels)
    rise = 1.0 / (1.0 + np.exp(-np.clip((levels - floor - 0.5) / rng.uniform(0.02, 0.12), -50.0, 50.0)))
    levelled = rng.uniform(5.0, 9.0) + rng.uniform(1.0, 3.0) * (floor + rise)
    return np.asarray(levelled + 0.1 * fractal(east.shape, 1.4, rng), dtype=float)


def dunes(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Sand waves 0.8 to 3.5 m high with a gentle and a steep side, crests winding, small waves across them."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    wavelength = rng.uniform(0.08, 0.25)
    phase = distance_along(east, north, angle) / extent / wavelength
    phase = phase + rng.uniform(0.1, 0.5) * smooth_field(east, north, rng.uniform(0.3, 0.6) * extent, rng)
    turn, steep = phase - np.floor(phase), rng.uniform(0.6, 0.88)
    rise = np.where(turn < steep, turn / steep, (1.0 - turn) / (1.0 - steep))
    large = 0.5 - 0.5 * np.cos(math.pi * rise)
    growing = np.clip(1.0 + 0.4 * smooth_field(east, north, 0.8 * extent, rng), 0.2, 1.8)
    small = np.sin(2.0 * math.pi * distance_along(east, north, angle + rng.uniform(-0.6, 0.6)) / (0.035 * extent))
    depth = rng.uniform(8.0, 18.0) + rng.uniform(0.0, 3.0) * _lengthwise(east, north, extent, rng)
    return np.asarray(depth - rng.uniform(0.8, 3.5) * growing * large + rng.uniform(0.02, 0.12) * small, dtype=float)


def wrecks(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """One to four wrecks 1.5 to 5 m high on a nearly even bottom, scoured at both ends, debris about them."""
    z = rng.uniform(9.0, 18.0) + rng.uniform(0.5, 2.5) * _lengthwise(east, north, extent, rng)
    z = z + rng.uniform(0.1, 0.4) * smooth_field(east, north, 0.3 * extent, rng)
    for _ in range(int(rng.integers(1, 5))):
        at, heading = rng.uniform(0.12, 0.88, 2) * (east.max(), north.max()), rng.uniform(0.0, math.pi)
        u = distance_along(east - at[0], north - at[1], heading, centred=False)
        v = distance_along(east - at[0], north - at[1], heading + 0.5 * math.pi, centred=False)
        long, wide = rng.uniform(0.07, 0.16) * extent, rng.uniform(0.02, 0.04) * extent
        hull = np.clip(1.0 - (u / long) ** 4 - (v / wide) ** 2, 0.0, None) ** 0.35
        z = z - rng.uniform(1.5, 5.0) * hull * (1.0 + 0.25 * np.sin(9.0 * u / long))
        for end in (-1.0, 1.0):
            z = z + rng.uniform(0.3, 1.5) * np.exp(-((u - 1.2 * end * long) ** 2 + v**2) / (0.5 * long) ** 2)
        for _ in range(int(rng.integers(4, 15))):
            e, n = rng.normal(at, 0.09 * extent)
            radius = rng.uniform(0.006, 0.02) * extent
            z = z - rng.uniform(0.2, 1.0) * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * radius**2))
    return np.asarray(z, dtype=float)


def dredged_basins(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """A shallow with one to four rectangular basins and a channel, 3 to 9 m deeper, banks steep, furrowed."""
    z = rng.uniform(4.0, 7.0) + rng.uniform(0.0, 2.0) * _lengthwise(east, north, extent, rng)
    z = z + 0.2 * smooth_field(east, north, 0.2 * extent, rng)
    bank, angle = rng.uniform(0.008, 0.03) * extent, rng.uniform(0.0, math.pi)
    deeper = np.zeros(east.shape)
    cuts = [(1.5, rng.uniform(0.05, 0.12), 0.0)] + [
        (rng.uniform(0.1, 0.3), rng.uniform(0.08, 0.2), rng.uniform(-0.4, 0.4)) for _ in range(int(rng.integers(1, 5)))
    ]
    for long, wide, turned in cuts:
        at = rng.uniform(0.2, 0.8, 2) * (east.max(), north.max())
        u = np.abs(distance_along(east - at[0], north - at[1], angle + turned, centred=False)) - long * extent
        v = distance_along(east - at[0], north - at[1], angle + turned + 0.5 * math.pi, centred=False)
        inside = np.maximum(u, np.abs(v) - wide * extent)
        cut = rng.uniform(3.0, 9.0) / (1.0 + np.exp(np.clip(inside / bank, -50.0, 50.0)))
        furrows = 0.15 * np.sin(2.0 * math.pi * v / (0.03 * extent)) * (inside < 0.0)
        deeper = np.maximum(deeper, cut + furrows)
    return np.asarray(z + deeper, dtype=float)


def moraine(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Curved ridges of till 1 to 4 m high one behind the other, boulders on them, drumlins between."""
    centre = rng.uniform(-0.6, 1.6, 2) * (east.max(), north.max())
    away = np.hypot(east - centre[0], north - centre[1]) / extent
    away = away + 0.04 * smooth_field(east, north, 0.3 * extent, rng)
    z = rng.uniform(10.0, 20.0) + 0.4 * smooth_field(east, north, 0.4 * extent, rng)
    at = float(away.min()) + rng.uniform(0.02, 0.15)
    while at < away.max():
        gap = np.clip(0.8 + 0.5 * smooth_field(east, north, 0.25 * extent, rng), 0.0, 1.3)
        z = z - rng.uniform(1.0, 4.0) * gap * np.exp(-(((away - at) / rng.uniform(0.012, 0.04)) ** 2))
        at += rng.uniform(0.08, 0.25)
    heading = rng.uniform(0.0, math.pi)
    for _ in range(int(rng.integers(3, 12))):
        e, n = rng.uniform(0.0, 1.0, 2) * (east.max(), north.max())
        u = distance_along(east - e, north - n, heading, centred=False) / (rng.uniform(0.05, 0.12) * extent)
        v = distance_along(east - e, north - n, heading + 0.5 * math.pi, centred=False) / (0.03 * extent)
        z = z - rng.uniform(0.8, 2.5) * np.exp(-(u**2) - v**2)
    for _ in range(int(rng.integers(20, 60))):
        e, n = rng.uniform(0.0, 1.0, 2) * (east.max(), north.max())
        radius = rng.uniform(0.006, 0.014) * extent
        z = z - rng.uniform(0.4, 1.5) * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * radius**2))
    return np.asarray(z, dtype=float)


def pockmarks(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Craters 0.5 to 5 m deep of many sizes, singly and in strings, in soft ground."""
    z = rng.uniform(10.0, 22.0) + rng.uniform(0.0, 3.0) * _lengthwise(east, north, extent, rng)
    z = z + 0.15 * smooth_field(east, north, 0.3 * extent, rng)
    places = [rng.uniform(0.0, 1.0, 2) for _ in range(int(rng.integers(4, 16)))]
    for _ in range(int(rng.integers(0, 3))):
        begin, end = rng.uniform(0.0, 1.0, (2, 2))
        places += [begin + s * (end - begin) + rng.normal(0.0, 0.01, 2) for s in np.linspace(0.0, 1.0, 9)]
    for place in places:
        e, n = place * (east.max(), north.max())
        radius = rng.uniform(0.015, 0.08) * extent
        apart = ((east - e) ** 2 + (north - n) ** 2) / radius**2
        z = z + rng.uniform(0.5, 5.0) * (np.exp(-(apart**2)) - 0.12 * np.exp(-((np.sqrt(apart) - 1.5) ** 2) / 0.1))
    return np.asarray(z, dtype=float)


def outcrops(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Layered rock 2 to 8 m high that breaks through sand: steep on one side, along its layers on the other."""
    sand = rng.uniform(9.0, 16.0) + 0.3 * smooth_field(east, north, 0.4 * extent, rng)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    across = distance_along(east, north, angle) / extent + 0.05 * smooth_field(east, north, 0.5 * extent, rng)
    layer = across / rng.uniform(0.12, 0.3)
    scarp = 1.0 - (layer - np.floor(layer))
    where = 1.0 / (1.0 + np.exp(-4.0 * (smooth_field(east, north, 0.45 * extent, rng) - rng.uniform(-0.4, 0.4))))
    rough = 0.12 * fractal(east.shape, 1.2, rng)
    return np.asarray(sand - rng.uniform(2.0, 8.0) * where * (scarp**1.5 + rough), dtype=float)


def mixture(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Two of the other families side by side, the border between them winding."""
    names = rng.choice(sorted(set(UNSEEN) - {"mixture"}), MIXED, replace=False)
    first, second = (UNSEEN[str(name)](east, north, extent, rng) for name in names)
    border = _lengthwise(east, north, extent, rng) + 0.15 * smooth_field(east, north, 0.5 * extent, rng)
    share = 1.0 / (1.0 + np.exp(-np.clip(border / rng.uniform(0.01, 0.1), -50.0, 50.0)))
    meeting = np.median(first) - np.median(second)
    return np.asarray(share * first + (1.0 - share) * (second + rng.uniform(0.3, 1.0) * meeting), dtype=float)


UNSEEN: dict[str, Family] = {
    "canyons": canyons,
    "dredged_basins": dredged_basins,
    "dunes": dunes,
    "fractal_relief": fractal_relief,
    "mixture": mixture,
    "moraine": moraine,
    "outcrops": outcrops,
    "pockmarks": pockmarks,
    "terraces": terraces,
    "wrecks": wrecks,
}
"""The families by name."""


def unseen_floor(
    family: str, seed: int, *, width_m: float = 100.0, height_m: float = 100.0, cell_m: float = 1.0
) -> Terrain:
    """Draw an unseen sea floor; the same arguments give the same one, named ``FAMILY:SEED``.

    Raises
    ------
    TerrainError
        For an unknown family, or an extent of less than two cells.
    """
    if family not in UNSEEN:
        raise TerrainError(f"family is {family!r}; it must be one of {', '.join(sorted(UNSEEN))}")
    rows, cols = check_extent(width_m, height_m, cell_m)
    east, north = np.meshgrid((np.arange(cols) + 0.5) * cell_m, (np.arange(rows) + 0.5) * cell_m)
    # The family's name is part of the seed: members of two families share no draws.
    rng = np.random.default_rng([*family.encode(), seed])
    z = UNSEEN[family](east, north, float(min(width_m, height_m)), rng)
    return Terrain(np.maximum(z, SHOALEST_M), cell_m, name=f"{family}:{seed}")


def unseen_floors(
    seeds: Sequence[int], count: int, *, width_m: float = 100.0, height_m: float = 100.0
) -> list[Terrain]:
    """Return the first ``count`` unseen floors of some seeds: one of every family, then those of the next seed."""
    return [
        unseen_floor(family, seed, width_m=width_m, height_m=height_m) for family, seed in floor_names(seeds, count)
    ]


def floor_names(seeds: Sequence[int], count: int) -> Iterator[tuple[str, int]]:
    """Yield family and seed of the first ``count`` unseen floors: one of every family, then those of the next seed."""
    every = ((family, seed) for seed in seeds for family in sorted(UNSEEN))
    for _, one in zip(range(count), every, strict=False):
        yield one


def _lengthwise(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Return the coordinate in a random direction, about -0.7 to 0.7 over the extent."""
    return distance_along(east, north, rng.uniform(0.0, 2.0 * math.pi)) / extent
