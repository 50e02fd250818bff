"""Generated sea floors: families of terrain, each drawn by a seed."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from simulator.arrays import FloatArray
from simulator.floors.relief import distance_along, fractal, smooth_field
from simulator.floors.terrain import Terrain, TerrainError

Family = Callable[[FloatArray, FloatArray, float, np.random.Generator], FloatArray]
"""Depths of a family: (east_m, north_m, extent_m, rng) -> z_m, all of shape (rows, cols)."""

LEAST_DEPTH_M = 1.0
HARBOUR_CLEARANCE_M = 3.0
"""What rises higher in a harbour is removed: ships pass there."""


def generate(
    family: str = "harbour",
    seed: int = 0,
    *,
    width_m: float = 100.0,
    height_m: float = 100.0,
    cell_m: float = 1.0,
    origin: tuple[float, float] | None = None,
) -> Terrain:
    """Draw a sea floor; the same arguments give the same sea floor.

    Parameters
    ----------
    family
        One of :data:`FAMILIES`.
    seed
        Chooses the member of the family.
    width_m, height_m
        Extent west to east and south to north.
    cell_m
        Side of a cell.
    origin
        Latitude and longitude (degrees) of the south-west corner.

    Raises
    ------
    TerrainError
        For an unknown family or an extent of less than two cells.
    """
    if family not in FAMILIES:
        raise TerrainError(f"family is {family!r}; it must be one of {', '.join(sorted(FAMILIES))}")
    rows, cols = check_extent(width_m, height_m, cell_m)
    east, north = np.meshgrid((np.arange(cols) + 0.5) * cell_m, (np.arange(rows) + 0.5) * cell_m)
    rng = np.random.default_rng(seed)
    z = FAMILIES[family](east, north, float(min(width_m, height_m)), rng)
    lat, lon = origin if origin is not None else (None, None)
    return Terrain(np.maximum(z, LEAST_DEPTH_M), cell_m, lat, lon, name=f"{family} (seed {seed})")


def check_extent(width_m: float, height_m: float, cell_m: float) -> tuple[int, int]:
    """Return rows and columns of an extent. Raises TerrainError for cells without a size, or fewer than two a side."""
    if not (math.isfinite(cell_m) and cell_m > 0.0):
        raise TerrainError(f"cell_m is {cell_m}; it must be a positive number of metres")
    rows, cols = round(height_m / cell_m), round(width_m / cell_m)
    if min(rows, cols) < 2:
        raise TerrainError(
            f"width_m is {width_m} and height_m is {height_m}; each must be at least two cells of {cell_m} m"
        )
    return rows, cols


def flat(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """One constant depth of 8 to 20 m."""
    return np.full(east.shape, rng.uniform(8.0, 20.0))


def slope(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """A plane falling 4 to 8 m over the extent in a random direction, gently undulating."""
    along = distance_along(east, north, rng.uniform(0.0, 2.0 * math.pi)) / extent
    return 8.0 + rng.uniform(4.0, 8.0) * along + 0.25 * smooth_field(east, north, 0.25 * extent, rng)


def smooth(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Cubic spline through random depths a quarter of the extent apart, 12 m with 3 m standard deviation."""
    from scipy.interpolate import RectBivariateSpline

    pitch = extent / 4.0
    knots_n = np.arange(-pitch, float(north.max()) + 2.5 * pitch, pitch)
    knots_e = np.arange(-pitch, float(east.max()) + 2.5 * pitch, pitch)
    spline = RectBivariateSpline(knots_n, knots_e, rng.normal(0.0, 3.0, (knots_n.size, knots_e.size)), s=0)
    return 12.0 + np.asarray(spline(north[:, 0], east[0]), dtype=float)


