"""The eight symmetries of the square: the same sea floor turned and mirrored, so that no direction is favoured."""

from dataclasses import replace

import numpy as np

from app.mapping.types import Soundings
from simulator.floors.terrain import Terrain

SYMMETRIES = 8


def turned(terrain: Terrain, symmetry: int) -> Terrain:
    """Return the terrain turned ``symmetry % 4`` times by 90 degrees clockwise, from 4 on mirrored as well."""
    z = np.rot90(terrain.z_m, symmetry % 4)
    return replace(terrain, z_m=z.T if symmetry >= 4 else z)


def turned_soundings(soundings: Soundings, terrain: Terrain, symmetry: int) -> Soundings:
    """Return the soundings where they lie on the turned terrain; ``terrain`` is the one they were taken on."""
    east, north = soundings.east_m, soundings.north_m
    width, height = terrain.width_m, terrain.height_m
    for _ in range(symmetry % 4):
        east, north = north, width - east
        width, height = height, width
    if symmetry >= 4:
        east, north = north, east
    return Soundings(east, north, soundings.depth_m, soundings.sd_m)
