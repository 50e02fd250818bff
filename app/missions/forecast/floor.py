"""The sea floors that a forecast is flown over: what is known, and guesses of different roughness beside."""

import math
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

KINDS: tuple[tuple[str, str, float, float], ...] = (
    ("gently rolling", "smooth", 0.1, 0.0),
    ("rugged", "rugged", 0.15, 0.7),
    ("nearly flat", "smooth", 0.02, -0.7),
    ("rocky", "reef", 0.12, -0.2),
    ("cut by a canyon", "canyon", 0.25, 0.4),
    ("rough all over", "reef_field", 0.12, 1.4),
    ("rolling, with finer relief", "rugged", 0.08, -1.1),
    ("a slope", "slope", 0.2, 0.2),
    ("with rough low relief", "reef_field", 0.04, -0.4),
    ("a ridge", "ridge", 0.1, 1.0),
    ("steep", "smooth", 0.3, -1.4),
)
"""The guesses, the most telling first: in words, the family of generated floors, the standard deviation of its relief
as a share of the depth, and how much deeper it is than the usual guess where no depth is told, in deviations."""

DEPTH_SD = 0.4
"""Of the logarithm of a depth that is guessed."""

USUAL_RELIEF = 0.1
"""Between soundings a floor that is this high differs from their map as that map's deviation says."""

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


def thinned(rows: FloatArray, side_m: float) -> FloatArray:
    """Return the last of the soundings (n, 4) in each square of this side."""
    squares = np.floor(rows[::-1, :2] / side_m).astype(np.int64)
    _, last = np.unique(squares, axis=0, return_index=True)
    return rows[::-1][np.sort(last)]


def floors_of(spec: MissionSpec, rows: FloatArray, deepest_m: float, depth_m: float | None) -> Iterator[Floor]:
    """Return floors of different roughness that may lie under a mission's area, made as they are asked for.

    Where soundings are all are alike; the farther from them, the more they differ.

    Parameters
    ----------
    rows
        Soundings and what was imported, shape (n, 4): east, north, depth, deviation.
    deepest_m
        Depth at which the deepest vehicle travels.
    depth_m
        Depth of the guessed part; None: a guess, too.
    """
    cell_m = forecast_cell_m(spec)
    grid, mask = make_grid(spec.local_area(), cell_m)
    guess = max(LEAST_GUESS_M, deepest_m + spec.limits.min_altitude_m + ROOM_M)
    known, doubt, share = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan), 0.0
    if len(rows):
        imported = prior_map(Soundings.of_rows(thinned(rows, 0.5 * cell_m)), grid, mask)
        known, doubt = imported.depth_m, imported.sd_m
        share = float(np.mean(imported.prior[mask])) if imported.prior is not None else 0.0
    has = np.isfinite(known)
    usual_m = depth_m if depth_m is not None else float(np.median(known[has])) if has.any() else guess
    # Two cells more, so that it is a floor however narrow the area is.
    height, width = grid.rows + 2, grid.cols + 2
    for number, (kind, family, relief, deeper) in enumerate(KINDS):
        middle = usual_m
        if depth_m is None and not has.any():
            middle = max(guess * float(np.exp(DEPTH_SD * deeper)), deepest_m + spec.limits.min_altitude_m)
        seed = (spec.seed + number) % 2**31
        shape = generate(family, seed, width_m=width * cell_m, height_m=height * cell_m, cell_m=cell_m).z_m
        unit = np.clip((shape - shape.mean()) / max(float(shape.std()), 1e-9), -3, 3)
        z = middle + relief * middle * unit
        words = f"{kind}, about {middle:.0f} m deep" + ("" if depth_m is not None else ", which is a guess")
        if has.any():
            # Outside of the area, and where no map reaches, it goes on from the nearest place that is known.
            near = tuple(distance_transform_edt(~has, return_distances=False, return_indices=True))
            inner, hills = z[: grid.rows, : grid.cols], unit[: grid.rows, : grid.cols]
            # Early maps of smooth floors doubt too much, those of rough ones do not: every other floor bounds it.
            most_m = relief * middle if number % 2 == 0 else math.inf
            between_m = np.minimum(doubt * math.sqrt(relief / USUAL_RELIEF), most_m)
            apart_m = np.where(has, between_m, relief * middle) * hills
            inner[:] = known[near] + apart_m - np.where(has, 0.0, relief * middle * hills[near])
            words = f"as soundings have it, in {100 * share:.0f} % of the cells, and {kind} between them"
        yield Floor(Terrain(np.maximum(z, 0.2), cell_m, name="forecast"), words, kind, share)