def rugged(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Fractal relief: spectral amplitude falls as frequency to the power -1.9; 2.5 m standard deviation."""
    return 12.0 + 2.5 * fractal(east.shape, 1.9, rng)


def ridge(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """A ridge 4 to 6 m high with a wavering crest across a nearly flat bottom."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    along = distance_along(east, north, angle) / extent
    across = distance_along(east, north, angle + 0.5 * math.pi) / extent
    crest = 0.12 * np.sin(2.0 * math.pi * along * rng.uniform(0.6, 1.2) + rng.uniform(0.0, 2.0 * math.pi))
    height = rng.uniform(4.0, 6.0) * (1.0 + 0.3 * np.sin(5.0 * along + rng.uniform(0.0, 2.0 * math.pi)))
    profile = 1.0 / (1.0 + ((across - crest) / rng.uniform(0.06, 0.1)) ** 2)
    return 13.0 - height * profile + 0.3 * smooth_field(east, north, 0.2 * extent, rng)


def reef(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Steep, rough patches of rock 1.5 to 4 m high standing on smooth sand."""
    sand = 11.0 + 0.4 * smooth_field(east, north, 0.4 * extent, rng)
    outline = smooth_field(east, north, 0.07 * extent, rng)
    rock = np.zeros(east.shape)
    for _ in range(int(rng.integers(6, 11))):
        e, n = rng.uniform(0.0, 1.0, 2) * (east.max(), north.max())
        radius = rng.uniform(0.05, 0.13) * extent
        edge = (radius * (1.0 + 0.25 * outline) - np.hypot(east - e, north - n)) / (0.015 * extent)
        rock = np.maximum(rock, rng.uniform(1.5, 4.0) / (1.0 + np.exp(-np.clip(edge, -50.0, 50.0))))
    roughness = 0.35 * fractal(east.shape, 1.2, rng)
    return np.asarray(sand - rock * (1.0 + 0.3 * roughness), dtype=float)


def reef_field(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """Many small rocks 1 to 3 m high, gathered on one part of smooth sand."""
    sand = 11.0 + 0.4 * smooth_field(east, north, 0.4 * extent, rng)
    rock = np.zeros(east.shape)
    middle = rng.uniform(0.25, 0.75, 2)
    for _ in range(40):
        e, n = np.clip(middle + rng.normal(0.0, 0.22, 2), 0.0, 1.0) * (east.max(), north.max())
        radius = rng.uniform(0.015, 0.04) * extent
        edge = (radius - np.hypot(east - e, north - n)) / (0.01 * extent)
        rock = np.maximum(rock, rng.uniform(1.0, 3.0) / (1.0 + np.exp(-np.clip(edge, -50.0, 50.0))))
    roughness = fractal(east.shape, 1.2, rng)
    return np.asarray(sand - rock * (1.0 + 0.1 * roughness), dtype=float)


def canyon(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """A meandering valley 7 to 10 m deep with steep walls and one tributary, cut into a tilted shelf."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    along = distance_along(east, north, angle) / extent
    across = distance_along(east, north, angle + 0.5 * math.pi) / extent
    phase, waves = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.8, 1.4)
    axis = 0.13 * np.sin(2.0 * math.pi * waves * along + phase)
    depth = rng.uniform(7.0, 10.0)
    valley = depth / (1.0 + (np.abs(across - axis) / 0.11) ** 4)
    mouth = rng.uniform(-0.1, 0.1)
    root = 0.13 * math.sin(2.0 * math.pi * waves * mouth + phase)
    side = 0.5 * depth / (1.0 + (np.abs(along - mouth - 0.6 * (across - root)) / 0.06) ** 4)
    tributary = np.where(across > root, side, 0.0) * np.clip((across - root) / 0.05, 0.0, 1.0)
    shelf = 6.0 + 1.5 * along + 0.3 * smooth_field(east, north, 0.2 * extent, rng)
    return np.asarray(shelf + np.maximum(valley, tributary), dtype=float)


def harbour(east: FloatArray, north: FloatArray, extent: float, rng: np.random.Generator) -> FloatArray:
    """A gentle slope, a dredged edge of some metres, and a few sharp features.

    Modelled on the Leixões maps of the papers' field trials: 4 to 6 m on the slope, 10 to 12 m in the
    dredged basin, the edge falling over some metres; features are a wreck, a field of rubble, scour pits and a trench.
    """
    angle = rng.uniform(0.0, 2.0 * math.pi)
    along = distance_along(east, north, angle) / extent
    across = distance_along(east, north, angle + 0.5 * math.pi) / extent
    z = 4.8 + rng.uniform(1.0, 2.0) * (along + 0.5) + 0.12 * smooth_field(east, north, 0.12 * extent, rng)

    line = rng.uniform(0.0, 0.15) + 0.03 * np.sin(2.0 * math.pi * across * rng.uniform(0.7, 1.5))
    step = rng.uniform(4.0, 5.5)
    z = z + step / (1.0 + np.exp(-np.clip((along - line) / 0.022, -50.0, 50.0)))

    def somewhere() -> tuple[float, float]:
        e, n = rng.uniform(0.12, 0.88, 2)
        return float(e * east.max()), float(n * north.max())

    e, n = somewhere()
    heading = rng.uniform(0.0, math.pi)
    u = distance_along(east - e, north - n, heading, centred=False)
    v = distance_along(east - e, north - n, heading + 0.5 * math.pi, centred=False)
    hull = np.clip(1.0 - (u / (0.09 * extent)) ** 2 - (v / (0.03 * extent)) ** 2, 0.0, None)
    z = z - rng.uniform(1.6, 2.2) * np.sqrt(hull)

    # Rubble lies together, as it was dumped or as a breakwater shed it.
    rubble_e, rubble_n = somewhere()
    for _ in range(int(rng.integers(10, 16))):
        e, n = rng.normal((rubble_e, rubble_n), 0.05 * extent)
        radius = rng.uniform(0.02, 0.04) * extent
        dome = np.clip(1.0 - ((east - e) ** 2 + (north - n) ** 2) / radius**2, 0.0, None)
        z = z - rng.uniform(0.4, 0.9) * np.sqrt(dome)

    for _ in range(int(rng.integers(2, 4))):
        e, n = somewhere()
        radius = rng.uniform(0.03, 0.05) * extent
        z = z + rng.uniform(1.0, 1.8) * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * radius**2))

    e, n = somewhere()
    heading = rng.uniform(0.0, math.pi)
    u = distance_along(east - e, north - n, heading, centred=False)
    v = distance_along(east - e, north - n, heading + 0.5 * math.pi, centred=False)
    trench = np.exp(-((v / (0.02 * extent)) ** 2)) / (1.0 + (np.abs(u) / (0.25 * extent)) ** 8)
    return np.maximum(z + rng.uniform(0.8, 1.3) * trench, HARBOUR_CLEARANCE_M)


FAMILIES: dict[str, Family] = {
    "canyon": canyon,
    "flat": flat,
    "harbour": harbour,
    "reef": reef,
    "reef_field": reef_field,
    "ridge": ridge,
    "rugged": rugged,
    "slope": slope,
    "smooth": smooth,
}
"""The families by name."""
