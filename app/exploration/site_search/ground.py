"""Where a vehicle may go: explored cells away from everything else, straight legs over them, ways and distances."""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.occupancy import Cell
from app.exploration.core.search_task import SearchTask

STRAIGHT, DIAGONAL = 5, 7
"""Lengths of moves between cells in fifths of a cell: at most 8 % above or below the true length of a way."""
UNREACHED = np.int32(2**30)
_AROUND = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3), indexing="ij"), axis=-1).reshape(-1, 2)
LOOKAHEAD = 60.0
"""Legs of a whole way are at most this long, in cells."""
EVERY, SLACK = 0.1, 0.02
"""Distance between the points at which a leg is checked, and what is kept more than asked for there, in cells."""


@dataclass(frozen=True)
class SiteGround:
    """The site for one decision. Places are cells' (row, column).

    Attributes
    ----------
    task : SearchTask
        What it was made from.
    hazard : (rows, cols)
        Cells that are not known to be free: obstacles, and unexplored ones.
    passable : (rows, cols)
        Cells whose centre keeps the safety distance from every hazard, and off vehicles that stand, unless those are
        by the entry, where all come to be.
    """

    task: SearchTask
    hazard: BoolArray
    passable: BoolArray
    _beside: dict[tuple[float, float], IntArray] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, task: SearchTask) -> "SiteGround":
        """Make it from what is known now."""
        hazard = task.states != Cell.EXPLORED
        return cls(task, hazard, _away_from(hazard, _within(_margin(task))) & ~_taken(task))

    @classmethod
    def for_legs(cls, task: SearchTask) -> "SiteGround":
        """Make it for nothing but :meth:`clear`, which takes less: no place of it is passable."""
        hazard = task.states != Cell.EXPLORED
        return cls(task, hazard, np.zeros_like(hazard))

    def places(self, en_m: FloatArray) -> IntArray:
        """Return the cells (n, 2) of positions (n, 2), at the border those within."""
        places = np.stack(self.task.grid.cell_of(np.asarray(en_m, dtype=np.float64)), axis=-1)
        return np.asarray(np.minimum(np.maximum(places, 0), np.array(self.hazard.shape) - 1))

    def centre_m(self, place: IntArray) -> FloatArray:
        """Return centres (..., 2), east and north, of cells (..., 2)."""
        grid = self.task.grid
        return np.asarray(np.array([grid.west_m, grid.south_m]) + grid.cell_m * (place[..., ::-1] + 0.5))

    def clear(self, origin_m: FloatArray, ends_m: FloatArray) -> BoolArray:
        """Return which straight legs from (2,) to (n, 2) keep the safety distance from every hazard, all along.

        They keep what is spared beside it, too, or where a vehicle stands without that as much as it has, and off
        vehicles that stand. Where it is closer to something than that it may only get away.
        """
        grid = self.task.grid
        corner = np.array([grid.west_m, grid.south_m])
        return _off_standing(self.task, origin_m, ends_m) & _clear(
            self.hazard,
            (np.asarray(origin_m, dtype=np.float64) - corner) / grid.cell_m,
            np.ascontiguousarray((np.asarray(ends_m, dtype=np.float64) - corner) / grid.cell_m),
            self.task.safety_m / grid.cell_m,
            self.task.spare_m / grid.cell_m,
        )

    def beside(self, origin_m: FloatArray) -> IntArray:
        """Return the passable cells (n, 2) close to a position (2,) to whose centres a clear leg leads."""
        key = (float(origin_m[0]), float(origin_m[1]))
        if key in self._beside:
            return self._beside[key]
        place = self.places(origin_m[None])[0]
        around = place + _AROUND
        rows, cols = self.passable.shape
        around = around[(around >= 0).all(axis=1) & (around[:, 0] < rows) & (around[:, 1] < cols)]
        around = around[self.passable[around[:, 0], around[:, 1]]]
        around = around[self.clear(origin_m, self.centre_m(around))] if len(around) else around
        away = self.centre_m(around) - origin_m
        self._beside[key] = around[np.argsort(np.hypot(away[:, 0], away[:, 1]), kind="stable")]
        return self._beside[key]

    def distances(self, places: IntArray, until: IntArray | None = None) -> NDArray[np.int32]:
        """Return how far every passable cell is from the closest of some cells (n, 2), in fifths of a cell.

        ``until`` (m, 2): cells beyond the farthest of which nothing is asked; there it may say too much.
        """
        asked = np.zeros((0, 2), dtype=np.int64) if until is None else until
        return _distances(self.passable, np.ascontiguousarray(places, dtype=np.int64), asked)

    def hoped(self, places: BoolArray) -> NDArray[np.int32]:
        """Return how far every cell may be from the closest of some cells (rows, cols), unexplored ones taken as free.

        In fifths of a cell, as in :meth:`distances`.
        """
        return _distances(self._hoped_open, np.argwhere(places), np.zeros((0, 2), dtype=np.int64))

    @cached_property
    def _hoped_open(self) -> BoolArray:
        """Cells whose centre keeps the safety distance from every known obstacle."""
        return _away_from(self.task.states >= Cell.KNOWN, _within(_margin(self.task)))

    def may_be_open(self, en_m: FloatArray) -> bool:
        """Return whether a position (2,) is on the site and keeps the safety distance from every known obstacle."""
        [place], [on_site] = self.places(en_m[None]), np.stack(self.task.grid.cell_of(en_m[None]), axis=-1)
        return bool(np.array_equal(place, on_site) and self._hoped_open[place[0], place[1]])

    def way_m(self, origin_m: FloatArray, distance: NDArray[np.int32]) -> float:
        """Return how far it is from a position (2,) to where ``distance`` is 0; inf where there is no way."""
        cells = self.beside(origin_m)
        if len(cells) == 0:
            return float("inf")
        leg = np.hypot(*(self.centre_m(cells) - origin_m).T)
        return float(np.min(self.metres(distance[cells[:, 0], cells[:, 1]]) + leg))

    def reaches_m(self, origin_m: FloatArray) -> float:
        """Return how far the farthest place is to which ways lead from a position (2,); 0 where none leads anywhere."""
        far_m = self.metres(self.distances(self.beside(origin_m)))
        return float(far_m.max(initial=0.0, where=np.isfinite(far_m)))

    def metres(self, fifths: FloatArray | NDArray[np.int32] | int) -> FloatArray:
        """Return distances in metres; inf where there is no way."""
        far = np.asarray(fifths, dtype=np.float64)
        return np.where(far >= UNREACHED, np.inf, far * self.task.grid.cell_m / STRAIGHT)

    def way(self, origin_m: FloatArray, end_m: FloatArray) -> FloatArray | None:
        """Return the corners (n, 2) of a way between positions (2,), its end the last of them.

        Every leg of it is clear. None: no such way is known.
        """
        cells = self.beside(end_m)
        distance = self.distances(cells)
        corners: list[FloatArray] = []
        here_m = origin_m
        while not self.clear(here_m, end_m[None])[0]:
            on_m = self.towards(here_m, distance, LOOKAHEAD * self.task.grid.cell_m)
            if len(corners) > distance.size or np.array_equal(on_m, here_m):
                return None
            corners.append(on_m)
            here_m = on_m
        return np.array([*corners, end_m])

    def way_towards(self, origin_m: FloatArray, end_m: FloatArray) -> FloatArray | None:
        """Return the corners (n, 2) of a way to a position (2,), or as near to it as ways are known to lead.

        None: nowhere nearer than where it begins.
        """
        whole = self.way(origin_m, end_m)
        if whole is not None:
            return whole
        reached = np.argwhere(self.distances(self.beside(origin_m)) < UNREACHED)
        if len(reached) == 0:
            return None
        places = self.centre_m(reached)
        away_m = np.hypot(*(places - end_m).T)
        nearest = int(np.argmin(away_m))
        if away_m[nearest] > np.hypot(*(origin_m - end_m)) - self.task.grid.cell_m:
            return None
        return self.way(origin_m, places[nearest])

    def towards(self, origin_m: FloatArray, distance: NDArray[np.int32], step_m: float) -> FloatArray:
        """Return the next position (2,) on the way down ``distance``, as far as a clear leg of ``step_m`` goes."""
        cells = self.beside(origin_m)
        far = self.metres(distance[cells[:, 0], cells[:, 1]])
        if not np.isfinite(far).any():
            return origin_m.copy()
        leg = np.hypot(*(self.centre_m(cells) - origin_m).T)
        first = cells[int(np.argmin(far + leg))]
        most = int(3 * step_m / self.task.grid.cell_m) + 3
        way = np.vstack([first[None], _descend(self.passable, distance, first, most)])
        leg = self.centre_m(way) - origin_m
        length = np.hypot(leg[:, 0], leg[:, 1])
        # The whole leg has to be clear and its rest short: then the way goes on from wherever the step ends.
        close = length <= step_m + 2.0 * self.task.grid.cell_m
        close[0] = True
        reachable = np.flatnonzero(close & self.clear(origin_m, origin_m + leg))
        if len(reachable) == 0:
            return origin_m.copy()
        last = reachable[-1]
        return np.asarray(origin_m + leg[last] * min(1.0, step_m / max(float(length[last]), 1e-12)))


