"""All lines that are left, foretold from the depths that are known: how long they are, and which way to lay them."""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.motion.dubins import lengths_m
from app.exploration.swath.lines import Line, lines, strips
from app.exploration.swath.raster import Flying, LineRaster, raster_of

CELLS_ALONG = (100, 250)
"""Cells of the longer side of the rasters that directions are compared on: fewest and most."""

CELLS_ACROSS = 10.0
"""Cells of such a raster that the narrowest swaths are wide."""

DOUBT = 0.06
"""Directions are compared with so much more overlap: what only just fits does not at sea."""

DIRECTIONS = 12
MOST_LINES = 600


@dataclass(frozen=True)
class Ahead:
    """Lines of one vehicle in the order they are flown, (k, 2) each in the direction of flight, and the way in all."""

    paths: list[FloatArray]
    length_m: float


def pose(path: FloatArray, *, end: bool = False) -> FloatArray:
    """Return place and heading (3,) at the beginning or the end of a path (k, 2)."""
    a, b = (path[-2], path[-1]) if end else (path[0], path[1])
    at = b if end else a
    return np.array([*at, np.arctan2(*(b - a))])


def path_m(path: FloatArray) -> float:
    """Return the length of a path (k, 2)."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def nearest_entry(
    raster: LineRaster, choice: list[Line], at: FloatArray | None, radius_m: float
) -> tuple[Line, FloatArray, float]:
    """Return the line whose closer end is reached first from a pose (3,), its path as flown, and the way there.

    ``at``: None, or with a heading of NaN where that is not known.
    """
    paths = [way for line in choice for there in (line.path(raster),) for way in (there, there[::-1])]
    if not paths:
        raise ValueError("there is no line to choose from")
    away_m = (
        np.zeros(len(paths)) if at is None else approaches_m(at, np.array([pose(path) for path in paths]), radius_m)
    )
    best = int(np.argmin(away_m))
    return choice[best // 2], paths[best], float(away_m[best])


def approaches_m(at: FloatArray, to: FloatArray, radius_m: float) -> FloatArray:
    """Return how long the ways from a pose (3,) to others (n, 3) are; straight where the first has no heading."""
    if np.isnan(at[2]):
        return np.asarray(np.hypot(*(to[:, :2] - at[:2]).T))
    return lengths_m(at, to, radius_m)


def ahead(
    raster: LineRaster, flying: Flying, at: FloatArray | None = None, sign: int = 1, most_m: float = np.inf
) -> Ahead | None:
    """Return all lines over what is open in a raster, flown by one vehicle from a pose (3,).

    None where they are longer than ``most_m`` in all, which shows before all are laid.
    """
    still = replace(raster, open=raster.open.copy())
    work_m = raster.work_m(flying)
    paths: list[FloatArray] = []
    length_m = 0.0
    for _ in range(MOST_LINES):
        if length_m + float(work_m[still.open].sum()) > most_m:
            return None
        large, small = strips(still, flying)
        choice = lines(still, large if large.any() else small, sign, flying)
        if not choice:
            break
        line, path, away_m = nearest_entry(still, choice, at, flying.radius_m)
        seen = still.seen(line.columns, line.across_m, flying)
        # What it cannot see from there it never will.
        seen[np.arange(len(line.columns)), still.rows_of(line.across_m)] = True
        first, last = line.columns[0], line.columns[-1] + 1
        before = int(still.open.sum())
        still.open[first:last] &= ~seen
        if int(still.open.sum()) == before:
            still.open[first:last] = False
        paths.append(path)
        length_m += away_m + path_m(path)
        at = pose(path, end=True)
    return Ahead(paths, length_m)


def best_direction(
    coverage: Coverage,
    flying: Flying,
    guess_m: float,
    preferred_rad: float,
    gain: float,
    least_cell_m: float = 0.0,
) -> tuple[float, float]:
    """Return in which direction lines are shortest in all, anticlockwise from east, and how long they are.

    ``preferred_rad`` stays unless another is shorter by more than the share ``gain``. Cells are not finer than
    ``least_cell_m``.
    """
    cells = np.argwhere(coverage.wanted)
    extent_m = float((np.ptp(cells, axis=0) + 1).max()) * coverage.cell_m
    known_m = coverage.depth_m[coverage.wanted & np.isfinite(coverage.depth_m)]
    shoal_m = np.array([guess_m]) if known_m.size == 0 else np.quantile(known_m, [0.05])
    fine_m = 2.0 * float(flying.half_width_m(shoal_m)[0]) / CELLS_ACROSS
    cell_m = float(np.clip(fine_m, extent_m / CELLS_ALONG[1], extent_m / CELLS_ALONG[0]))
    cell_m = max(cell_m, least_cell_m)

    careful = replace(flying, overlap=flying.overlap + DOUBT)

    def length_m(direction_rad: float, most_m: float) -> float:
        raster = raster_of(coverage, direction_rad, cell_m, guess_m)
        start = raster.axes.to_en(raster.corner_m)
        found = ahead(raster, careful, np.array([*start, np.nan]), most_m=most_m)
        return np.inf if found is None else found.length_m

    best, preferred_m = preferred_rad, length_m(preferred_rad, np.inf)
    shortest_m = preferred_m
    for k in range(1, DIRECTIONS):
        direction_rad = preferred_rad + np.pi * k / DIRECTIONS
        found_m = length_m(direction_rad, min(shortest_m, (1.0 - gain) * preferred_m))
        if found_m < np.inf:
            best, shortest_m = direction_rad, found_m
    return best, shortest_m
