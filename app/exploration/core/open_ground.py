"""Ground that turned out too shoal for vehicles even at the surface, and ways round it."""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import TOLERANCE_M, Constraints, inside_area

DETOUR = 3.0
"""A way round a shoal may be so many times as long as the stretch of the plan that it is flown in place of."""

BESIDE_M = 20.0
"""Whatever the stretch, so much longer."""

LEAST_M = 5.0
"""A shorter leg up to a shoal is left out."""

SMALL = 0.1
"""A part of the open ground is small that is smaller than this share of the largest."""

NEAREST = 40
"""So many cells about a vehicle that is beside a shoal are looked at, from which it may set out."""

NOWHERE = -9999
"""What comes before a cell that no way leads to."""

NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Rows and columns to half of a cell's neighbours."""


class WayRound(NamedTuple):
    """A way round a shoal to where a plan is taken up again.

    Attributes
    ----------
    corners_m : (k, 2)
        As planned up to the shoal, then round it; the last one is on the plan. Where the rest of the plan is over
        shoals, or behind them, only those up to the shoal, if any.
    passed : int
        So many of the plan's via points are left out.
    """

    corners_m: FloatArray
    passed: int


class OpenGround:
    """Where vehicles may go at the surface: in the area, off zones, over all ground that is not known to be too shoal.

    Parameters
    ----------
    bottom
        As it is estimated. Ground of which nothing is known is taken to be deep enough.
    constraints
        Give the area, the zones, and the least height above the sea floor.
    """

    def __init__(self, bottom: Bottom, constraints: Constraints) -> None:
        self._bottom = bottom
        self._constraints = constraints
        self._least_m = constraints.min_depth_m + constraints.min_altitude_m - TOLERANCE_M
        self._shoal = bottom.depth_m < self._least_m

    def is_cut_off(self, place_m: FloatArray, least_m2: float) -> bool:
        """Return whether a place (2,) is over a shoal, or in a part of the open ground that is smaller than that.

        Nobody is cut off in a part that is not much smaller than the largest, nor where no ground is open. What lies
        behind zones does not count.
        """
        if not self._shoal.any():
            return False
        largest = self.largest_part(place_m)
        if not largest.any():
            return False
        if bool(self.is_shoal(place_m)):
            return True
        part = int(self._at(self._parts, place_m[None])[0])
        cells = np.count_nonzero(self._parts == part)
        small = cells * self._bottom.cell_m**2 < least_m2 and cells < SMALL * np.count_nonzero(largest)
        return part > 0 and bool(small)

    def largest_part(self, place_m: FloatArray) -> BoolArray:
        """Return which cells are in the largest part of the open ground on a place's side of zones, (rows, cols)."""
        side = int(self._at(self._sides, place_m[None])[0])
        parts = self._parts if side == 0 else np.where(self._sides == side, self._parts, 0)
        sizes = np.bincount(parts.ravel(), minlength=2)[1:]
        return np.asarray((parts == int(np.argmax(sizes)) + 1) & (parts > 0), dtype=np.bool_)

    def nearest_m(self, place_m: FloatArray) -> FloatArray:
        """Return the middle of the nearest cell of the largest part of the open ground, (2,)."""
        cells = self.centres_m[self.largest_part(place_m).ravel()]
        return np.asarray(cells[np.argmin(np.hypot(*(cells - place_m).T))])

    @cached_property
    def _sides(self) -> IntArray:
        """Which cells ways join where there are no shoals, from 1 on; 0: nobody may be there, (rows, cols)."""
        sides, _ = label(self._free)
        return np.asarray(sides, dtype=np.int64)

    @cached_property
    def _parts(self) -> IntArray:
        """The part of the open ground that each cell belongs to, from 1 on; 0: to none, (rows, cols)."""
        parts, _ = label(self._free & ~self._shoal)
        return np.asarray(parts, dtype=np.int64)

    def is_shoal(self, en_m: FloatArray) -> BoolArray:
        """Return where places (..., 2) are over ground that is too shoal."""
        return np.asarray(self._bottom.at(en_m) < self._least_m, dtype=np.bool_)

    def way_round(self, here_m: FloatArray, ahead_m: FloatArray, step_m: float) -> WayRound | None:
        """Return the way of a vehicle round the next shoal on its plan; None where none is near, or where none leads.

        Near is what is within a step. It goes up to the shoal as planned, and takes the plan up again where that is
        open for half a step, or to its end.

        Parameters
        ----------
        here_m : (2,)
            Where the vehicle is.
        ahead_m : (k, 2)
            Where it goes one after the other, as planned.
        """
        if not self._shoal.any() or not len(ahead_m):
            return None
        places, of, along_m = self._sampled(here_m, ahead_m)
        shoal = self.is_shoal(places)
        first = int(np.argmax(shoal))
        if not shoal.any() or along_m[first] > step_m:
            return None
        goals = self._nodes_of(places)
        before = np.flatnonzero(goals[:first] >= 0)
        last = int(before[-1]) if len(before) and along_m[before[-1]] >= LEAST_M else 0
        start = self._node(places[last])
        if start < 0:
            return None
        away_m, previous = self._away(start)
        open_m = self._open_for(shoal, along_m)
        reached = (goals >= 0) & np.isfinite(np.where(goals >= 0, away_m[goals], np.inf)) & (open_m >= 0.5 * step_m)
        ends = np.flatnonzero(reached[first:]) + first
        upto = [*ahead_m[: of[last]], places[last]] if last else []
        if not len(ends):
            return WayRound(np.array(upto).reshape(-1, 2), len(ahead_m))
        instead_m = along_m[ends] - along_m[last]
        round_m = away_m[goals[ends]]
        short = ends[round_m <= DETOUR * instead_m + BESIDE_M]
        at = int(short[0] if len(short) else ends[np.argmin(round_m - instead_m)])
        node, way = int(goals[at]), [places[at]]
        while node not in (start, NOWHERE):
            way.append(self.centres_m[node])
            node = int(previous[node])
        if self._nodes_of(places[last : last + 1])[0] != start:
            way.append(self.centres_m[start])
        return WayRound(np.array([*upto, *self._straightened(places[last], way[::-1])]), int(of[at]))

    def _along(self, begin_m: FloatArray, end_m: FloatArray) -> FloatArray:
        pieces = max(int(np.ceil(2.0 * np.hypot(*(end_m - begin_m)) / self._bottom.cell_m)), 1)
        return np.asarray(begin_m + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (end_m - begin_m))

    def _sampled(self, here_m: FloatArray, ahead_m: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return places (n, 2) along a plan, before which via point each one is, and how far along."""
        places, of = [here_m[None]], [np.zeros(1, dtype=np.int64)]
        begin = here_m
        for k, end in enumerate(ahead_m):
            piece = self._along(begin, end)[1:]
            places.append(piece)
            of.append(np.full(len(piece), k, dtype=np.int64))
            begin = end
        way = np.concatenate(places)
        along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        return way, np.concatenate(of), along_m

    @staticmethod
    def _open_for(shoal: BoolArray, along_m: FloatArray) -> FloatArray:
        """Return for how long a plan leads over open ground from each of its places, (n,); inf up to its end."""
        next_m = np.where(shoal, along_m, np.inf)
        return np.asarray(np.minimum.accumulate(next_m[::-1])[::-1] - along_m)

    @cached_property
    def centres_m(self) -> FloatArray:
        """The middles of the cells, row by row, (n, 2)."""
        rows, cols = self._shoal.shape
        east, north = np.meshgrid(
            self._bottom.west_m + (np.arange(cols) + 0.5) * self._bottom.cell_m,
            self._bottom.south_m + (np.arange(rows) + 0.5) * self._bottom.cell_m,
        )
        return np.column_stack([east.ravel(), north.ravel()])

    @cached_property
    def is_roomy(self) -> BoolArray:
        """Which cells vehicles are led over: open ones none of whose neighbours is shoal, (rows, cols)."""
        around = np.lib.stride_tricks.sliding_window_view(np.pad(self._shoal, 1), (3, 3)).any(axis=(2, 3))
        return np.asarray(self._free & ~around, dtype=np.bool_)

    @cached_property
    def _free(self) -> BoolArray:
        return inside_area(self._constraints, self.centres_m).reshape(self._shoal.shape)

    def _at(self, of_cells: IntArray, places: FloatArray) -> IntArray:
        """Return what is told of the cells (rows, cols) that places (n, 2) lie in; 0 beyond them."""
        rows, cols = of_cells.shape
        col, row = np.floor((places - [self._bottom.west_m, self._bottom.south_m]) / self._bottom.cell_m).T.astype(int)
        on = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        return np.where(on, of_cells[np.where(on, row, 0), np.where(on, col, 0)], 0)

    def _nodes_of(self, places: FloatArray) -> IntArray:
        """Return the numbers of the cells that places (n, 2) lie in; -1 where nobody is led."""
        numbers = np.where(self.is_roomy, np.arange(1, self.is_roomy.size + 1).reshape(self.is_roomy.shape), 0)
        return self._at(numbers, places) - 1

    def _node(self, place_m: FloatArray) -> int:
        """Return the cell that a vehicle sets out from: its own, or the nearest that it gets to; -1: none."""
        own = int(self._nodes_of(place_m[None])[0])
        if own >= 0:
            return own
        nodes = np.flatnonzero(self.is_roomy.ravel())
        away_m = np.hypot(*(self.centres_m[nodes] - place_m).T)
        nearest = nodes[np.argsort(away_m, kind="stable")[:NEAREST]]
        return next((int(node) for node in nearest if not self._bars(place_m, self.centres_m[node])), -1)

    def _bars(self, begin_m: FloatArray, end_m: FloatArray) -> bool:
        """Return whether a straight leg leads over ground that is too shoal."""
        return bool(self.is_shoal(self._along(begin_m, end_m)).any())

    def _away(self, start: int) -> tuple[FloatArray, IntArray]:
        """Return how far all cells are from one, (n,), and which comes before each on the way there."""
        rows, cols = self._shoal.shape
        row, col = np.nonzero(self.is_roomy)
        from_, to, length_m = [], [], []
        for down, right in NEIGHBOURS:
            there = (row + down < rows) & (col + right >= 0) & (col + right < cols)
            a, b = row[there], col[there]
            there = self.is_roomy[a + down, b + right]
            from_.append(a[there] * cols + b[there])
            to.append((a[there] + down) * cols + b[there] + right)
            length_m.append(np.full(there.sum(), self._bottom.cell_m * np.hypot(down, right)))
        edges = np.concatenate(length_m), (np.concatenate(from_), np.concatenate(to))
        graph = csr_matrix(edges, shape=(rows * cols, rows * cols))
        away_m, previous = dijkstra(graph, directed=False, indices=[start], return_predecessors=True)
        return away_m[0], previous[0]

    def _straightened(self, here_m: FloatArray, way_m: list[FloatArray]) -> list[FloatArray]:
        """Return the corners of a way, each (2,), that are needed: from each the next one is seen over open ground."""
        corners: list[FloatArray] = []
        begin, at = here_m, 0
        while at < len(way_m):
            seen = at
            while seen + 1 < len(way_m) and self._is_seen(begin, way_m[seen + 1]):
                seen += 1
            corners.append(way_m[seen])
            begin, at = way_m[seen], seen + 1
        return corners

    def _is_seen(self, begin_m: FloatArray, end_m: FloatArray) -> bool:
        return bool((self._nodes_of(self._along(begin_m, end_m)[1:]) >= 0).all())
