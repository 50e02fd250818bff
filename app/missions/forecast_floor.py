"""The sea floor that a forecast is flown over: what was imported of it, and a guess for the rest."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon

from app.mapping.fusion import prior_map
from app.mapping.types import FloatArray, Soundings
from app.missions.map_builder import make_grid
from app.missions.spec import MissionSpec
from simulator.seafloors import generate
from simulator.terrain import Terrain

LEAST_GUESS_M = 10.0
ROOM_M = 3.0
"""How much deeper than the vehicles need the guessed floor is."""

RELIEF = 0.1
"""Standard deviation of the guessed floor's hills as a share of its depth."""

CELLS = 2500
"""Cells of a forecast's map at most: more make it slower, hardly other."""


@dataclass(frozen=True)
class Floor:
    """A floor and where it comes from, in words. ``known``: the share of the area's cells with imported soundings."""

    terrain: Terrain
    words: str
    known: float


def forecast_cell_m(spec: MissionSpec) -> float:
    """Return the side of the cells that a forecast is made on."""
    return float(max(spec.cell_m, np.sqrt(Polygon(spec.local_area()).area / CELLS)))


def floor_of(spec: MissionSpec, prior: FloatArray, deepest_m: float, depth_m: float | None) -> Floor:
    """Return the floor under a mission's area.

    Parameters
    ----------
    prior
        Imported soundings, shape (n, 4): east, north, depth, deviation.
    deepest_m
        Depth at which the deepest vehicle travels.
    depth_m
        Depth of the guessed part; None: a guess, too.
    """
    cell_m = forecast_cell_m(spec)
    grid, mask = make_grid(spec.local_area(), cell_m)
    guess = max(LEAST_GUESS_M, deepest_m + spec.limits.min_altitude_m + ROOM_M)
    known, share = np.full(mask.shape, np.nan), 0.0
    if len(prior):
        imported = prior_map(Soundings(*prior.T.copy()), grid, mask)
        known = imported.depth_m
        share = float(np.mean(imported.prior[mask])) if imported.prior is not None else 0.0
    has = np.isfinite(known)
    middle = depth_m if depth_m is not None else float(np.median(known[has])) if has.any() else guess
    # Two cells more, so that it is a floor however narrow the area is.
    rows, cols = grid.rows + 2, grid.cols + 2
    hills = generate("smooth", spec.seed % 2**31, width_m=cols * cell_m, height_m=rows * cell_m, cell_m=cell_m).z_m
    relief = (hills - hills.mean()) / max(float(hills.std()), 1e-9)
    z = middle * (1 + RELIEF * np.clip(relief, -3, 3))
    words = f"a gently rolling floor about {middle:.0f} m deep" + ("" if depth_m is not None else ", which is a guess")
    if has.any():
        # Outside of the area it goes on from the nearest place in it.
        near = distance_transform_edt(~has, return_distances=False, return_indices=True)
        inner = z[: grid.rows, : grid.cols]
        inner[:] = np.where(has, known, known[tuple(near)])
        words = f"as imported soundings have it, in {100 * share:.0f} % of the cells, and the map between them"
    return Floor(Terrain(np.maximum(z, 0.2), cell_m, name="forecast"), words, share)
