"""Sea floors by what a command line says: terrain files, folders of them, generated ones as FAMILY:SEED."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from simulator.floors.seafloors import FAMILIES, generate
from simulator.floors.terrain import Terrain, TerrainError
from simulator.floors.terrain_files import load_terrain

CELLS = 100.0
SUFFIXES = (".npz", ".asc", ".tif", ".tiff", ".xyz", ".csv")


def sea_floors_of(texts: Sequence[str]) -> list[Terrain]:
    """Return the sea floors that texts name, each one or several with commas between. Raises as :func:`sea_floor`."""
    result: list[Terrain] = []
    for text in (part.strip() for several in texts for part in several.split(",")):
        folder = Path(text)
        if not folder.is_dir() or not text:
            result.append(sea_floor(text))
            continue
        found = sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES)
        if not found:
            raise TerrainError(f"the folder {text!r} holds no terrain file ({', '.join(SUFFIXES)})")
        result += [sea_floor(str(file)) for file in found]
    return result


def sea_floor(text: str) -> Terrain:
    """Return the sea floor that the text names. Raises TerrainError or OSError."""
    family, colon, seed = text.partition(":")
    if colon and family in FAMILIES:
        if not seed.isdecimal():
            raise TerrainError(f"{text!r} must be FAMILY:SEED with a seed of 0 or more, for example {family}:1")
        return replace(generate(family, int(seed), width_m=CELLS, height_m=CELLS), name=text)
    path = Path(text)
    if not path.is_file():
        raise TerrainError(
            f"{text!r} is neither a file nor FAMILY:SEED with one of the families {', '.join(sorted(FAMILIES))}"
        )
    return replace(load_terrain(path), name=path.stem)
