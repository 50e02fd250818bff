"""All lines that are left, foretold from the depths that are known: how long they are, and which way to lay them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from app.arrays import BoolArray, FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.motion.dubins import lengths_m
from app.exploration.swath.assignment import Assignment
from app.exploration.swath.entries import nearest_entry, path_m, pose
from app.exploration.swath.lines import Line, lines, strips
from app.exploration.swath.passes import FILLING_OVERLAP, Passable, pieces
from app.exploration.swath.raster import Flying, LineRaster, raster_of
from app.exploration.swath.shares import between, part_of_others, share_out

CELLS_ALONG = (100, 250)
"""Cells of the longer side of the rasters that directions are compared on: fewest and most."""

CELLS_ACROSS = 10.0
"""Cells of such a raster that the narrowest swaths are wide."""

DOUBT = 0.06
"""Directions are compared with so much more overlap: what only just fits does not at sea."""

LEAST_SIDE = 3.0
"""Missed ground is foretold where it is as large as a square of so many cells: smaller pieces are no holidays."""

DIRECTIONS = 12
MOST_LINES = 600


@dataclass(frozen=True)
class Ahead:
    """Lines of a team in the order they are flown, (k, 2) each in the direction of flight, and how long it all is."""

    paths: list[FloatArray]
    length_m: float


def ahead(
    raster: LineRaster,
    flying: Flying,
    team: Mapping[str, FloatArray],
    most_m: float = np.inf,
    least_m2: float = 0.0,
) -> Ahead | None:
    """Return all lines over what is open in a raster, as a team flies them from its poses (3,).

    Shares, and the sides from which they are swept, are those of a survey that begins there: lines follow the edge of
    the last one, so that those of a slope are other ones, and others as long, from below than from above. Who has flown
    least takes the next line. What these miss is passed by on the way where that is the smallest detour, in pieces of
    at least ``least_m2``. None where all is longer than ``most_m``, which mostly shows before all lines are laid.
    """
    still = replace(raster, open=raster.open.copy())
    work_m = raster.work_m(flying)
    sweeps = {name: Assignment() for name in team}
    share_out(sweeps, raster, flying, team)
    flown_m = dict.fromkeys(team, 0.0)
    routes: dict[str, list[FloatArray]] = {name: [np.stack([at, at])] for name, at in team.items()}
    paths: list[FloatArray] = []
    found: list[Passable] | None = None
    while len(paths) < MOST_LINES:
        if sum(flown_m.values()) + float(work_m[still.open].sum()) > most_m:
            return None
        large, small = strips(still, flying)
        if large.any() and found is None:
            name, choice = _next_lines(sweeps, still, large, flying, flown_m)
        else:
            if found is None:
                still.open &= _noticed(small, least_m2 / raster.cell_m**2)
                found, still.open = pieces(still, still.open, replace(flying, overlap=FILLING_OVERLAP))
            if not still.open.any():
                break
            name, choice = min(flown_m, key=lambda one: flown_m[one]), lines(still, still.open, 1, flying)
        line, path, away_m = nearest_entry(still, choice, routes[name][-1][1], flying.radius_m)
        _see(still, line, flying)
        paths.append(path)
        flown_m[name] += away_m + path_m(path)
        routes[name].append(np.stack([pose(path), pose(path, end=True)]))
    length_m = sum(flown_m.values()) + _detours_m(
        [np.array(route) for route in routes.values()], found or [], flying.radius_m
    )
    return Ahead(paths, length_m) if length_m <= most_m else None


def _noticed(cells: BoolArray, fewest: float) -> BoolArray:
    """Return those of some cells (along, across) that lie in pieces of so many."""
    number, _ = label(cells, np.ones((3, 3)))
    return np.asarray(cells & (np.bincount(number.ravel())[number] >= fewest))


def _detours_m(routes: list[FloatArray], found: list[Passable], radius_m: float) -> float:
    """Return how much longer ways become by passing over pieces of ground: each is inserted where that is least.

    Parameters
    ----------
    routes : (k, 2, 3) each
        The poses in which the lines of each vehicle begin and end, in their order; where it is now comes first.
    """
    ways = list(routes)
    longer_m = 0.0
    for piece in found:
        best: tuple[float, int, int, int] | None = None
        for which, way in enumerate(ways):
            to_m = _between_m(way[:, None, 1], piece.begins[None], radius_m)
            cost_m = to_m + piece.lengths_m
            cost_m[:-1] += _between_m(piece.ends[None], way[1:, None, 0], radius_m)
            cost_m[:-1] -= _between_m(way[:-1, 1], way[1:, 0], radius_m)[:, None]
            at, k = divmod(int(cost_m.argmin()), cost_m.shape[1])
            if best is None or cost_m[at, k] < best[0]:
                best = float(cost_m[at, k]), which, at, k
        if best is None:
            break
        cost, which, at, k = best
        longer_m += max(cost, 0.0)
        ways[which] = np.insert(ways[which], at + 1, np.stack([piece.begins[k], piece.ends[k]]), axis=0)
    return longer_m


def _between_m(start: FloatArray, goal: FloatArray, radius_m: float) -> FloatArray:
    """Return the lengths (...) of the ways between poses (..., 3), straight where the first has no heading."""
    straight_m = np.hypot(*np.moveaxis(goal - start, -1, 0)[:2])
    return np.where(np.isnan(start[..., 2]), straight_m, lengths_m(start, goal, radius_m))


def _next_lines(
    sweeps: Mapping[str, Assignment],
    still: LineRaster,
    large: BoolArray,
    flying: Flying,
    flown_m: Mapping[str, float],
) -> tuple[str, list[Line]]:
    """Return who flies next, and the lines that it may fly over cells (along, across) that are swept."""
    names = sorted(flown_m, key=lambda name: flown_m[name])
    for name in names:
        sweep = sweeps[name]
        if sweep.share is None or not (large & between(still, sweep.share)).any():
            sweep.share = part_of_others(sweeps, name, still, large, flying)
        if sweep.share is None:
            continue
        mine = large & between(still, sweep.share)
        if mine.any():
            return name, lines(still, mine, sweep.share.sign, flying)
    return names[0], lines(still, large, 1, flying)


def _see(still: LineRaster, line: Line, flying: Flying) -> None:
    """Close what a line sees."""
    seen = still.seen(line.columns, line.across_m, flying)
    # What it cannot see from there it never will.
    seen[np.arange(len(line.columns)), still.rows_of(line.across_m)] = True
    first, last = line.columns[0], line.columns[-1] + 1
    before = int(still.open.sum())
    still.open[first:last] &= ~seen
    if int(still.open.sum()) == before:
        still.open[first:last] = False


def best_direction(
    coverage: Coverage,
    flying: Flying,
    guess_m: float,
    preferred_rad: float,
    gain: float,
    team: Mapping[str, FloatArray],
    least_cell_m: float = 0.0,
) -> tuple[float, float]:
    """Return in which direction a team's lines are shortest in all, anticlockwise from east, and how long they are.

    ``preferred_rad`` stays unless another is shorter by more than the share ``gain``. Cells are not finer than
    ``least_cell_m``. ``team``: the poses (3,) of its vehicles by name.
    """
    cells = np.argwhere(coverage.wanted)
    extent_m = float((np.ptp(cells, axis=0) + 1).max()) * coverage.cell_m
    known_m = coverage.depth_m[coverage.wanted & np.isfinite(coverage.depth_m)]
    shoal_m = np.array([guess_m]) if known_m.size == 0 else np.quantile(known_m, [0.05])
    fine_m = 2.0 * float(flying.half_width_m(shoal_m)[0]) / CELLS_ACROSS
    cell_m = float(np.clip(fine_m, extent_m / CELLS_ALONG[1], extent_m / CELLS_ALONG[0]))
    cell_m = max(cell_m, least_cell_m)

    careful = replace(flying, overlap=flying.overlap + DOUBT)
    least_m2 = (LEAST_SIDE * coverage.cell_m) ** 2

    def length_m(direction_rad: float, most_m: float) -> float:
        raster = raster_of(coverage, direction_rad, cell_m, guess_m)
        found = ahead(raster, careful, team, most_m, least_m2)
        return np.inf if found is None else found.length_m

    best, preferred_m = preferred_rad, length_m(preferred_rad, np.inf)
    shortest_m = preferred_m
    for k in range(1, DIRECTIONS):
        direction_rad = preferred_rad + np.pi * k / DIRECTIONS
        found_m = length_m(direction_rad, min(shortest_m, (1.0 - gain) * preferred_m))
        if found_m < np.inf:
            best, shortest_m = direction_rad, found_m
    return best, shortest_m
