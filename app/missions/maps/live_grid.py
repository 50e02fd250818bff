"""What was sounded a moment ago: the papers' Gaussian interpolation, which takes every sounding in at once.

The considered map, a Gaussian process, takes seconds to make. Until it holds a sounding, the cells about that sounding
are shown as the interpolation has them. Between lines the interpolation says nothing here: that is left to the
considered map.
"""

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.cell_index import cell_numbers
from app.mapping.gaussian import MODEL, GaussianInterpolator, choose_width
from app.mapping.types import BathymetricMap, Grid, SoundingRows, Soundings

SHOWN_CELLS = 1.5
"""How far about a sounding the interpolation is shown, in cells: its own cell and those that touch it."""

FIRST_WIDTH_CELLS = 1.5
"""The kernel's width before there are soundings to choose it from."""

GROWTH = 2.0
"""The width is chosen anew when the soundings grew by this factor."""


@dataclass(frozen=True)
class LiveCells:
    """The cells about soundings that the considered map does not hold yet.

    Attributes
    ----------
    version
        Grows with every sounding.
    cells
        Which ones, (rows, cols).
    depth_m, sd_m : (k,), count : (k,)
        What the interpolation says there, and how many soundings lie in each, row by row.
    """

    version: int
    cells: BoolArray
    depth_m: FloatArray
    sd_m: FloatArray
    count: IntArray


class LiveGrid:
    """The interpolation of all soundings of a mission, and which of them are new.

    ``note`` may be called from the event loop at any time; everything else works in threads. Soundings are counted by
    their place in the order of arrival: ``upto`` is the number of soundings that had come.
    """

    def __init__(self, grid: Grid, mask: BoolArray) -> None:
        self._grid, self._mask = grid, mask
        self._noted: deque[SoundingRows] = deque()
        self._recent: deque[tuple[int, SoundingRows]] = deque()
        self._taken = 0
        self._chosen_of = 0
        self._lock = threading.Lock()
        self._base: tuple[SoundingRows, int] = np.zeros((0, 4)), 0
        self._interpolator: GaussianInterpolator | None = None
        self._fresh: LiveCells | None = None
        self.version = 0

    def note(self, soundings: SoundingRows) -> None:
        """Note soundings that came."""
        self._noted.append(soundings)
        self.version += len(soundings)

    def settle(self, soundings: SoundingRows, upto: int) -> None:
        """Take note that the considered map holds these, which were the mission's ``upto`` here."""
        with self._lock:
            self._take()
            if self._interpolator is None:
                self._base = soundings, upto
            while self._recent and self._recent[0][0] <= upto:
                self._recent.popleft()
            self._fresh = None

    def begin_anew(self, soundings: SoundingRows, upto: int) -> None:
        """Interpolate these, which were the mission's ``upto`` here, and what came since, once that is asked for.

        Most missions are opened to be looked at: until a vehicle sounds something the interpolation shows nothing.
        """
        with self._lock:
            self._base = soundings, upto
            self._interpolator = self._fresh = None
            self._chosen_of = len(soundings)

    def outgrown(self, count: int) -> bool:
        """Tell whether so many soundings deserve a new choice of the width."""
        return count >= GROWTH * max(self._chosen_of, 1)

    def release(self) -> None:
        """Let go of everything: nothing is new any more."""
        with self._lock:
            self._take()
            self._recent.clear()
            self._base = np.zeros((0, 4)), self._taken
            self._interpolator = self._fresh = None
            self._chosen_of = 0

    def fresh(self) -> LiveCells | None:
        """Return what the considered map does not hold yet; None where it holds everything."""
        with self._lock:
            self._take()
            if not self._recent:
                return None
            if self._fresh is None:
                rows = np.concatenate([rows for _, rows in self._recent])
                cells = _about(self._grid, rows) & self._mask
                self._fresh = LiveCells(self._taken, cells, *self._made().values_at(cells))
            return self._fresh

    def map(self) -> BathymetricMap | None:
        """Return the interpolation wherever it is in reach of a sounding; None before the first one."""
        with self._lock:
            self._take()
            if self._interpolator is None and not len(self._base[0]) and not self._recent:
                return None
            return self._made().to_map(self._mask)

    def _made(self) -> GaussianInterpolator:
        """Return the interpolation of everything so far."""
        if self._interpolator is None:
            base, upto = self._base
            width_m = FIRST_WIDTH_CELLS * self._grid.cell_m
            if len(base):
                width_m = choose_width(Soundings.of_rows(base), self._grid)
            made = GaussianInterpolator(self._grid, width_m)
            made.add(Soundings.of_rows(base))
            for until, rows in self._recent:
                if until > upto:
                    made.add(Soundings.of_rows(rows))
            # The builder holds them as long as it needs them.
            self._base = np.zeros((0, 4)), upto
            self._interpolator = made
        return self._interpolator

    def _take(self) -> None:
        """Take in what was noted."""
        while self._noted:
            rows = self._noted.popleft()
            self._taken += len(rows)
            self._recent.append((self._taken, rows))
            if self._interpolator is not None:
                self._interpolator.add(Soundings.of_rows(rows))
            self._fresh = None


def _about(grid: Grid, rows: SoundingRows) -> BoolArray:
    """Return which cells hold one of the soundings or touch a cell that does, (rows, cols)."""
    cells = np.unique(cell_numbers(grid, Soundings.of_rows(rows)))
    row, col = np.divmod(cells[cells >= 0], grid.cols)
    reach = int(SHOWN_CELLS)
    found = np.zeros((grid.rows, grid.cols), dtype=np.bool_)
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            if np.hypot(down, across) <= SHOWN_CELLS:
                r, c = row + down, col + across
                inside = (r >= 0) & (r < grid.rows) & (c >= 0) & (c < grid.cols)
                found[r[inside], c[inside]] = True
    return found


def map_of(grid: Grid, live: LiveCells) -> BathymetricMap:
    """Return a map of nothing but these cells, of which none is known to any accuracy."""
    shape = (grid.rows, grid.cols)
    depth, sd, count = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=np.int64)
    depth[live.cells], sd[live.cells], count[live.cells] = live.depth_m, live.sd_m, live.count
    return BathymetricMap(
        grid=grid,
        depth_m=depth,
        sd_m=sd,
        count=count,
        sounded=count > 0,
        roughness=np.where(live.cells, 1.0, np.nan),
        correlation_length_m=grid.cell_m,
        model=MODEL,
        bound_sd_m=np.full(shape, np.inf),
    )
