"""The sea floors that a forecast is flown over: what is known, and guesses of different roughness beside."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt
from scipy.spatial import Delaunay, cKDTree
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.mapping.gaussian_process.fusion import prior_map
from app.mapping.types import Grid, Soundings
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

CELLS = 2500
"""Cells of a forecast's map at most: more make it slower, hardly other."""

SMOOTH_SHARE = 0.4
"""Of what an early map doubts so much is left between its soundings where the floor is smoother than it has it."""

FLOOR_CELLS = 40_000
"""Cells of a floor at most: what is sounded of one with larger cells is smoother than the sea is."""


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


def floor_cell_m(spec: MissionSpec) -> float:
    """Return the side of the cells of the floors that are guessed."""
    return float(max(spec.cell_m, np.sqrt(Polygon(spec.local_area()).area / FLOOR_CELLS)))


def thinned(rows: FloatArray, side_m: float) -> FloatArray:
    """Return the last of the soundings (n, 4) in each square of this side."""
    squares = np.floor(rows[::-1, :2] / side_m).astype(np.int64)
    _, last = np.unique(squares, axis=0, return_index=True)
    return rows[::-1][np.sort(last)]


def floors_of(spec: MissionSpec, rows: FloatArray, deepest_m: float, depth_m: float | None) -> Iterator[Floor]:
    """Return floors of different roughness that may lie under a mission's area, made as they are asked for.

    Where soundings are all are alike; the farther from them, the more they differ. Between soundings they are as rough
    as the map of those has it: the next lines would know a smoother floor better than the real one.

    Parameters
    ----------
    rows
        Soundings and what was imported, shape (n, 4): east, north, depth, deviation.
    deepest_m
        Depth at which the deepest vehicle travels.
    depth_m
        Depth of the guessed part; None: a guess, too.
    """
    cell_m = floor_cell_m(spec)
    grid, mask = make_grid(spec.local_area(), cell_m)
    guess = max(LEAST_GUESS_M, deepest_m + spec.limits.min_altitude_m + ROOM_M)
    known, doubt, share, between = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan), 0.0, None
    if len(rows):
        used = thinned(rows, 0.5 * forecast_cell_m(spec))
        imported = prior_map(Soundings.of_rows(used), grid, mask)
        known, doubt, between = imported.depth_m, imported.sd_m, Between(grid, used)
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
        if between is not None and has.any():
            # Outside of the area, and where no map reaches, it goes on from the nearest place that is known.
            near = tuple(distance_transform_edt(~has, return_distances=False, return_indices=True))
            inner, hills = z[: grid.rows, : grid.cols], unit[: grid.rows, : grid.cols]
            # Early maps of smooth floors doubt too much, those of rough ones do not: every other floor bounds it, and
            # of the rest every other one has a part of it only.
            most_m = relief * middle if number % 2 == 0 else math.inf
            rough_m = np.minimum(doubt * (SMOOTH_SHARE if number % 4 == 3 else 1.0), most_m)
            left = between(hills)
            apart_m = left * math.sqrt(np.mean(rough_m[has] ** 2) / max(float(np.mean(left[has] ** 2)), 1e-12))
            inner[:] = known[near] + np.where(has, apart_m, relief * middle * (hills - hills[near]))
            words = f"as soundings have it, in {100 * share:.0f} % of the cells, and {kind} between them"
        yield Floor(Terrain(np.maximum(z, 0.2), cell_m, name="forecast"), words, kind, share)


class Between:
    """Tells what of a relief does not show at places that were sounded.

    Parameters
    ----------
    rows : (n, 4)
        Soundings: east, north, depth, deviation.
    """

    def __init__(self, grid: Grid, rows: FloatArray) -> None:
        self._grid = grid
        south_west_m, sides_m = np.array([grid.west_m, grid.south_m]), grid.cell_m * np.array([grid.cols, grid.rows])
        col, row = np.floor((rows[:, :2] - south_west_m) / grid.cell_m).astype(np.int64).T
        inside = (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols)
        cells = np.unique(row[inside] * grid.cols + col[inside])
        self._mesh: Delaunay | None = None
        if not len(cells):
            return
        places = grid.centres_m[cells]
        # Beyond the outermost ones it goes on as at the nearest.
        corners = south_west_m + [(i * sides_m[0], j * sides_m[1]) for i in (-0.01, 1.01) for j in (-0.01, 1.01)]
        self._cells = np.concatenate([cells, cells[cKDTree(places).query(corners)[1]]])
        self._mesh = Delaunay(np.vstack([places, corners]))

    def __call__(self, relief: FloatArray) -> FloatArray:
        """Return a relief (rows, cols) less what lines straight from one sounding to the next have of it."""
        if self._mesh is None:
            return relief
        straight = LinearNDInterpolator(self._mesh, relief.ravel()[self._cells])
        return relief - np.asarray(straight(self._grid.centres_m), dtype=np.float64).reshape(relief.shape)
