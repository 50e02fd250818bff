"""The sea floors of the report: real ones where the folder has them, and generated ones that are always there."""

from dataclasses import replace
from pathlib import Path

from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain
from simulator.floors.terrain_files import load_terrain

REAL = ("calibration_smooth", "monterey_coast_range", "fortbragg_gully", "leixoes_sharp_diagonal")
"""File names; the first two stand for the papers' Map #1 and Map #2, which were never published."""

GENERATED = (("rugged", 1), ("ridge", 1))
"""Families and seeds: fractal relief, and a ridge across a nearly flat bottom."""

CELLS = 100.0


def report_terrains(folder: Path | None) -> tuple[tuple[Terrain, ...], tuple[str, ...]]:
    """Return the terrains that there are, and the names of the real ones that are missing."""
    files = {} if folder is None else {name: folder / f"{name}.npz" for name in REAL}
    found = [replace(load_terrain(file), name=name) for name, file in files.items() if file.is_file()]
    missing = tuple(name for name in REAL if name not in files or not files[name].is_file())
    generated = [generate(family, seed, width_m=CELLS, height_m=CELLS) for family, seed in GENERATED]
    return (*found, *generated), missing
