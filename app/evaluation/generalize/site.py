"""A site to be searched, made of a sea floor: what rises above a vehicle's depth is an obstacle."""

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, label

from app.arrays import BoolArray, FloatArray
from simulator.floors.terrain import Terrain
from simulator.obstacles.obstacles import ObstacleWorld

RISING_PART = 0.18
"""Part of the floor that rises above the depth at which the site is searched."""
SMOOTH_CELLS, CHART_CELLS = 1.0, 5.0
"""Standard deviation by which relief is smoothed before it is cut, and before a chart of it is drawn."""
ROOM_CELLS = 4.0
"""Least distance of entry and goal from obstacles."""


def site_of(floor: Terrain) -> ObstacleWorld:
    """Return the site of a sea floor; a chart shows the large obstacles of it, as smooth as charts are.

    Entry and goal are the places with room that lie nearest to the south-western and to the north-eastern quarter's
    middle and that a way connects.
    """
    relief = gaussian_filter(floor.z_m, SMOOTH_CELLS)
    depth = float(np.quantile(relief, RISING_PART))
    solid = relief < depth
    chart = solid & (gaussian_filter(floor.z_m, CHART_CELLS) < depth)
    north, east = (np.indices(solid.shape) + 0.5) * floor.cell_m
    room = _room(solid) >= ROOM_CELLS
    parts, _ = label(room)
    sizes = np.bincount(parts[room]) if room.any() else np.zeros(1)
    if sizes.max() == 0:
        raise ValueError(f"{floor.name}: leaves no room to search in")
    open_ = parts == int(np.argmax(sizes))

    def nearest(place_m: FloatArray) -> FloatArray:
        away = np.where(open_, np.hypot(east - place_m[0], north - place_m[1]), np.inf)
        row, col = np.unravel_index(int(np.argmin(away)), away.shape)
        return np.array([east[row, col], north[row, col]])

    size = np.array([floor.width_m, floor.height_m])
    entry, goal = nearest(0.08 * size), nearest(0.67 * size)
    return ObstacleWorld(floor.name, solid, chart, floor.cell_m, entry, goal, entry)


def _room(solid: BoolArray) -> FloatArray:
    """Return the distance of every cell (rows, cols) from obstacles and from the border, in cells."""
    return np.asarray(distance_transform_edt(np.pad(~solid, 1)))[1:-1, 1:-1]
