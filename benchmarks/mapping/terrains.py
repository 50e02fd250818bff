"""Sea floors and ways to sound them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from app.arrays import FloatArray
from app.mapping.types import Grid, Soundings
from simulator.floors.seafloors import generate

GENERATED = ("reef", "harbour", "ridge", "smooth")
PATCHY = ("leixoes_sharp", "leixoes_sharp_diagonal", "leixoes_sharp_wall_sw", "reef (seed 1)")

DESIGNS: dict[str, tuple[float, float] | None] = {
    "random": None,
    "lines 4.2 m": (4.17, 2.5),
    "lines 10 m": (10.0, 1.0),
    "lines 10 m, continuous": (10.0, 0.26),
}
"""Distance between lines and between soundings on them, metres; None for 1000 random places."""


def terrains(folder: Path, only: list[str]) -> Iterator[tuple[str, FloatArray]]:
    """Names and depths on 1 m cells of all terrains of about 100 x 100 m, and of generated ones."""
    for path in sorted(folder.glob("*.npz")):
        if not only or path.stem in only:
            truth = _load(path)
            if truth is not None:
                yield path.stem, truth
    for family in GENERATED:
        name = f"{family} (seed 1)"
        if not only or name in only:
            yield name, np.asarray(generate(family, 1).z_m)


def _load(path: Path) -> FloatArray | None:
    with np.load(path) as file:
        z, cell = np.asarray(file["z"], float), float(file["cell_m"])
    if cell == 0.5:
        z = z[: z.shape[0] // 2 * 2, : z.shape[1] // 2 * 2]
        z = z.reshape(z.shape[0] // 2, 2, z.shape[1] // 2, 2).mean(axis=(1, 3))
    elif cell != 1.0:
        return None
    fits = max(z.shape) <= 120 and np.isfinite(z).all() and z.min() > 0.0
    return z if fits else None


def sound(truth: FloatArray, design: str, seed: int) -> tuple[Grid, FloatArray, Soundings]:
    """Turn the terrain by ``seed`` quarters and sound it; noise is 1 % of the range to a vehicle 2.5 m deep."""
    rng = np.random.default_rng(seed)
    truth = np.ascontiguousarray(np.rot90(truth, seed))
    grid = Grid(0.0, 0.0, 1.0, *truth.shape)
    lines = DESIGNS[design]
    if lines is None:
        east, north = rng.uniform(0, grid.cols, 1000), rng.uniform(0, grid.rows, 1000)
    else:
        n = max(1, round(grid.cols / lines[0]))
        places = np.meshgrid((np.arange(n) + 0.5) * grid.cols / n, np.arange(lines[1] / 2, grid.rows, lines[1]))
        east, north = (x.ravel() for x in places)
    depth = map_coordinates(truth, [north - 0.5, east - 0.5], order=1, mode="nearest")
    sd = 0.01 * np.maximum(depth - 2.5, 1.0)
    return grid, truth, Soundings(east, north, depth + sd * rng.standard_normal(len(depth)), sd)


def with_outliers(s: Soundings, seed: int) -> tuple[Soundings, np.ndarray]:
    """Make 2 % of the soundings wrong by up to half their depth; also return which."""
    rng = np.random.default_rng(1000 + seed)
    wrong = rng.random(len(s)) < 0.02
    factor = 1.0 + rng.uniform(-0.5, 0.5, len(s))
    return Soundings(s.east_m, s.north_m, np.where(wrong, s.depth_m * factor, s.depth_m), s.sd_m), wrong


def wide_floor(east: FloatArray, north: FloatArray) -> FloatArray:
    """An endless sea floor with relief from 20 m to 1 km wide, for large surveys."""
    rng = np.random.default_rng(0)
    size = np.geomspace(0.005, 0.3, 60)
    waves = rng.standard_normal((60, 2)) * size[:, None]
    z = np.full(np.shape(east), 30.0)
    for (a, b), phase, height in zip(waves, rng.uniform(0, 7, 60), 0.03 * size**-0.8, strict=True):
        z += height * np.sin(a * east + b * north + phase)
    return z
