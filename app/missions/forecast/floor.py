"""The sea floors that a forecast is flown over: what was imported, and guesses of different roughness for the rest."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.mapping.gaussian_process.fusion import prior_map
from app.mapping.types import Soundings
from app.missions.maps.builder import make_grid
from app.missions.spec.mission import MissionSpec
from simulator.floors.seafloors import generate
from simulator.floors.terrain import Terrain

LEAST_GUESS_M = 10.0
ROOM_M = 3.0
"""How much deeper than the vehicles need the guessed floor is."""

KINDS: tuple[tuple[str, str, float], ...] = (
    ("gently rolling", "smooth", 0.1),
    ("rugged", "rugged", 0.15),
    ("nearly flat", "smooth", 0.02),
    ("rolling, with finer relief", "rugged", 0.05),
    ("cut by a canyon", "canyon", 0.2),
)
"""The guesses, the most telling first: in words, the family of generated floors, the standard deviation of its relief
as a share of the depth."""

CELLS = 2500
"""Cells of a forecast's map at most: more make it slower, hardly other."""


@dataclass(frozen=True)
class Floor:
    """A floor and where it comes from, in words; ``kind`` is its roughness in words.

    ``known``: the share of the area's cells with imported soundings.
    """

    terrain: Terrain
    words: str
    kind: str
    known: float


def forecast_cell_m(spec: MissionSpec) -> float:
    """Return the side of the cells that a forecast is made on."""
    return float(max(spec.cell_m, np.sqrt(Polygon(spec.local_area()).area / CELLS)))


def floors_of(spec: MissionSpec, prior: FloatArray, deepest_m: float, depth_m: float | None) -> Iterator[Floor]:
    """Return floors of different roughness that may lie under a mission's area, made as they are asked for.

    Where soundings were imported all are alike; the farther from them, the more they differ.

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
    known, doubt, share = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan), 0.0
    if len(prior):
        imported = prior_map(Soundings.of_rows(prior), grid, mask)
        known, doubt = imported.depth_m, imported.sd_m
        share = float(np.mean(imported.prior[mask])) if imported.prior is not None else 0.0
    has = np.isfinite(known)
    middle = depth_m if depth_m is not None else float(np.median(known[has])) if has.any() else guess
    # Two cells more, so that it is a floor however narrow the area is.
    rows, cols = grid.rows + 2, grid.cols + 2
    for number, (kind, family, relief) in enumerate(KINDS):
        seed = (spec.seed + number) % 2**31
        shape = generate(family, seed, width_m=cols * cell_m, height_m=rows * cell_m, cell_m=cell_m).z_m
        hills = relief * middle * np.clip((shape - shape.mean()) / max(float(shape.std()), 1e-9), -3, 3)
        z = middle + hills
        words = f"{kind}, about {middle:.0f} m deep" + ("" if depth_m is not None else ", which is a guess")
        if has.any():
            # Outside of the area it goes on from the nearest place in it.
            near = distance_transform_edt(~has, return_distances=False, return_indices=True)
            free = np.minimum(doubt[tuple(near)] / max(relief * middle, 1e-9), 1.0)
            inner = z[: grid.rows, : grid.cols]
            inner[:] = known[tuple(near)] + free * hills[: grid.rows, : grid.cols]
            words = f"as imported soundings have it, in {100 * share:.0f} % of the cells, and {kind} between them"
        yield Floor(Terrain(np.maximum(z, 0.2), cell_m, name="forecast"), words, kind, share)