def _taken(task: SearchTask) -> BoolArray:
    """Return the cells (rows, cols) that are too near to vehicles that stand, those by the entry aside."""
    taken = np.zeros(task.grid.blueprint.shape, dtype=np.bool_)
    for place_m in task.standing_m:
        if np.hypot(*(place_m - task.entry_m)) > 2.0 * task.apart_m:
            taken |= np.hypot(*np.moveaxis(task.grid.centres_m - place_m, -1, 0)) < task.apart_m
    return taken


def _off_standing(task: SearchTask, origin_m: FloatArray, ends_m: FloatArray) -> BoolArray:
    """Return which legs from (2,) to (n, 2) keep off vehicles that stand, or lead away from them all along."""
    keeps = np.ones(len(ends_m), dtype=np.bool_)
    legs_m = np.asarray(ends_m, dtype=np.float64) - origin_m
    length2 = np.maximum(np.einsum("ij,ij->i", legs_m, legs_m), 1e-12)
    for place_m in task.standing_m:
        away_m = place_m - origin_m
        part = np.clip(legs_m @ away_m / length2, 0.0, 1.0)
        nearest_m = np.hypot(*(part[:, None] * legs_m - away_m).T)
        keeps &= (nearest_m >= task.apart_m) | (nearest_m >= np.hypot(*away_m) - 1e-9)
    return keeps


def _margin(task: SearchTask) -> float:
    """Return how far places to go to are from hazards, in cells: as far as legs to them are."""
    return (task.safety_m + task.spare_m) / task.grid.cell_m + SLACK


@cache
def _within(radius: float) -> IntArray:
    """Return the offsets (n, 2) at which a hazard's edge is closer than ``radius`` cells to a cell's centre."""
    k = int(np.ceil(radius + 0.5))
    row, col = np.indices((2 * k + 1, 2 * k + 1)) - k
    edge = np.hypot(np.maximum(np.abs(row) - 0.5, 0.0), np.maximum(np.abs(col) - 0.5, 0.0))
    return np.argwhere((edge < radius - 1e-9) | ((row == 0) & (col == 0))) - k


@njit(cache=True, nogil=True)
def _away_from(hazard: BoolArray, offsets: IntArray) -> BoolArray:
    """Return the cells from which there is no hazard at any of the offsets, which lie evenly about a cell."""
    rows, cols = hazard.shape
    away = np.ones((rows, cols), dtype=np.bool_)
    for row in range(rows):
        for col in range(cols):
            for k in range(len(offsets)):
                r, c = row + offsets[k, 0], col + offsets[k, 1]
                if 0 <= r < rows and 0 <= c < cols and hazard[r, c]:
                    away[row, col] = False
                    break
    return away


@njit(cache=True, nogil=True)
def _edge_distance(hazard: BoolArray, east: float, north: float, radius: float) -> float:
    """Return the distance of a point to the closest hazard's edge, at most ``radius``; coordinates in cells."""
    rows, cols = hazard.shape
    least = radius
    for row in range(max(0, int(np.floor(north - radius))), min(rows - 1, int(np.floor(north + radius))) + 1):
        for col in range(max(0, int(np.floor(east - radius))), min(cols - 1, int(np.floor(east + radius))) + 1):
            if hazard[row, col]:
                away = np.hypot(max(col - east, east - col - 1.0, 0.0), max(row - north, north - row - 1.0, 0.0))
                least = min(least, away)
    return least


@njit(cache=True, nogil=True)
def _clear(hazard: BoolArray, origin: FloatArray, ends: FloatArray, safety: float, spare: float) -> BoolArray:
    rows, cols = hazard.shape
    clear = np.ones(len(ends), dtype=np.bool_)
    least = safety + SLACK
    here = _edge_distance(hazard, origin[0], origin[1], least + spare)
    for k in range(len(ends)):
        if not (0.0 <= ends[k, 0] <= cols and 0.0 <= ends[k, 1] <= rows):
            clear[k] = False
            continue
        leg = ends[k] - origin
        points = max(1, int(np.ceil(np.hypot(leg[0], leg[1]) / EVERY)))
        before = here
        for i in range(1, points + 1):
            point = origin + leg * (i / points)
            away = _edge_distance(hazard, point[0], point[1], least + spare)
            if away < here - 1e-9 or (away < least and away <= before):
                clear[k] = False
                break
            before = away
    return clear


@njit(cache=True, nogil=True)
def _distances(passable: BoolArray, starts: IntArray, until: IntArray) -> NDArray[np.int32]:
    """Dial's algorithm: a ring of buckets, as many as the longest move is long.

    The cells lie in one line, with closed ones about the site, so that no neighbour has to be asked whether it is on
    it. Closed cells are closer than anything, so that no way to them is shorter.
    """
    rows, cols = passable.shape
    line = cols + 2
    distance = np.full((rows + 2) * line, -1, dtype=np.int32)
    free = np.zeros(len(distance), dtype=np.bool_)
    for row in range(rows):
        for col in range(cols):
            if passable[row, col]:
                free[(row + 1) * line + col + 1] = True
                distance[(row + 1) * line + col + 1] = UNREACHED
    asked = np.zeros(len(distance), dtype=np.bool_)
    open_ = 0
    for k in range(len(until)):
        place = (until[k, 0] + 1) * line + until[k, 1] + 1
        if not asked[place]:
            asked[place] = True
            open_ += 1
    # A cell enters the bucket of one distance at most once.
    ring = np.empty((DIAGONAL + 1, rows * cols + len(starts)), dtype=np.int32)
    filled = np.zeros(DIAGONAL + 1, dtype=np.int64)
    for k in range(len(starts)):
        place = (starts[k, 0] + 1) * line + starts[k, 1] + 1
        if distance[place] != 0:
            distance[place] = 0
            ring[0, filled[0]] = place
            filled[0] += 1
    waiting, now = filled[0], 0
    while waiting > 0 and (open_ > 0 or len(until) == 0):
        bucket = now % (DIAGONAL + 1)
        straight, diagonal = now + STRAIGHT, now + DIAGONAL
        beside, across = straight % (DIAGONAL + 1), diagonal % (DIAGONAL + 1)
        for at in range(filled[bucket]):
            place = ring[bucket, at]
            if distance[place] != now:
                continue
            if asked[place]:
                asked[place] = False
                open_ -= 1
            for step in (-line, line, -1, 1):
                if straight < distance[place + step]:
                    distance[place + step] = straight
                    ring[beside, filled[beside]] = place + step
                    filled[beside] += 1
                    waiting += 1
            for up in (-line, line):
                if not free[place + up]:
                    continue
                for aside in (-1, 1):
                    if diagonal < distance[place + up + aside] and free[place + aside]:
                        distance[place + up + aside] = diagonal
                        ring[across, filled[across]] = place + up + aside
                        filled[across] += 1
                        waiting += 1
        waiting -= filled[bucket]
        filled[bucket] = 0
        now += 1
    result = np.empty((rows, cols), dtype=np.int32)
    for row in range(rows):
        for col in range(cols):
            far = distance[(row + 1) * line + col + 1]
            result[row, col] = far if far >= 0 else UNREACHED
    return result


@njit(cache=True, nogil=True)
def _descend(passable: BoolArray, distance: NDArray[np.int32], start: IntArray, most: int) -> IntArray:
    """Return up to ``most`` cells from ``start`` (left out) down the distances."""
    rows, cols = distance.shape
    way = np.empty((most, 2), dtype=np.int64)
    row, col, n = start[0], start[1], 0
    while n < most and distance[row, col] > 0:
        best, to_r, to_c = distance[row, col], -1, -1
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if not (0 <= r < rows and 0 <= c < cols) or distance[r, c] >= UNREACHED:
                    continue
                if dr != 0 and dc != 0 and not (passable[row, c] and passable[r, col]):
                    continue
                if distance[r, c] < best:
                    best, to_r, to_c = distance[r, c], r, c
        if to_r < 0:
            break
        row, col = to_r, to_c
        way[n, 0], way[n, 1] = row, col
        n += 1
    return way[:n]
